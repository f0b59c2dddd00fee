"""What the user turns in dynamic programming: the world, the iterations, the horizon."""

from labs.params import Group, Params
from labs.reinforcement_learning.dynamic_programming.iteration_comparison import (
    ITERATION_METHODS,
    IterationSettings,
)
from labs.reinforcement_learning.dynamic_programming.tasks import (
    HORIZON,
    grid_key,
    pendulum_key,
    table_key,
)
from labs.tasks.grid_world.params import MAP_LENGTH, MapText
from labs.tasks.mdp_table.params import TABLE_LENGTH, TAXICAB, TableText

POCKET = """\
.............
...#####.....
.......#.....
S......#..G..
.......#.....
...#####.....
............."""
BRUSHES = {
    "#": "Wall, or none",
    "G": "Goal",
    "H": "Hole, or none",
    "S": "Start",
    "C": "Cliff, or none",
    ".": "Free",
}
WORLDS = {"grid": "Grid world", "pendulum": "Pendulum", "table": "Your table"}

WORLD = Group("World", effect="restart")
GRID_WORLD = Group("Grid world", effect="solve", when={"world": "grid"})
PENDULUM = Group("Pendulum", effect="solve", when={"world": "pendulum"})
TABLE = Group("Table", effect="solve", when={"world": "table"})
ITERATIONS = Group("Iterations", effect="solve")
FINITE_HORIZON = Group("Finite horizon")
TABLE_SIZE = Group("Curse of dimensionality")


class DynamicProgrammingParams(Params):
    """What the user can turn."""

    world: str = WORLD.choice("grid", WORLDS, "World", key=True)
    """A map to walk on, a pendulum whose motor is too weak to lift it at once, or a table of your
    own."""
    gamma: float = WORLD.knob(
        0.95, 0.0, 1.0, r"\gamma", "", "Discount", step=0.005, effect="solve", key=True
    )
    """Weight of the next step's cost. Every sweep brings the error down by it, at least."""
    map: MapText = GRID_WORLD.text(POCKET, "Map", rows=8, max_length=MAP_LENGTH)
    """# wall, . free, S start, G goal, H hole (an end for 100), C cliff, + and - ends that gain and
    cost 1; a last row of digits is wind, upwards; below, costs of letters: m = cost 3, or
    T = reward 5, end. Or click on the cells."""
    brush: str = GRID_WORLD.choice("#", BRUSHES, "A click makes", effect="live", key=True)
    """What a clicked cell becomes."""
    slip: float = GRID_WORLD.knob(0.0, 0.0, 0.8, "p", "", "Slip", step=0.01, key=True)
    """Probability that a step goes elsewhere: in a direction drawn evenly, or sideways."""
    sideways: bool = GRID_WORLD.toggle(False, "Slip to the sides only")
    """Half of it to either side of the direction wanted, as in the worlds of many books."""
    living: float = GRID_WORLD.knob(1.0, -0.1, 5.0, "l_{step}", "", "Cost of living", step=0.01)
    """What any step costs, beside what the cell costs that it leads to."""
    kings: bool = GRID_WORLD.toggle(False, "Diagonal steps")
    """Eight controls, the king's moves, instead of four."""
    table: TableText = TABLE.text(TAXICAB, "Your table", rows=8, max_length=TABLE_LENGTH, key=True)
    """CSV or JSON, pasted or a file: from, action, to, probability, cost or reward, a row for each
    transition; or state, action, cost, then a column for each state. Start: the first state; what
    has no row is an end."""
    nodes: float = PENDULUM.knob(51, 11, 101, "n", "", "Grid size", step=2, key=True)
    """Angles, and as many velocities: the table has n² rows."""
    levels: float = PENDULUM.knob(5, 3, 11, "n_u", "", "Torque levels", step=2)
    """Columns of the table."""
    torque: float = PENDULUM.knob(
        2.5, 0.5, 6.0, r"u_{\max}", "N·m", "Torque limit", step=0.05, key=True
    )
    """To hold the rod level takes 4.9 N·m: with less it has to be swung up."""
    w_v: float = PENDULUM.knob(0.05, 0.0, 1.0, "w_v", "s²/rad²", "Cost of velocity", scale="log")
    """Beside 1 for the square of the angle from upright [rad]."""
    w_u: float = PENDULUM.knob(0.05, 0.0, 1.0, "w_u", "1/(N·m)²", "Cost of torque", scale="log")
    """Beside 1 for the square of the angle from upright [rad]."""
    shown: str = ITERATIONS.choice(
        "value",
        ITERATION_METHODS | {"finite": "Finite horizon"},
        "Shown and followed",
        effect="live",
        key=True,
    )
    """Whose values and policy the scene shows, and who drives the walker or the pendulum."""
    m: float = ITERATIONS.knob(5, 1, 50, "m_k", "", "Evaluations", step=1)
    """Of each policy in modified policy iteration; 1 is value iteration."""
    tolerance: float = ITERATIONS.knob(
        1e-6, 1e-9, 0.1, r"\varepsilon", "", "Tolerance", scale="log"
    )
    """An iteration ends when a sweep changes no value by more."""
    spread: float = ITERATIONS.knob(0.0, 0.0, 50.0, "V_0", "", "Initial values", step=0.5)
    """Drawn from 0 to this, by the seed, the same for all."""
    warm: bool = ITERATIONS.toggle(True, "Go on from present values")
    """When the world changes; off: from the initial values again."""
    to_go: float = FINITE_HORIZON.knob(
        12, 0, HORIZON, "N-i", "steps", "Time to go", step=1, key=True
    )
    """How many steps are left."""
    w_f: float = FINITE_HORIZON.knob(
        3.0, 0.0, 10.0, "w_f", "", "Final cost", step=0.1, when={"world": ["grid", "pendulum"]}
    )
    """Of each cell (each radian) left to the goal in a straight line."""
    joints: float = TABLE_SIZE.knob(6, 1, 7, "j", "", "Joints", step=1)
    """Of a robot whose table one would like to have."""
    cuts: float = TABLE_SIZE.knob(10, 2, 100, "c", "", "Values of each", step=1)
    """Into how many values each angle and each velocity is cut."""

    @property
    def task(self) -> str:
        """The key of the task."""
        if self.world == "grid":
            slip = (self.slip, self.sideways)
            return grid_key(self.map, self.kings, *slip, self.living, self.gamma)
        if self.world == "table":
            return table_key(self.table, self.gamma)
        nodes, levels = (int(n) // 2 * 2 + 1 for n in (self.nodes, self.levels))
        return pendulum_key(nodes, levels, self.torque, self.w_v, self.w_u, self.gamma)

    @property
    def settings(self) -> IterationSettings:
        """Of the iterations."""
        return IterationSettings(int(self.m), self.tolerance)

    @property
    def row(self) -> int:
        """Of the method shown; of value iteration where the horizon is finite."""
        names = list(ITERATION_METHODS)
        return names.index(self.shown) if self.shown in names else 3
