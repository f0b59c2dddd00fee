"""A linear quadratic regulator for one of the systems at rest, as a policy for all times.

    u = u_eq + K_t (x - x_eq),    K_t from the weights Q, R, Q_f over a horizon N (notes, 2.4)

What happens beyond N the notes leave open; here one may choose:

    steady     K_s of the steady state at every step (2.4.2)
    window     K_0, K_1, ..., K_(N-1), and then over again
    receding   K_0 at every step: always N steps to go, as in model predictive control
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from labs.algorithms.riccati import SteadyState, solve, steady_state, steady_state_by_scipy
from labs.errors import LabError
from labs.optimal_control.lqr.linear_systems import LinearSystem, linear_system
from labs.optimal_control.lqr.own_system import OwnSystem, parse_own_system
from labs.problems.linear_quadratic import LqrPolicy, LqrProblem

MAX_RECURSIONS = 20_000
"""Steps of the recursion towards the steady state, at most."""
SETTLING_BAND = 0.01
"""Within this share of its steady value an element counts as constant."""

LQR_POLICIES = {
    "steady": "Steady state",
    "window": "Horizon, then over again",
    "receding": "Receding horizon",
}
FINAL_WEIGHTS = {"q": "α Q", "p": "α P of the steady state"}


@dataclass(frozen=True)
class RegulatorSettings:
    """What fixes a regulator. `weights` are Q's diagonal: of what slides [1/m^2], of what turns
    [1/rad^2], and of their rates [s^2/m^2, s^2/rad^2]; R = r I."""

    system: str
    period: float
    """T [s]."""
    weights: tuple[float, float, float, float]
    r: float
    horizon: int
    final: str
    """One of FINAL_WEIGHTS, what Q_f is a multiple of."""
    alpha: float
    policy: str
    """One of LQR_POLICIES."""
    own: str = ""
    """The matrices, where the system is "own"; Q and R are then among them, and ..."""
    continuous: bool = False
    """... A and B may be those of x' = A x + B u."""

    @property
    def linear_system(self) -> LinearSystem | OwnSystem:
        """What is regulated."""
        return (
            parse_own_system(self.own, self.continuous) if self.own else linear_system(self.system)
        )


