"""The problem of a setting: a system of the plane about its rest, its limits, costs and sets.

States and controls here are deviations z = x - x_eq and w = u - u_eq, so that z+ = A z + B w.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from labs.algorithms.admissible_set import closed_loop_limits, maximal_output_admissible_set
from labs.algorithms.invariant_sets import maximal_control_invariant_set
from labs.algorithms.riccati import steady_state
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import Polyhedron, box
from labs.tasks.phase_plane.systems import GRAVITY_TORQUE, PlaneSystem, plane_system

EMPTY_SET = box([1.0, 1.0], [-1.0, -1.0])
JOINT_REST = 0.6
"""[rad] from hanging: where the joint is linearised, so that gravity differs along its way."""


@dataclass(frozen=True)
class FeasibilitySettings:
    """All numbers that sets and plans depend on; limits and goal in natural units."""

    system: str
    T: float
    N: int
    limits: tuple[float, float, float]
    state_limits: bool
    goal: float
    weights: tuple[float, float]
    terminal: str
    riccati: bool
    block: int = 1
    """Periods over which a planned control is held."""

    @property
    def holds(self) -> tuple[int, ...]:
        """Over how many periods each of a plan's controls is held; the last may be shorter."""
        whole, rest = divmod(self.N, self.block)
        return (self.block,) * whole + (rest,) * (rest > 0)


@dataclass(frozen=True, eq=False)
class Feasibility:
    """What a setup means in numbers."""

    system: PlaneSystem
    problem: LinearMpcProblem
    goal: np.ndarray
    """(2,) z of the rest aimed at."""
    K: np.ndarray
    """(1, 2) of the unlimited regulator."""
    box: Polyhedron
    """X, also where it limits nothing."""
    regulated_limits: Polyhedron | None
    """Of z - goal under w - w_goal = K (z - goal), scaled: H z <= 1; None where the goal is no
    rest within the limits."""
    trouble: str = ""
    """What keeps the terminal set from existing, in a sentence."""

    @property
    def closed_loop_matrix(self) -> np.ndarray:
        return np.asarray(self.problem.A + self.problem.B @ self.K)


@lru_cache(maxsize=8)
def feasibility_system(name: str) -> PlaneSystem:
    """The system of this name; the joint rests at JOINT_REST, its natural torque holds it level."""
    system = plane_system(name)
    return (
        system if name != "joint" else replace(system.resting_at(JOINT_REST), u_max=GRAVITY_TORQUE)
    )


@lru_cache(maxsize=32)
def feasibility(setup: FeasibilitySettings) -> Feasibility:
    """The problem with its terminal set."""
    system = feasibility_system(setup.system)
    A, B, _ = system.linear(setup.T)
    x_max = np.array(system.x_max)
    reach, u_max = x_max * setup.limits[:2], system.u_max * setup.limits[2]
    X, U = box(-reach, reach), box([-u_max - system.u_eq], [u_max - system.u_eq])
    Q = np.diag([1.0, setup.weights[0]] / x_max**2)
    R = np.array([[setup.weights[1] / system.u_max**2]])
    steady = steady_state(A, B, Q, R)
    goal = np.array([setup.goal * x_max[0], 0.0])
    w_goal = np.linalg.lstsq(B, goal - A @ goal, rcond=None)[0]
    about = closed_loop_limits(steady.gain, _translate(X, goal), _translate(U, w_goal))
    room = bool((about.h > 1e-9).all())
    scaled = Polyhedron(about.H / about.h[:, None], np.ones(len(about.h))) if room else about
    terminal, trouble = None, ""
    if setup.terminal == "origin":
        terminal = box(goal, goal)
    elif setup.terminal == "still":
        terminal = box([-reach[0], 0.0], [reach[0], 0.0])
    elif setup.terminal == "admissible" and not room:
        terminal, trouble = (
            EMPTY_SET,
            "There is no admissible set: the goal is no rest within U and X",
        )
    elif setup.terminal == "admissible":
        found = maximal_output_admissible_set(A + B @ steady.gain, scaled)
        terminal = _translate(found.set, -goal)
    elif setup.terminal == "invariant":
        largest = maximal_control_invariant_set(A, B, X, U)
        terminal = largest.set
        if not largest.found:
            terminal, trouble = EMPTY_SET, f"No control invariant set: {largest.done}"
    problem = LinearMpcProblem(
        N=setup.N,
        A=A,
        B=B,
        Q=Q,
        R=R,
        Q_f=steady.value if setup.riccati else Q,
        state_set=X if setup.state_limits else Polyhedron(np.zeros((0, 2)), np.zeros(0)),
        control_set=U,
        terminal_set=terminal,
        x_ref=goal,
        u_ref=w_goal,
    )
    return Feasibility(system, problem, goal, steady.gain, X, scaled if room else None, trouble)


def _translate(polyhedron: Polyhedron, by: np.ndarray) -> Polyhedron:
    """{z : z + by in the polyhedron}"""
    return Polyhedron(polyhedron.H, polyhedron.h - polyhedron.H @ by)
