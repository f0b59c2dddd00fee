"""What the user turns in dynamic programming: the world, the iterations, the horizon."""

from pydantic import field_validator

from labs.errors import LabError
from labs.params import Params, choice, knob, text, toggle
from labs.reinforcement_learning.dynamic_programming.problems import HORIZON, grid_key, pendulum_key
from labs.reinforcement_learning.dynamic_programming.side_by_side import METHODS, Rules
from labs.tasks.grid_world.map import GridWorld

NAMES = tuple(METHODS)
POCKET = """\
.............
...#####.....
.......#.....
S......#..G..
.......#.....
...#####.....
............."""
BRUSHES = {"#": "Wall, or none", "G": "Goal", "S": "Start", "C": "Cliff", ".": "Free"}


class DynamicProgrammingParams(Params):
    """What the user can turn."""

    world: str = choice(
        "grid",
        {"grid": "Grid world", "pendulum": "Pendulum"},
        label="World",
        group="World",
        effect="restart",
        help="A map to walk on, or a pendulum whose motor is too weak to lift it at once.",
    )
    gamma: float = knob(
        0.95,
        0.0,
        1.0,
        symbol=r"\gamma",
        unit="",
        label="Discount",
        group="World",
        step=0.005,
        effect="solve",
        help="Weight of the next step's cost. Every sweep brings the error down by it, at least.",
    )
    map: str = text(
        POCKET,
        label="Map",
        group="Grid world",
        rows=8,
        effect="solve",
        help="# wall, . free, S start, G goal, C cliff; a last row of digits is the wind upwards. "
        "Or click on the cells.",
    )
    brush: str = choice(
        "#", BRUSHES, label="A click makes", group="Grid world", help="What a clicked cell becomes."
    )
    slip: float = knob(
        0.0,
        0.0,
        0.8,
        symbol="p",
        unit="",
        label="Slip",
        group="Grid world",
        step=0.01,
        effect="solve",
        help="Probability that a step goes in a direction drawn evenly instead.",
    )
    kings: bool = toggle(
        False,
        label="Diagonal steps",
        group="Grid world",
        effect="solve",
        help="Eight controls, the king's moves, instead of four.",
    )
    nodes: float = knob(
        51,
        11,
        101,
        symbol="n",
        unit="",
        label="Grid size",
        group="Pendulum",
        step=2,
        effect="solve",
        help="Angles, and as many velocities: the table has n² rows.",
    )
    levels: float = knob(
        5,
        3,
        11,
        symbol="n_u",
        unit="",
        label="Torque levels",
        group="Pendulum",
        step=2,
        effect="solve",
        help="Columns of the table.",
    )
    torque: float = knob(
        2.5,
        0.5,
        6.0,
        symbol=r"u_{\max}",
        unit="N·m",
        label="Torque limit",
        group="Pendulum",
        step=0.05,
        effect="solve",
        help="To hold the rod level takes 4.9 N·m: with less it has to be swung up.",
    )
    w_v: float = knob(
        0.05,
        0.0,
        1.0,
        symbol="w_v",
        unit="s²/rad²",
        label="Cost of velocity",
        group="Pendulum",
        scale="log",
        effect="solve",
        help="Beside 1 for the square of the angle from upright [rad].",
    )
    w_u: float = knob(
        0.05,
        0.0,
        1.0,
        symbol="w_u",
        unit="1/(N·m)²",
        label="Cost of torque",
        group="Pendulum",
        scale="log",
        effect="solve",
        help="Beside 1 for the square of the angle from upright [rad].",
    )
    shown: str = choice(
        "value",
        METHODS | {"finite": "Finite horizon"},
        label="Shown and followed",
        group="Iterations",
        help="Whose values and policy the scene shows, and who drives the walker or the pendulum.",
    )
    m: float = knob(
        5,
        1,
        50,
        symbol="m_k",
        unit="",
        label="Evaluations",
        group="Iterations",
        step=1,
        effect="solve",
        help="Of each policy in modified policy iteration; 1 is value iteration.",
    )
    tolerance: float = knob(
        1e-6,
        1e-9,
        0.1,
        symbol=r"\varepsilon",
        unit="",
        label="Tolerance",
        group="Iterations",
        scale="log",
        effect="solve",
        help="An iteration ends when a sweep changes no value by more.",
    )
    spread: float = knob(
        0.0,
        0.0,
        50.0,
        symbol="V_0",
        unit="",
        label="Initial values",
        group="Iterations",
        step=0.5,
        effect="solve",
        help="Drawn from 0 to this, by the seed, the same for all.",
    )
    warm: bool = toggle(
        True,
        label="Go on from present values",
        group="Iterations",
        effect="solve",
        help="When the world changes; off: from the initial values again.",
    )
    to_go: float = knob(
        12,
        0,
        HORIZON,
        symbol="N-i",
        unit="steps",
        label="Time to go",
        group="Finite horizon",
        step=1,
        help="How many steps are left.",
    )
    w_f: float = knob(
        3.0,
        0.0,
        10.0,
        symbol="w_f",
        unit="",
        label="Final cost",
        group="Finite horizon",
        step=0.1,
        help="Of each cell (each radian) left to the goal in a straight line.",
    )
    joints: float = knob(
        6,
        1,
        7,
        symbol="j",
        unit="",
        label="Joints",
        group="Curse of dimensionality",
        step=1,
        help="Of a robot whose table one would like to have.",
    )
    cuts: float = knob(
        10,
        2,
        100,
        symbol="c",
        unit="",
        label="Values of each",
        group="Curse of dimensionality",
        step=1,
        help="Into how many values each angle and each velocity is cut.",
    )

    @field_validator("map")
    @classmethod
    def _is_a_map(cls, value: str) -> str:
        try:
            GridWorld.parse(value)
        except LabError as error:
            raise ValueError(str(error)) from None
        return value

    @property
    def key(self) -> str:
        """The problem's."""
        if self.world == "grid":
            return grid_key(self.map, self.kings, self.slip, self.gamma)
        nodes, levels = (int(n) // 2 * 2 + 1 for n in (self.nodes, self.levels))
        return pendulum_key(nodes, levels, self.torque, self.w_v, self.w_u, self.gamma)

    @property
    def rules(self) -> Rules:
        return Rules(int(self.m), self.tolerance)

    @property
    def row(self) -> int:
        """Of the method shown; of value iteration where the horizon is finite."""
        return NAMES.index(self.shown) if self.shown in NAMES else 3
