"""Candidates for V: what might be a Lyapunov function of a closed loop."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from labs.algorithms.lyapunov import solve_lyapunov
from labs.appendix.lyapunov.closed_loop import DIFFERENCE_STEP, ClosedLoop
from labs.models.mass_on_a_line import BLOCK_MASS
from labs.resumable import Resumable, run_to_completion
from labs.tasks.phase_plane.systems import GRAVITY_TORQUE, INERTIA

CANDIDATES: Mapping[str, str] = {
    "drawn": "Ellipses, dragged",
    "energy": "Energy",
    "riccati": "Riccati's P",
    "lyapunov": "Lyapunov equation",
    "value": "Cost of MPC, V*_N",
}


Formula = Callable[[np.ndarray], np.ndarray]


class Ellipse(NamedTuple):
    """{V = 1}: its first axis is turned by `angle` [deg] from that of positions, half of both
    axes in parts of the window."""

    angle: float
    axis_1: float
    axis_2: float


@dataclass(frozen=True)
class Candidate:
    """V, and what it is near the origin, V = x' P x + O(|x|^3)."""

    formula: Callable[[np.ndarray], Resumable[np.ndarray]]
    P: np.ndarray
    quadratic: bool = False
    """Whether V = x' P x everywhere."""

    def values(self, X: np.ndarray) -> Resumable[np.ndarray]:
        """V (k,) at states X (k, 2)."""
        return self.formula(X)


def candidate(name: str, loop: ClosedLoop, ellipse: Ellipse) -> Candidate:
    """The one of this name. Raises LabError for the Lyapunov equation of an unstable loop."""
    match name:
        case "drawn":
            return quadratic_candidate(ellipse_matrix(ellipse, loop.window))
        case "energy":
            return energy_candidate(loop)
        case "lyapunov":
            return quadratic_candidate(solve_lyapunov(loop.A, loop.Q))
        case "value" if loop.settings.system == "mpc":
            return Candidate(lambda X: _mpc_cost(loop, X), _mpc_cost_matrix(loop))
        case _:
            return quadratic_candidate(0.5 * loop.riccati)


def quadratic_candidate(P: np.ndarray) -> Candidate:
    """V = x' P x."""

    return Candidate(_as_resumable(lambda X: np.einsum("ki,ij,kj->k", X, P, X)), P, quadratic=True)


def ellipse_matrix(ellipse: Ellipse, window: tuple[float, float]) -> np.ndarray:
    """P (2, 2) of the V that is 1 on the ellipse."""
    turn = np.radians(ellipse.angle)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) / window
    return np.asarray(axes.T / [ellipse.axis_1**2, ellipse.axis_2**2] @ axes)


def energy_candidate(loop: ClosedLoop) -> Candidate:
    """Kinetic and potential energy, zero at the rest; PD's stiffness is a spring."""
    match loop.settings.system:
        case "pd":
            kp = loop.settings.kp
            return _mechanical_energy(
                INERTIA,
                lambda q: GRAVITY_TORQUE * (1.0 - np.cos(q)) + 0.5 * kp * q**2,
                0.5 * (GRAVITY_TORQUE + kp),
            )
        case "lqr":
            return _mechanical_energy(
                INERTIA, lambda q: -GRAVITY_TORQUE * (1.0 - np.cos(q)), -0.5 * GRAVITY_TORQUE
            )
        case "mpc":
            return _mechanical_energy(BLOCK_MASS, lambda q: 0.0 * q, 0.0)
        case _:
            return _mechanical_energy(BLOCK_MASS, lambda q: 0.5 * q**2, 0.5)


def _mechanical_energy(inertia: float, potential: Formula, curvature: float) -> Candidate:
    P = np.diag([curvature, 0.5 * inertia])
    return Candidate(_as_resumable(lambda X: P[1, 1] * X[:, 1] ** 2 + potential(X[:, 0])), P)


def _as_resumable(formula: Formula) -> Callable[[np.ndarray], Resumable[np.ndarray]]:
    def resumable(X: np.ndarray) -> Resumable[np.ndarray]:
        yield from ()
        return formula(X)

    return resumable


def _mpc_cost(loop: ClosedLoop, X: np.ndarray) -> Resumable[np.ndarray]:
    found = yield from loop.planner.values(X)
    return found.V


def _mpc_cost_matrix(loop: ClosedLoop) -> np.ndarray:
    """P (2, 2) of V*_N, which is quadratic where no limit is met."""
    q, v = DIFFERENCE_STEP * np.array(loop.window)
    V = run_to_completion(_mpc_cost(loop, np.array([[q, 0.0], [0.0, v], [q, v]])))
    both = 0.5 * (V[2] - V[0] - V[1]) / (q * v)
    return np.array([[V[0] / q**2, both], [both, V[1] / v**2]])
