"""What optimal control controls: mechanisms with some of their joints driven.

    M(q) q'' + h(q, q') = S u - b q',    x = (q, v),    x' = f(x, u) = (v, M^-1 (S u - b v - h))

S (nv, nu) picks the driven joints. M and h include a payload, a point mass at the tip; b
[N m s/rad] is viscous friction, the same at every joint. Pendulums and the pole hang at q = 0.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import pinocchio as pin

from labs.algorithms.integrators import Acceleration
from labs.errors import LabError
from labs.models.arms import Arm, load_arm
from labs.models.cart_pole import cart_pole
from labs.models.mass_on_a_line import mass_on_a_line
from labs.models.pendulums import pendulum_arm
from labs.models.plant import Force, Plant, model_with_payload


@dataclass(frozen=True, eq=False)
class Mechanism:
    """One mechanism: a plant, and which of its joints are driven."""

    name: str
    plant: Plant
    actuated_joints: tuple[int, ...]
    """Indices of the joints that have a motor."""
    friction: float

    @property
    def arm(self) -> Arm:
        """What draws it."""
        return self.plant.arm

    @property
    def model(self) -> pin.Model:
        return self.plant.model

    @property
    def data(self) -> pin.Data:
        """A workspace: its contents mean nothing between calls."""
        return self.plant.data

    @cached_property
    def nq(self) -> int:
        return int(self.model.nq)

    @property
    def nx(self) -> int:
        return 2 * self.nq

    @property
    def nu(self) -> int:
        return len(self.actuated_joints)

    @cached_property
    def S(self) -> np.ndarray:
        """(nv, nu) from controls to joint torques."""
        return np.eye(self.nq)[:, list(self.actuated_joints)]

    @property
    def control_limit(self) -> np.ndarray:
        """(nu,) [N m; N]: what each motor can give, in either direction."""
        return self.arm.torque_limit[list(self.actuated_joints)]

    def acceleration(self, held: np.ndarray, force: Force | None = None) -> Acceleration:
        """a(q, v) under the control `held` (nu,) [N m; N] and a force on the tip. The control is
        read at every call, so whoever holds the array may write the next one into it."""
        if self.nu == self.nq:
            return self.plant.acceleration(held, self.friction, force)
        aba, model, data, b, S = pin.aba, self.model, self.data, self.friction, self.S
        if force is not None:
            pushed = self.plant.force_to_torque(force)
            return lambda q, v: aba(model, data, q, v, S @ held - b * v + pushed(q))
        return lambda q, v: aba(model, data, q, v, S @ held - b * v)

    def f(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """x' (nx,)."""
        n, rate = self.nq, np.empty_like(x)
        v = x[n:]
        torque = u if len(u) == n else self.S @ u
        if self.friction > 0.0:
            torque = torque - self.friction * v
        rate[:n], rate[n:] = v, pin.aba(self.model, self.data, x[:n], v, torque)
        return rate

    def derivatives(
        self, X: np.ndarray, U: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """f, f_x and f_u at N points at once: (N, nx), (N, nx, nx), (N, nx, nu), from X (N, nx)
        and U (N, nu), by Pinocchio's derivatives of the articulated-body algorithm."""
        n, many = self.nq, len(U)
        f, f_x = np.empty((many, 2 * n)), np.zeros((many, 2 * n, 2 * n))
        by_tau = np.empty((many, n, n))
        Q, V = np.ascontiguousarray(X[:many, :n]), np.ascontiguousarray(X[:many, n:])
        tau = (U if self.nu == n else U @ self.S.T) - self.friction * V
        model, data, derivatives = self.model, self.data, pin.computeABADerivatives
        # Views made once: the loop allocates only what Pinocchio returns.
        views = zip(f[:, n:], f_x[:, n:, :n], f_x[:, n:, n:], by_tau, strict=True)
        for q, v, torque, (a, a_q, a_v, a_tau) in zip(Q, V, tau, views, strict=True):
            a_q[:], a_v[:], a_tau[:] = derivatives(model, data, q, v, torque)
            a[:] = data.ddq
        f[:, :n] = V
        f_x[:, range(n), range(n, 2 * n)] = 1.0
        if self.friction > 0.0:
            f_x[:, n:, n:] -= self.friction * by_tau
        f_u = np.zeros((many, 2 * n, self.nu))
        f_u[:, n:] = by_tau[:, :, list(self.actuated_joints)]
        return f, f_x, f_u

    def equilibrium_control(self, q: np.ndarray) -> np.ndarray:
        """u (nu,) that keeps q (nq,) at rest: the torques of gravity at the driven joints. Raises
        LabError where gravity moves a joint without a motor."""
        gravity = pin.computeGeneralizedGravity(self.model, self.data, q)
        free = [i for i in range(self.nq) if i not in self.actuated_joints]
        if np.abs(gravity[free]).max(initial=0.0) > 1e-9:
            raise LabError(
                f"{self.name} cannot rest at q = {np.round(q, 3)}: gravity moves joint "
                f"{free[int(np.argmax(np.abs(gravity[free])))] + 1}, which has no motor"
            )
        return np.asarray(gravity[list(self.actuated_joints)])

    def tip(self, q: np.ndarray) -> np.ndarray:
        """Position of the tip (3,) [m]."""
        return self.plant.tip(q)

    def tip_positions(self, X: np.ndarray) -> np.ndarray:
        """Positions of the tip (k, 3) [m] at the states X (k, nx)."""
        return np.array([self.tip(x[: self.nq]) for x in X]).reshape(-1, 3)

    def tip_jacobian(self, q: np.ndarray) -> np.ndarray:
        """J(q), (3, nv): velocity of the tip in the world's axes is J(q) q'."""
        return self.plant.tip_jacobian(q)

    def velocity_jump(self, q: np.ndarray, impulse: np.ndarray) -> np.ndarray:
        """How v (nv,) changes when an impulse (3,) [N s] strikes the tip at q: M^-1 J' impulse."""
        J = self.tip_jacobian(q)
        inverse = np.reshape(pin.computeMinverse(self.model, self.data, q), (len(q), len(q)))
        return np.asarray(inverse @ J.T @ impulse)


MECHANISMS: Mapping[str, tuple[Callable[[], Arm], tuple[int, ...]]] = {
    "pendulum": (lambda: pendulum_arm(1), (0,)),
    "double-pendulum": (lambda: pendulum_arm(2), (0, 1)),
    "acrobot": (lambda: pendulum_arm(2), (1,)),
    "pendubot": (lambda: pendulum_arm(2), (0,)),
    "cart-pole": (cart_pole, (0,)),
    "ur5": (lambda: load_arm("ur5"), tuple(range(6))),
    "mass": (mass_on_a_line, (0,)),
}
"""By name: what moves, and which joints are driven. The acrobot is the double pendulum driven
at its elbow alone, the pendubot at its shoulder alone."""


@lru_cache(maxsize=32)
def mechanism(name: str, payload: float = 0.0, friction: float = 0.0) -> Mechanism:
    """The mechanism of this name, carrying `payload` [kg] at its tip. Raises LabError, listing
    those there are."""
    if name not in MECHANISMS:
        raise LabError(f"no mechanism is named {name!r}; there are {', '.join(MECHANISMS)}")
    build, driven = MECHANISMS[name]
    arm = build()
    model = model_with_payload(arm, payload)
    return Mechanism(name, Plant(arm, model, model.createData()), driven, friction)
