"""The tunables of the problem and of the four methods."""

from collections.abc import Mapping

import numpy as np

from labs.algorithms.hjb import StateGrid
from labs.optimal_control.families.cost import SwingCost
from labs.optimal_control.families.systems import BLOCK_ON_A_LINE, PENDULUM, UprightBody
from labs.params import Group, Params
from labs.problems.continuous_control import ContinuousProblem

SYSTEMS = {"pendulum": "Pendulum", "mass": "Mass on a line"}
BODIES: Mapping[str, UprightBody] = {"pendulum": PENDULUM, "mass": BLOCK_ON_A_LINE}
WINDOWS: Mapping[str, tuple[tuple[float, float], tuple[float, float]]] = {
    "pendulum": ((-1.5, -11.0), (5.0, 11.0)),
    "mass": ((-1.6, -4.0), (1.6, 4.0)),
}
"""Least and largest q and v of a grid."""
METRES: Mapping[str, Mapping[float | str | bool, str]] = {"system": {"mass": "m"}}
NEWTONS: Mapping[str, Mapping[float | str | bool, str]] = {"system": {"mass": "N"}}

SYSTEM = Group("System", effect="restart")
START = Group("Start", effect="solve")
COST = Group("Cost", effect="solve")
LIMITS = Group("Limits", effect="solve")
GRID = Group("Grids", effect="solve")
LOCAL = Group("Local methods", effect="solve")
SHOWN = Group("What is shown", effect="solve")


class FamiliesParams(Params):
    """What the user can turn."""

    system: str = SYSTEM.choice("pendulum", SYSTEMS, "System", key=True)
    """What is brought to q = 0: a pendulum, upright, or a mass, in the middle of its rail."""
    angle: float = START.knob(
        3.14, -1.0, 4.5, "q_0", "rad", "Angle", step=0.01, key=True, when={"system": "pendulum"}
    )
    """Where the pendulum starts, from upright; it hangs at pi. Or drag the ball on the surface."""
    place: float = START.knob(
        1.0, -1.5, 1.5, "q_0", "m", "Place", step=0.01, key=True, when={"system": "mass"}
    )
    """Where the mass starts. Or drag the ball on the surface."""
    velocity: float = START.knob(
        0.0, -4.0, 4.0, "v_0", "rad/s", "Velocity", step=0.01, units={"system": {"mass": "m/s"}}
    )
    """At the start."""
    horizon: float = START.knob(1.5, 0.5, 3.0, "T", "s", "Horizon", step=0.1, key=True)
    """How long the motion lasts; it is not free."""
    w_q: float = COST.knob(1.0, 0.0, 100.0, "w_q", "1/(rad²·s)", "Position", scale="log")
    """Weight of q² on the way."""
    w_v: float = COST.knob(0.05, 0.0, 10.0, "w_v", "s/rad²", "Velocity", scale="log")
    """Weight of v² on the way."""
    w_u: float = COST.knob(0.2, 0.01, 10.0, "w_u", "1/(N²·m²·s)", "Control", scale="log", key=True)
    """Weight of u². It is not zero: the control is the one minimiser of H."""
    w_f: float = COST.knob(10.0, 0.0, 1000.0, "w_f", "1/rad²", "Position at T", scale="log")
    """Weight of q² at the end."""
    w_vf: float = COST.knob(1.0, 0.0, 100.0, "w_{vf}", "s²/rad²", "Velocity at T", scale="log")
    """Weight of v² at the end."""
    u_max: float = LIMITS.knob(
        4.0, 1.0, 20.0, "u_{max}", "N·m", "Strongest control", scale="log", key=True, units=NEWTONS
    )
    """Most that |u| may be. To hold the pendulum level takes 4.9 N m."""
    limited: bool = LIMITS.toggle(False, "Limits on q")
    """Whether leaving the range below costs something."""
    q_min: float = LIMITS.knob(
        -0.5,
        -1.5,
        0.0,
        "q_{min}",
        "rad",
        "Least q",
        step=0.05,
        units=METRES,
        when={"limited": True},
    )
    """Lower end of the range."""
    q_max: float = LIMITS.knob(
        3.3,
        0.5,
        4.5,
        "q_{max}",
        "rad",
        "Largest q",
        step=0.05,
        units=METRES,
        when={"limited": True},
    )
    """Upper end of the range."""
    rho: float = LIMITS.knob(
        100.0, 1.0, 1e4, r"\rho", "1/(rad²·s)", "Price", scale="log", when={"limited": True}
    )
    """What being outside costs, by the square of how far: the limit is soft."""
    nodes: float = GRID.knob(121.0, 21.0, 201.0, "n", "", "Nodes", step=10.0, key=True)
    """Of each of the two grids along each axis, n² in all."""
    hjb_steps: float = GRID.knob(60.0, 5.0, 100.0, "N_{HJB}", "", "Steps of HJB", step=5.0)
    """In which the value function is integrated, from T to 0."""
    dp_steps: float = GRID.knob(15.0, 5.0, 60.0, "N_{DP}", "", "Steps of DP", step=5.0)
    """Decisions from 0 to T, for each of which u is held."""
    levels: float = GRID.knob(9.0, 3.0, 21.0, "n_u", "", "Controls of DP", step=2.0)
    """Levels of u to choose from."""
    start: str = LOCAL.choice(
        "warm", {"warm": "Warm: the present motion", "cold": "Cold: the first guess"}, "From"
    )
    """What Pontryagin's and the direct method start from."""
    guess: float = LOCAL.knob(
        0.5, -4.0, 4.0, "A", "rad", "First guess", step=0.1, key=True, units=METRES
    )
    """How far the first guess of the motion swings out on its way to q = 0."""
    pontryagin: str = LOCAL.choice(
        "collocation", {"collocation": "Collocation", "shooting": "Shooting on p(0)"}, "Pontryagin"
    )
    """How the boundary value problem is solved."""
    intervals: float = LOCAL.knob(
        60.0, 10.0, 150.0, "N", "", "Steps of the direct method", step=5.0
    )
    """In which its motion is cut."""
    surface: str = SHOWN.choice(
        "hjb", {"hjb": "Hamilton-Jacobi-Bellman's", "dp": "Dynamic programming's"}, "Value function"
    )
    """Whose V is the surface."""
    moment: float = SHOWN.knob(0.0, 0.0, 0.9, "M", "T", "Moment", step=0.05, key=True)
    """From which the surface is, and from which the optimal motion is solved for once more."""
    study: str = SHOWN.choice(
        "none", {"none": "None", "grid": "Over the nodes", "guess": "Over the first guess"}, "Study"
    )
    """What is solved besides: other grids, or other first guesses."""

    @property
    def body(self) -> UprightBody:
        return BODIES[self.system]

    @property
    def x0(self) -> np.ndarray:
        return np.array([self.angle if self.system == "pendulum" else self.place, self.velocity])

    @property
    def cost(self) -> SwingCost:
        weights = (self.w_q, self.w_v, self.w_u, self.w_f, self.w_vf)
        return SwingCost(*weights, *((self.q_min, self.q_max, self.rho) if self.limited else ()))

    def problem(self, x0: np.ndarray, T: float) -> ContinuousProblem:
        """From x0 (2,), for T [s]."""
        bound, none = np.array([self.u_max]), np.full(2, np.inf)
        return ContinuousProblem(self.body, self.cost, x0, T, -none, none, -bound, bound)

    def grid(self, nodes: int) -> StateGrid:
        """With so many nodes along each axis."""
        return StateGrid(*WINDOWS[self.system], (nodes, nodes))
