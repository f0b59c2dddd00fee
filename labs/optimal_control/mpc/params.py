"""The tunables of model predictive control of a robot."""

import numpy as np

from labs.algorithms.mpc import MpcOptions
from labs.optimal_control.mpc.systems import SYSTEM_TITLES, ControlledSystem, controlled_system
from labs.params import Group, Params
from labs.tasks.motion.tip_constraints import Ball

PERIODS = {0.01: "10 ms", 0.02: "20 ms", 0.04: "40 ms"}
ITERATIONS = {
    "1": "1: real-time iteration",
    "2": "2",
    "5": "5",
    "all": "To convergence",
}
MODES = {
    "both": "Plan and act",
    "plan": "Plan only: the robot waits",
    "act": "Act only: on the last plan",
}

ARMS = ("ur5", "double-pendulum")

CIRCLE_RADIUS = 0.12
"""[m] radius of the circle that a moving target goes round."""

TASK = Group("Robot", effect="restart")
HORIZON = Group("Horizon")
LIMITS = Group("Limits")
COST = Group("Weights")
COMPUTING = Group("Computing")
OF_UR5 = Group("Target", when={"system": "ur5"})
OF_CART = Group("Target", when={"system": "cart-pole"})
OF_RODS = Group("Target", when={"system": "double-pendulum"})
OBSTACLE = Group("Obstacle", when={"system": "ur5", "obstacle": True})
WORLD = Group("World")