@dataclass(frozen=True, eq=False)
class Regulator:
    """The policy and what is known of it. What cannot be is no error here but `trouble`."""

    settings: RegulatorSettings
    problem: LqrProblem
    optimal: LqrPolicy | None
    """Over the horizon; None where there is none."""
    steady: SteadyState | None
    """None where there is no steady state."""
    trouble: str
    """Empty, or a sentence on why there is no such policy."""

    @property
    def system(self) -> LinearSystem | OwnSystem:
        return self.settings.linear_system

    @cached_property
    def gains(self) -> np.ndarray:
        """K (M, nu, nx), to be used in turn."""
        if self.settings.policy == "steady" and self.steady:
            return self.steady.gain[None]
        assert self.optimal is not None
        return self.optimal.gains[:1] if self.settings.policy == "receding" else self.optimal.gains

    @cached_property
    def values(self) -> np.ndarray:
        """P (M, nx, nx): what the policy expects to pay from each of these steps on."""
        if self.settings.policy == "steady" and self.steady:
            return self.steady.value[None]
        assert self.optimal is not None
        return self.optimal.values[: len(self.gains)]

    @cached_property
    def spectral_radius(self) -> float:
        """By what factor dx grows or shrinks in a period in the long run, where it is small: the
        spectral radius of one cycle of gains, per period."""
        p, cycle = self.problem, np.eye(self.problem.n)
        for gain in self.gains:
            cycle = (p.a + p.b @ gain) @ cycle
        return float(np.abs(np.linalg.eigvals(cycle)).max() ** (1.0 / len(self.gains)))

    @cached_property
    def riccati_error(self) -> float:
        """Largest difference of the recursion's P to SciPy's, as a share of the largest entry;
        -1 where there is no steady state or SciPy finds none."""
        p = self.problem
        if self.steady is None:
            return -1.0
        try:
            reference = steady_state_by_scipy(p.a, p.b, p.q, p.r)
        except LabError:
            return -1.0
        if reference.trouble:
            return -1.0
        return float(
            np.abs(self.steady.value - reference.value).max()
            / (np.abs(reference.value).max() or 1.0)
        )

    @cached_property
    def constant_gain_count(self) -> int:
        """How many gains of the horizon, from t = 0 on, are the steady one within SETTLING_BAND."""
        return settling_step(self.relative_to_steady()[1]) + 1

    def relative_to_steady(self) -> tuple[np.ndarray, np.ndarray]:
        """Elements of P_t (N + 1, k) and K_t (N, k) as shares of their steady values, or of those
        at t = 0 where there is no steady state: P_ii, and of each column of K one, the rows taken
        in turn; at most six. An element whose steady value is zero is left out."""
        if self.optimal is None:
            return np.zeros((0, 0)), np.zeros((0, 0))
        gains, values = self.optimal.gains, self.optimal.values
        count = min(self.problem.n, 6)
        pick = np.arange(count)
        row = pick % self.problem.m
        p, k = values[:, pick, pick], gains[:, row, pick]
        p_end, k_end = p[0], k[0]
        if self.steady:
            p_end, k_end = self.steady.value[pick, pick], self.steady.gain[row, pick]
        p, k = p[:, p_end != 0.0], k[:, k_end != 0.0]
        return p / p_end[p_end != 0.0], k / k_end[k_end != 0.0]

    def results(self) -> dict[str, np.ndarray]:
        """A, B, Q, R and Q_f of the problem, the rest x_eq, u_eq it is about, and as far as there
        is a policy: its gains K (M, nu, nx), its values P (M, nx, nx), and the eigenvalues of one
        step without (`poles_open`) and with the first gain (`poles`)."""
        p, system = self.problem, self.system
        found = {"A": p.a, "B": p.b, "Q": p.q, "R": p.r, "Q_f": p.q_final}
        found |= {"x_eq": system.x_eq, "u_eq": system.u_eq}
        found["poles_open"] = np.linalg.eigvals(p.a).astype(complex)
        if self.trouble:
            return found
        poles = np.linalg.eigvals(p.a + p.b @ self.gains[0]).astype(complex)
        return found | {"K": self.gains, "P": self.values, "poles": poles}

    def cost(self, dx: np.ndarray, du: np.ndarray) -> float:
        """dx' Q dx + du' R du of one step."""
        return float(dx @ self.problem.q @ dx + du @ self.problem.r @ du)


def settling_step(shares: np.ndarray) -> int:
    """The last t up to which all shares (N, k) are within SETTLING_BAND of 1; -1 if none is."""
    off = np.abs(shares - 1.0).max(axis=1, initial=0.0) > SETTLING_BAND
    return int(np.argmax(off)) - 1 if off.any() else len(shares) - 1


def _weights(
    settings: RegulatorSettings, system: LinearSystem | OwnSystem
) -> tuple[np.ndarray, np.ndarray]:
    """Q and R."""
    if isinstance(system, OwnSystem):
        return system.q, system.r
    slide, turn, slide_rate, turn_rate = settings.weights
    places = [slide if i in system.prismatic else turn for i in range(system.nq)]
    rates = [slide_rate if i in system.prismatic else turn_rate for i in range(system.nq)]
    return np.diag([*places, *rates]), settings.r * np.eye(system.nu)


@lru_cache(maxsize=64)
def regulator(settings: RegulatorSettings) -> Regulator:
    """The regulator of these settings; the same object every time."""
    system = settings.linear_system
    a, b = system.linear(settings.period)
    q, r = _weights(settings, system)
    steady, trouble = None, ""
    try:
        steady = steady_state(a, b, q, r, most=MAX_RECURSIONS)
    except LabError as error:
        if settings.policy == "steady" or settings.final == "p":
            trouble = f"There is no steady state to regulate to: {error}."
    final = steady.value if settings.final == "p" and steady else q
    problem = LqrProblem(settings.horizon, a, b, q, r, settings.alpha * final)
    optimal = None
    try:
        optimal = solve(problem)
    except LabError as error:
        trouble = trouble or f"There is no policy over the horizon: {error}."
    return Regulator(settings, problem, optimal, steady, trouble)
