"""The tunables of the regulator, its weights and its world."""

import numpy as np
from pydantic import field_validator
from pydantic_core.core_schema import ValidationInfo

from labs.errors import LabError
from labs.optimal_control.lqr.linear_systems import LINEAR_SYSTEMS, LinearSystem
from labs.optimal_control.lqr.own_system import EXAMPLE_SYSTEM, OwnSystem, parse_own_system
from labs.optimal_control.lqr.region_of_attraction import RegulatedSystem
from labs.optimal_control.lqr.regulator import (
    FINAL_WEIGHTS,
    LQR_POLICIES,
    Regulator,
    RegulatorSettings,
    regulator,
)
from labs.params import Group, Params

SLIDING = {"system": ["cart-pole", "mass"]}
TURNING = {"system": ["cart-pole", "pendulum", "ur5"]}
OWN_LIMIT = {"system": ["cart-pole", "pendulum", "mass", "own"]}
MECHANISM = {"system": list(LINEAR_SYSTEMS)}
OWN = {"system": "own"}
TIMES = {"discrete": "Steps: x(t+1) = A x + B u", "continuous": "Time: dx/dt = A x + B u"}
PERIODS = {0.01: "10 ms", 0.02: "20 ms", 0.05: "50 ms", 0.1: "100 ms", 0.2: "200 ms"}

SYSTEM = Group("System", effect="restart")
WEIGHTS = Group("Weights", effect="solve")
HORIZON = Group("Horizon", effect="solve")
WORLD = Group("World", effect="solve")


class LqrParams(Params):
    """What the user can turn."""

    system: str = SYSTEM.choice(
        "cart-pole", {**LINEAR_SYSTEMS, "own": "Your matrices"}, "System", key=True
    )
    """What is to be kept at rest."""
    time: str = SYSTEM.choice("discrete", TIMES, "A and B are in", when=OWN)
    """Continuous time is made discrete with the control held for a time step."""
    matrices: str = SYSTEM.text(EXAMPLE_SYSTEM, "Your matrices", rows=6, max_length=6000, when=OWN)
    """A, B, Q, R and x0, each after its name, rows after one another with semicolons or on lines of
    their own; or as JSON; pasted or a file. Up to 8 states and 4 controls."""
    deviation: float = SYSTEM.knob(
        0.3,
        -3.2,
        3.2,
        "\\Delta x_0",
        "rad",
        "Start off by",
        step=0.01,
        key=True,
        when=MECHANISM,
        units={"system": {"mass": "m"}},
    )
    """Of the pole, the pendulum, the mass, or every joint of the UR5, at rest."""
    period: float = SYSTEM.choice(0.02, PERIODS, "Time step", "T", "s", effect="solve")
    """From t to t + 1: the policy looks once in a step and holds its control."""
    q_slide: float = WEIGHTS.knob(
        10.0, 0.0, 10_000.0, "q_p", "1/m²", "Position", scale="log", key=True, when=SLIDING
    )
    """Q's weight of what slides: the cart, the mass."""
    q_turn: float = WEIGHTS.knob(
        10.0, 0.0, 10_000.0, "q_\\theta", "1/rad²", "Angle", scale="log", key=True, when=TURNING
    )
    """Q's weight of what turns: the pole, the pendulum, each joint of the UR5."""
    q_slide_rate: float = WEIGHTS.knob(
        1.0, 0.0, 1000.0, "q_{\\dot p}", "s²/m²", "Velocity", scale="log", when=SLIDING
    )
    """Q's weight of the velocity of what slides."""
    q_turn_rate: float = WEIGHTS.knob(
        1.0,
        0.0,
        1000.0,
        "q_{\\dot\\theta}",
        "s²/rad²",
        "Angular velocity",
        scale="log",
        when=TURNING,
    )
    """Q's weight of the velocity of what turns."""
    r: float = WEIGHTS.knob(
        0.1,
        1e-4,
        1e4,
        "r",
        "1/(N·m)²",
        "Control",
        scale="log",
        key=True,
        when=MECHANISM,
        units={"system": {"cart-pole": "1/N²", "mass": "1/N²"}},
    )
    """R = r I: what force or torque costs."""
    policy: str = HORIZON.choice("steady", LQR_POLICIES, "Policy", key=True)
    """The steady state's gain for ever, or those of N steps: all in turn and then over again, or
    the first of them at every step."""
    horizon: float = HORIZON.knob(100.0, 1.0, 300.0, "N", "", "Horizon", step=1.0)
    """Steps over which the cost is summed up."""
    final: str = HORIZON.choice("q", FINAL_WEIGHTS, "Final weight", "Q_f")
    """What the final weight is a multiple of."""
    alpha: float = HORIZON.knob(1.0, 0.0, 1000.0, "\\alpha", "", "Its scale", scale="log")
    """How many times as much; with 0 it does not matter where x ends."""
    limits: bool = WORLD.toggle(True, "Limits")
    """Cut every control to what the motor can give. The regulator knows of none."""
    limit: float = WORLD.knob(
        20.0,
        0.5,
        200.0,
        "u_{max}",
        "N·m",
        "Strongest control",
        scale="log",
        key=True,
        when=OWN_LIMIT,
        units={"system": {"cart-pole": "N", "mass": "N", "own": ""}},
    )
    """Of the cart, the pendulum, the mass, your controls; the UR5's joints have motors of their
    own."""
    push_force: float = WORLD.knob(
        1.0, 0.0, 200.0, "f_{push}", "N", "Push force", scale="log", effect="live"
    )
    """On the tip, along +y, while a push lasts, 0.2 s; to your controls it is added."""

    @field_validator("matrices")
    @classmethod
    def _are_matrices(cls, value: str, info: ValidationInfo) -> str:
        try:
            parse_own_system(value, info.data.get("time") == "continuous")
        except LabError as error:
            raise ValueError(str(error)) from None
        return value

    @property
    def linear_system(self) -> LinearSystem | OwnSystem:
        return self.settings.linear_system

    @property
    def settings(self) -> RegulatorSettings:
        weights = (self.q_slide, self.q_turn, self.q_slide_rate, self.q_turn_rate)
        return RegulatorSettings(
            self.system, self.period, weights, self.r, round(self.horizon), self.final,
            self.alpha, self.policy, self.matrices if self.system == "own" else "",
            self.time == "continuous",
        )  # fmt: skip

    @property
    def regulator(self) -> Regulator:
        return regulator(self.settings)

    @property
    def control_limit(self) -> np.ndarray:
        """(nu,) [N; N m]: what the motors can give, limited or not."""
        system = self.linear_system
        if isinstance(system, LinearSystem) and self.system == "ur5":
            return system.mechanism.control_limit
        return np.full(system.nu, self.limit)

    @property
    def closed_loop(self) -> RegulatedSystem:
        """The loop whose region of attraction is sought; not for the UR5."""
        limit = self.limit if self.limits else np.inf
        return RegulatedSystem(self.system, self.period, self.regulator.gains[:, 0], limit)