class MpcParams(Params):
    """What the user can turn."""

    system: str = TASK.choice("ur5", SYSTEM_TITLES, "Robot", key=True)
    """What is controlled. The pendulums hang at first; to swing up the cart's pole plans must look
    0.6 s ahead: take a period of 20 ms."""
    mode: str = TASK.choice("both", MODES, "Controller", effect="live", key=True)
    """Planning and acting, each alone or both at every period."""

    steps: float = HORIZON.knob(30.0, 2.0, 60.0, "N", "", "Steps", step=1.0, key=True)
    """How many periods a plan looks ahead."""
    h: float = HORIZON.choice(0.01, PERIODS, "Period", "h", "s", effect="restart", key=True)
    """Between two plans, and the length of a plan's steps."""
    horizon: str = HORIZON.choice(
        "receding",
        {"receding": "Recedes", "shrinking": "Shrinks, then begins anew"},
        "Its end",
        effect="restart",
    )
    """Whether the end of the horizon moves on with time, or stays where it is for N periods."""
    end: str = HORIZON.choice("free", {"free": "Free", "rest": "At rest: v = 0"}, "Terminal set")
    """What the last predicted state must be."""

    q_limit: float = LIMITS.knob(
        2.5, 0.05, 3.0, "q_{max}", "rad", "Position", step=0.05, when={"system": ARMS}
    )
    """How far a joint may turn from where it starts; of the double pendulum, its elbow."""
    rail: float = LIMITS.knob(
        1.4, 0.1, 1.5, "p_{max}", "m", "Rail", step=0.05, when={"system": "cart-pole"}
    )
    """How far the cart may go from the middle."""
    v_limit: float = LIMITS.knob(
        1.5,
        0.2,
        12.0,
        "v_{max}",
        "rad/s",
        "Velocity",
        scale="log",
        key=True,
        units={"system": {"cart-pole": "m/s"}},
    )
    """How fast a joint, or the cart, may be."""
    u_limit: float = LIMITS.knob(1.0, 0.3, 2.0, "u_{max}", "u₀", "Control", step=0.05, key=True)
    """What each motor may give, in units of its own size."""
    soft: bool = LIMITS.toggle(False, "Soft limits of q, v and tip")
    """They may be exceeded, at a price, instead of never."""
    penalty: float = LIMITS.knob(
        100.0, 0.1, 1e4, r"\gamma", "", "Penalty", scale="log", when={"soft": True}
    )
    """What it costs for each step and each unit by which a limit is exceeded."""

    w_q: float = COST.knob(10.0, 0.0, 1e3, "w_q", "1/(rad²·s)", "Position", scale="log")
    """Weight of the distance from the goal on the way."""
    w_v: float = COST.knob(0.1, 0.0, 100.0, "w_v", "s/rad²", "Velocity", scale="log")
    """Weight of the velocity on the way."""
    w_u: float = COST.knob(0.1, 1e-3, 100.0, "w_u", "1/s", "Control", scale="log")
    """Weight of the controls, each in units of its own size and from what holds the goal."""
    w_f: float = COST.knob(30.0, 0.0, 1e3, "w_f", "1/rad²", "Position at the end", scale="log")
    """Weight of the distance from the goal at the end of the horizon."""
    w_vf: float = COST.knob(
        1.0, 0.0, 100.0, "w_{vf}", "s²/rad²", "Velocity at the end", scale="log"
    )
    """Weight of the velocity at the end of the horizon."""

    iterations: str = COMPUTING.choice("1", ITERATIONS, "Iterations a period", key=True)
    """Of sequential quadratic programming, from the first guess."""
    start: str = COMPUTING.choice(
        "warm", {"warm": "Warm: the plan before, shifted", "cold": "Cold: hold still"}, "Guess"
    )
    """Where the iterations of a period begin."""
    last: str = COMPUTING.choice(
        "zero",
        {"zero": "Zero", "repeated": "The one before"},
        "Its last control",
        when={"start": "warm"},
    )
    """What a shifted plan lacks."""
    delay: float = COMPUTING.knob(
        0.0, 0.0, 10.0, "d", "periods", "Delay", step=1.0, effect="restart", key=True
    )
    """How late a plan acts: the time that computing takes, in simulated time."""
    compensate: bool = COMPUTING.toggle(True, "Compensate the delay", effect="restart")
    """Plan from where the model says that the robot will be when the plan acts."""
    fallback: str = COMPUTING.choice(
        "tail", {"tail": "The rest of the last plan", "brake": "Brake"}, "Without a plan"
    )
    """What acts where none is found."""

    target_x: float = OF_UR5.knob(0.35, -0.9, 0.9, "p^*_x", "m", "Target x", step=0.005)
    """Of the tip; or drag the ball in the scene."""
    target_y: float = OF_UR5.knob(-0.35, -0.9, 0.9, "p^*_y", "m", "Target y", step=0.005)
    """Of the tip; or drag the ball in the scene."""
    target_z: float = OF_UR5.knob(0.3, 0.05, 1.0, "p^*_z", "m", "Target z", step=0.005)
    """Of the tip; or drag the ball in the scene."""
    turns: float = OF_UR5.knob(0.0, 0.0, 1.0, "f", "Hz", "It goes round", step=0.01, key=True)
    """How often a second the target goes round a circle that begins at the ball; 0: it stays."""
    obstacle: bool = OF_UR5.toggle(False, "Obstacle", key=True)
    """A ball that the tip must not enter."""
    cart: float = OF_CART.knob(0.0, -1.3, 1.3, "p^*", "m", "Cart", step=0.01)
    """Where the cart should be, its pole upright; or drag the ball in the scene."""
    tip_y: float = OF_RODS.knob(0.0, -1.0, 1.0, "p^*_y", "m", "Tip y", step=0.01)
    """Where the tip should be; or drag the ball in the scene."""
    tip_z: float = OF_RODS.knob(2.25, 0.25, 2.25, "p^*_z", "m", "Tip z", step=0.01)
    """Where the tip should be; or drag the ball in the scene."""

    obstacle_x: float = OBSTACLE.knob(0.55, -0.9, 0.9, "m_x", "m", "Its x", step=0.005)
    """Of its centre; or drag it in the scene."""
    obstacle_y: float = OBSTACLE.knob(-0.1, -0.9, 0.9, "m_y", "m", "Its y", step=0.005)
    """Of its centre; or drag it in the scene."""
    obstacle_z: float = OBSTACLE.knob(0.25, 0.05, 1.0, "m_z", "m", "Its z", step=0.005)
    """Of its centre; or drag it in the scene."""
    radius: float = OBSTACLE.knob(0.12, 0.03, 0.25, "r", "m", "Its radius", step=0.005)
    """What the tip must stay away from its centre."""

    push: float = WORLD.knob(3.0, -10.0, 10.0, "p_{push}", "N·s", "Push", step=0.1)
    """Impulse a push gives the tip, along y."""
    payload: float = WORLD.knob(0.0, 0.0, 5.0, "m_{load}", "kg", "Payload", step=0.05)
    """A point mass at the tip that the model does not know of."""

    @property
    def robot(self) -> ControlledSystem:
        return controlled_system(self.system)

    @property
    def N(self) -> int:
        return round(self.steps)

    @property
    def target(self) -> np.ndarray:
        """(3,) [m] of the tip, or of the cart."""
        if self.system == "cart-pole":
            return np.array([0.0, self.cart, 0.75])
        if self.system == "double-pendulum":
            return np.array([0.0, self.tip_y, self.tip_z])
        return np.array([self.target_x, self.target_y, self.target_z])

    def target_at(self, t: float) -> np.ndarray:
        """(3,) [m] where it is at the time t [s]."""
        if self.system != "ur5":
            return self.target
        angle = 2.0 * np.pi * self.turns * t
        return self.target + CIRCLE_RADIUS * np.array([0.0, np.sin(angle), 1.0 - np.cos(angle)])

    @property
    def ball(self) -> Ball | None:
        """The obstacle, if there is one."""
        if self.system != "ur5" or not self.obstacle:
            return None
        center = np.array([self.obstacle_x, self.obstacle_y, self.obstacle_z])
        return Ball(center, self.radius)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x_min, x_max (nx,), u_max (nu,)."""
        at = self.robot
        far = self.rail if self.system == "cart-pole" else self.q_limit
        q = np.where(at.q_limited, far, np.inf)
        reach = np.concatenate([q, np.where(at.v_limited, self.v_limit, np.inf)])
        return at.x0 - reach, at.x0 + reach, self.u_limit * at.u_0

    @property
    def max_iterations(self) -> int | None:
        """Iterations a period; None: to convergence."""
        return None if self.iterations == "all" else int(self.iterations)

    @property
    def options(self) -> MpcOptions:
        return MpcOptions(
            warm=self.start == "warm",
            last="zero" if self.last == "zero" else "repeated",
            shrink_from=self.N if self.horizon == "shrinking" else None,
            fallback="tail" if self.fallback == "tail" else "brake",
            delay=round(self.delay),
            compensate=self.compensate,
        )
