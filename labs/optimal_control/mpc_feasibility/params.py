"""The tunables of system, limits, problem and terminal set."""

from collections.abc import Mapping

from labs.optimal_control.mpc_feasibility.problem import FeasibilitySettings
from labs.params import Group, Params, Value
from labs.tasks.phase_plane.picture import WINDOW_SCALE

SYSTEM = Group("System", effect="restart")
START = Group("Start", effect="restart")
LIMITS = Group("Limits", effect="solve")
PROBLEM = Group("Problem", effect="solve")
INFEASIBLE = Group("When infeasible")
SCENE = Group("Scene")

PERIODS = {0.05: "50 ms", 0.1: "100 ms", 0.2: "200 ms"}
Units = Mapping[str, Mapping[Value, str]]
POSITION: Units = {"system": {"unstable": "× 0.5 rad", "joint": "× 1.2 rad"}}
VELOCITY: Units = {"system": {"unstable": "× 3 rad/s", "joint": "× 4 rad/s"}}
CONTROL: Units = {"system": {"unstable": "× 2 N·m", "joint": "× 4.9 N·m"}}


class MpcFeasibilityParams(Params):
    """What the user can turn. Positions, velocities and controls are in units natural to the
    system: 1 m, 1 m/s and 1 N of the cart."""

    system: str = SYSTEM.choice(
        "cart",
        {
            "cart": "Cart between walls",
            "unstable": "Pendulum, upright",
            "joint": "Joint under gravity",
        },
        "System",
        key=True,
    )
    """What is controlled: its linear model, which is exact for the cart."""
    period: float = SYSTEM.choice(0.1, PERIODS, "Period", "T", "s")
    """A control is held for so long, and a plan is made as often."""
    x1: float = START.knob(
        -0.8, -1.25, 1.25, "x_1", "m", "Start position", step=0.01, units=POSITION, key=True
    )
    """Where a run starts, from the middle: the ball in the plane, dragged."""
    x2: float = START.knob(
        0.0, -1.25, 1.25, "x_2", "m/s", "Start velocity", step=0.01, units=VELOCITY, key=True
    )
    """Its velocity there."""
    goal: float = START.knob(
        0.8, -1.0, 1.0, "x_1^{ref}", "m", "Goal", step=0.01, units=POSITION, effect="solve"
    )
    """Where it should come to rest, from the middle."""
    limited: str = LIMITS.choice(
        "both", {"both": "State and control", "control": "Control alone"}, "Limited", key=True
    )
    """Whether X limits position and velocity, or U alone the control."""
    p_max: float = LIMITS.knob(
        1.0, 0.2, 1.25, "p_{max}", "m", "Position limit", step=0.01, units=POSITION, key=True,
        when={"limited": "both"},
    )  # fmt: skip
    """X: the wall, to either side of the middle."""
    v_max: float = LIMITS.knob(
        1.0, 0.1, 1.25, "v_{max}", "m/s", "Speed limit", step=0.01, units=VELOCITY,
        when={"limited": "both"},
    )  # fmt: skip
    """X: the speed, either way."""
    u_max: float = LIMITS.knob(
        1.0, 0.1, 2.0, "u_{max}", "N", "Control limit", step=0.01, units=CONTROL, key=True
    )
    """U: the control, either way; of the joint tau_max."""
    horizon: float = PROBLEM.knob(5.0, 1.0, 40.0, "N", "", "Horizon", step=1.0, key=True)
    """Periods that a plan looks ahead."""
    terminal: str = PROBLEM.choice(
        "none",
        {
            "none": "None",
            "origin": "Rest at the goal",
            "still": "Zero velocity",
            "admissible": "Maximal output admissible",
            "invariant": "Maximal control invariant",
        },
        "Terminal set",
        r"\mathcal{X}_f",
        key=True,
        when={"limited": "both"},
    )
    """Where a plan must end."""
    terminal_cost: str = PROBLEM.choice(
        "stage", {"stage": "Q, as on the way", "riccati": "P, Riccati's"}, "Terminal cost", "l_f"
    )
    """The weight of where a plan ends."""
    block: str = PROBLEM.choice(
        "1",
        {"1": "None", "2": "2 periods", "4": "4 periods"},
        "Blocks",
        when={"fallback": ("tail", "brake")},
    )
    """Over how many periods a plan holds each control: fewer are to be decided."""
    q_v: float = PROBLEM.knob(0.1, 0.001, 10.0, "q_v", "", "Velocity's weight", scale="log")
    """Weight of the velocity, in its natural unit; that of the position is 1."""
    r: float = PROBLEM.knob(0.1, 0.001, 10.0, "r", "", "Control's weight", scale="log")
    """Weight of the control, in its natural unit."""
    fallback: str = INFEASIBLE.choice(
        "tail",
        {"tail": "Keep the old plan", "brake": "Brake", "soft": "Soften the limits"},
        "What acts",
        key=True,
    )
    """In a period without a plan: the rest of the last one; all that slows down; or a plan that
    exceeds X and the terminal set as little as it can."""

    shown: str = SCENE.choice(
        "feasible",
        {"feasible": "X_0 ... X_N", "admissible": "O_0 ... O_t"},
        "Sets",
    )
    """Which sets the plane shows: from where a plan exists, or those the solver finds."""

    @property
    def state_limits(self) -> bool:
        return self.limited == "both"

    @property
    def setup(self) -> FeasibilitySettings:
        reach = (self.p_max, self.v_max) if self.state_limits else (WINDOW_SCALE, WINDOW_SCALE)
        return FeasibilitySettings(
            system=self.system,
            T=self.period,
            N=round(self.horizon),
            limits=(*reach, self.u_max),
            state_limits=self.state_limits,
            goal=self.goal,
            weights=(self.q_v, self.r),
            terminal=self.terminal if self.state_limits else "none",
            riccati=self.terminal_cost == "riccati",
            block=int(self.block) if self.acts("block") else 1,
        )
