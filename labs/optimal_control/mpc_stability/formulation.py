"""The problem that is solved at every period, put together from the choices of the page: costs,
limits, and the terminal ingredients of the notes (2.5.3).

To follow a reference, all is said of the error e = x - x_r(k): its dynamics are those of x, and
X and U move by -x_r(k) and -u_r(k), a regulation that varies with time. Its terminal set keeps to
what is left of X and U at all times, and moves with the reference.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from labs.algorithms.admissible_set import closed_loop_limits, maximal_output_admissible_set
from labs.algorithms.invariant_sets import feasible_sets
from labs.algorithms.linear_mpc import LinearPlanner
from labs.algorithms.polygons import clip, vertices
from labs.algorithms.riccati import steady_state_by_scipy
from labs.algorithms.terminal_cost import cost_of_gain
from labs.errors import LabError
from labs.optimal_control.mpc_stability.reference import Reference
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import Polyhedron, box
from labs.tasks.phase_plane.systems import SIMULATION_STEP, PlaneSystem, plane_system

SYSTEMS = {"cart": "Cart", "unstable": "Pendulum, upright"}
PERIODS = {0.05: "50 ms", 0.1: "100 ms", 0.2: "200 ms"}
STABILITY_TASKS = {
    "regulate": "Stay at the origin",
    "track": "Follow a motion",
    "economic": "Economic cost",
}
TERMINAL_COSTS = {"none": "None", "q": "α Q", "p": "P of u = K x"}
TERMINAL_SETS = {"none": "None", "origin": "The origin", "invariant": "Maximal invariant set"}
WINDOW = 1.1
"""Of the natural limits: what is looked at."""


@dataclass(frozen=True)
class FormulationSettings:
    """What fixes a formulation: see the parameters of these names."""

    system: str
    period: float
    task: str
    weights: tuple[float, float]
    r: float
    N: int
    terminal_cost: str
    alpha: float
    rho: float
    terminal_set: str
    u_max: float
    limited: bool
    amplitude: float
    frequency: float
    price: float


@dataclass(frozen=True, eq=False)
class Formulation:
    """The problem with all it is made of."""

    settings: FormulationSettings
    problem: LinearMpcProblem
    K: np.ndarray
    """(1, 2) the terminal control law u = K x."""
    reference: Reference
    trouble: str = ""
    """Why there is no such problem; the one at hand is without a terminal set then."""

    @property
    def system(self) -> PlaneSystem:
        return plane_system(self.settings.system)

    @cached_property
    def planner(self) -> LinearPlanner:
        return LinearPlanner(self.problem)

    def planner_at(self, k: int) -> LinearPlanner:
        """That of the errors at period k."""
        if self.settings.task != "track":
            return self.planner
        ahead = k + np.arange(self.problem.N)
        return self.planner.with_terms(
            state_margins=self.reference.states(ahead) @ self.problem.state_set.H.T,
            control_margins=self.reference.controls(ahead) @ self.problem.control_set.H.T,
        )

    @cached_property
    def step(self) -> tuple[np.ndarray, np.ndarray]:
        """A (2, 2) and B (2, 1) over SIMULATION_STEP."""
        A, B, _ = self.system.linear(SIMULATION_STEP)
        return A, B

    def stage_cost(self, e: np.ndarray, u: np.ndarray) -> np.ndarray:
        """l (...) of errors (..., 2) and controls (..., 1) beyond the reference's."""
        p = self.problem
        squares = ((e @ p.Q) * e).sum(axis=-1) + ((u @ p.R) * u).sum(axis=-1)
        return np.asarray(0.5 * squares + (0.0 if p.r is None else u @ p.r))

    @cached_property
    def window(self) -> Polyhedron:
        """What is looked at."""
        reach = WINDOW * np.array(self.system.x_max)
        return box(-reach, reach)

    @cached_property
    def terminal_polygon(self) -> np.ndarray:
        """(k, 2) the corners of X_f within the window; (0, 2) where there is no X_f."""
        end = self.problem.terminal_set
        return np.zeros((0, 2)) if end is None else _intersect_window(self.window, end)

    @cached_property
    def feasible_polygon(self) -> np.ndarray:
        """(k, 2) those of X_0 within the window, of the problem without a reference."""
        p = self.problem
        if p.terminal_set is None and not len(p.state_set.h):
            return _intersect_window(self.window, p.state_set)
        return _intersect_window(self.window, feasible_sets(p)[0])


@lru_cache(maxsize=64)
def formulate(settings: FormulationSettings) -> Formulation:
    """What cannot be put together says why and stands without a terminal set."""
    system = plane_system(settings.system)
    A, B, _ = system.linear(settings.period)
    Q, R = np.diag(settings.weights), np.array([[settings.r]])
    K = steady_state_by_scipy(A, B, Q, settings.rho * R).gain
    P = cost_of_gain(A, B, Q, R, K)
    costs = {"none": np.zeros((2, 2)), "q": settings.alpha * Q, "p": P}
    reach = np.array(system.x_max) if settings.limited else np.full(2, np.inf)
    tracks, saves = settings.task == "track", settings.task == "economic"
    amplitude = settings.amplitude if tracks else 0.0
    reference = Reference.of(A, B, amplitude, settings.frequency, settings.period)
    problem = LinearMpcProblem(
        N=settings.N,
        A=A,
        B=B,
        Q=Q,
        R=R,
        Q_f=costs[settings.terminal_cost],
        state_set=box(-reach, reach),
        control_set=box([-settings.u_max], [settings.u_max]),
        r=np.array([settings.price]) if saves else None,
    )
    left_x, left_u = reach - np.abs(reference.x), settings.u_max - abs(reference.u)
    trouble = ""
    if left_u <= 0.0 or (left_x <= 0.0).any():
        trouble = (
            f"The motion takes u up to {abs(reference.u):.3g} {system.control_unit} and v up to "
            f"{abs(reference.x[1]):.3g} {system.units[1]}: beyond the limits. Let it be smaller or "
            "slower."
        )
    elif settings.terminal_set == "origin":
        problem = replace(problem, terminal_set=box(np.zeros(2), np.zeros(2)))
    elif settings.terminal_set == "invariant":
        limits = closed_loop_limits(K, box(-left_x, left_x), box([-left_u], [left_u]))
        try:
            found = maximal_output_admissible_set(A + B @ K, limits)
            trouble = "" if found.found else f"No maximal invariant set: {found.done}."
            problem = replace(problem, terminal_set=found.set) if found.found else problem
        except LabError as error:
            trouble = f"No maximal invariant set: {error}."
    return Formulation(settings, problem, K, reference, trouble)


def _intersect_window(window: Polyhedron, given: Polyhedron) -> np.ndarray:
    return clip(vertices(window), given)
