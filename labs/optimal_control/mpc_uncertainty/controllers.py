"""Nominal, stochastic and robust MPC of the cart: what each plans with."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.special import ndtri

from labs.algorithms.chance_mpc import (
    Noise,
    back_off,
    error_covariances,
    nominal_from_measured_state,
    nominal_from_predicted_state,
    stationary_covariance,
)
from labs.algorithms.invariant_sets import feasible_sets
from labs.algorithms.linear_mpc import LinearPlanner
from labs.algorithms.polygons import minkowski_sum, vertices
from labs.algorithms.riccati import steady_state
from labs.algorithms.robust_invariant_set import robust_invariant_set
from labs.algorithms.tube_mpc import TubePlanner, tighten_problem
from labs.optimal_control.mpc_uncertainty.params import UncertaintyParams
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import Polyhedron, box
from labs.tasks.phase_plane.systems import plane_system

CONTROL_PERIOD = 0.2
"""[s] a period."""
GAIN_WEIGHTS = np.diag([10.0, 1.0])
"""[1/m^2, s^2/m^2] of the errors' position and velocity, for the gain K."""
TUBE_ERROR = 0.05
"""Of the tube, as a share of the disturbance."""
LEFT_END = -1.5
"""[m] where the rail begins: the limit nobody comes near."""
CONTROLLER_NAMES = ("nominal", "stochastic", "robust")
NOMINAL, STOCHASTIC, ROBUST = range(3)
FIELDS_OUTSIDE_DESIGN = {"shown": "all", "zoom": False, "count": 20.0, "seed": 0.0}
"""What controllers do not depend on."""
WALL_ROW = 0
"""The row of X that is the wall."""


@dataclass(frozen=True, eq=False)
class Controllers:
    """The three problems, each with its limits as it sees them, and what goes with them."""

    problems: tuple[LinearMpcProblem, ...]
    """(3,) of the nominal state."""
    K: np.ndarray
    """(1, 2)"""
    final_position_limits: np.ndarray
    """(3,) [m] how far the last planned state may be."""
    tube: np.ndarray
    """(k, 2) corners of the tube's cross-section S."""
    ellipses: np.ndarray
    """(N + 1, 2, 2) images of the unit disc: q(p) deviations of the error that stochastic MPC
    counts on. They reach just as far as its margins."""
    planners: tuple[LinearPlanner, LinearPlanner]
    """Of nominal and stochastic MPC."""
    tube_planner: TubePlanner

    def margins(self) -> np.ndarray:
        """(3, N + 1) [m] how far before the wall each must plan to stay."""
        wall = self.problems[NOMINAL].state_set.h[WALL_ROW]
        margins = wall - np.tile(
            self.final_position_limits[:, None], (1, self.problems[NOMINAL].N + 1)
        )
        for row, problem in zip(margins, self.problems, strict=True):
            if problem.state_margins is not None:
                row[:-1] = problem.state_margins[:, WALL_ROW]
        return np.asarray(margins)

    @cached_property
    def feasible(self) -> list[np.ndarray]:
        """The states from which each finds a plan, (k, 2), k = 0 where there are none."""
        sets = [vertices(feasible_sets(problem)[0]) for problem in self.problems]
        if len(sets[ROBUST]):
            sets[ROBUST] = minkowski_sum(sets[ROBUST], self.tube)
        return sets


def controllers(params: UncertaintyParams) -> Controllers:
    """Of these parameters; all have the same cost, and end at rest within their limits."""
    return _controllers(params.model_copy(update=FIELDS_OUTSIDE_DESIGN))


@lru_cache(maxsize=4)
def _controllers(params: UncertaintyParams) -> Controllers:
    A, B, _ = plane_system("cart").linear(CONTROL_PERIOD)
    Q, R = np.diag([params.q_p, params.q_v]), np.array([[params.r]])
    cost = steady_state(A, B, Q, R)
    K = steady_state(A, B, GAIN_WEIGHTS, np.array([[params.r_K]])).gain
    X = box([LEFT_END, -params.v_max], [params.wall, params.v_max])
    problem = LinearMpcProblem(
        round(params.N), A, B, Q, R, cost.value, X, box([-params.u_max], [params.u_max]),
        x_ref=np.array([params.target, 0.0]),
    )  # fmt: skip
    noise = Noise(np.diag(params.deviation**2), K)
    p = params.probability / 100.0
    W = box(-params.w_max, params.w_max)
    S = robust_invariant_set(A + B @ K, W, TUBE_ERROR * float(params.w_max.min()))
    stationary = stationary_covariance(problem, noise)
    if params.source == "predicted":
        cautious = nominal_from_predicted_state(problem, noise, p)
        Sigma = np.tile(stationary, (problem.N + 1, 1, 1))
        end = cautious.state_set
    else:
        cautious = nominal_from_measured_state(problem, noise, p)
        Sigma = error_covariances(problem, noise)
        end = Polyhedron(X.H, X.h - back_off(X, Sigma[-1], p))
    tight = tighten_problem(problem, S, K)
    ends = (X, end, tight.state_set)
    problems = [
        _require_final_rest(*pair) for pair in zip((problem, cautious, tight), ends, strict=True)
    ]
    return Controllers(
        problems=tuple(problems),
        K=K,
        final_position_limits=np.array([limits.h[WALL_ROW] for limits in ends]),
        tube=S.polygon(),
        ellipses=_matrix_square_roots(Sigma) * ndtri(p),
        planners=(LinearPlanner(problems[NOMINAL]), LinearPlanner(problems[STOCHASTIC])),
        tube_planner=TubePlanner(problems[ROBUST], S.polyhedron(), K),
    )


def _matrix_square_roots(Sigma: np.ndarray) -> np.ndarray:
    """L with L L' = Sigma, of semidefinite (..., n, n)."""
    values, vectors = np.linalg.eigh(Sigma)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])


def _require_final_rest(problem: LinearMpcProblem, end: Polyhedron) -> LinearMpcProblem:
    """With the last state at rest at a position of the set `end`, a box as X is: there it can stay
    for ever."""
    highest, _, lowest, _ = end.h
    return replace(problem, terminal_set=box([-lowest, 0.0], [highest, 0.0]))
