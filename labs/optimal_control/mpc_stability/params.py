"""The tunables of the problem that is solved at every period, and of the run under it."""

from collections.abc import Mapping

import numpy as np

from labs.optimal_control.mpc_stability.formulation import (
    PERIODS,
    STABILITY_TASKS,
    SYSTEMS,
    TERMINAL_COSTS,
    TERMINAL_SETS,
    Formulation,
    FormulationSettings,
    formulate,
)
from labs.params import Group, Params, Value

START = Group("Start")
TERMINAL = Group("Terminal cost and set", effect="solve")
PROBLEM = Group("Problem", effect="solve")
WEIGHTS = Group("Weights", effect="solve")

METRES: Mapping[str, Mapping[Value, str]] = {"system": {"cart": "m"}}
SPEED: Mapping[str, Mapping[Value, str]] = {"system": {"cart": "m/s"}}


class MpcStabilityParams(Params):
    """What the user can turn."""

    system: str = PROBLEM.choice("unstable", SYSTEMS, "System", key=True, effect="restart")
    """What is controlled, as its linear model has it."""
    q0: float = START.knob(0.2, -1.1, 1.1, "q_0", "rad", "Start", step=0.01, units=METRES)
    """Where a run begins; or drag the ball. A new start begins a new run."""
    v0: float = START.knob(0.0, -3.3, 3.3, "v_0", "rad/s", "Its speed", step=0.01, units=SPEED)
    """The velocity a run begins with."""
    N: float = PROBLEM.knob(5.0, 1.0, 40.0, "N", "", "Horizon", step=1.0, key=True)
    """Periods that are looked ahead."""
    terminal_cost: str = TERMINAL.choice("p", TERMINAL_COSTS, "Terminal cost", "l_f", key=True)
    """What stands for the cost beyond the horizon."""
    alpha: float = TERMINAL.knob(
        1.0, 0.1, 1000.0, r"\alpha", "", "Its scale", scale="log", when={"terminal_cost": "q"}
    )
    """Q_f as a multiple of Q."""
    terminal_set: str = TERMINAL.choice("invariant", TERMINAL_SETS, "Terminal set", "X_f", key=True)
    """Where x_N has to be."""
    rho: float = TERMINAL.knob(
        1.0,
        0.01,
        1000.0,
        r"\rho",
        "",
        "Caution of K",
        scale="log",
        when=[{"terminal_cost": "p"}, {"terminal_set": "invariant"}],
    )
    """The terminal law u = K x is the best one for R times this; with 1 its P is Riccati's."""
    task: str = PROBLEM.choice("regulate", STABILITY_TASKS, "Task", key=True)
    """What the controller is for."""
    amplitude: float = PROBLEM.knob(
        0.1, 0.0, 1.0, "a", "rad", "Amplitude", step=0.01, when={"task": "track"}, units=METRES
    )
    """Of the motion that is followed."""
    frequency: float = PROBLEM.knob(
        0.2, 0.05, 1.0, "f", "Hz", "Frequency", step=0.01, when={"task": "track"}
    )
    """Of the motion that is followed."""
    price: float = PROBLEM.knob(
        0.2, 0.0, 2.0, "c", "1/(N·m)", "Price", step=0.01, when={"task": "economic"},
        units={"system": {"cart": "1/N"}},
    )  # fmt: skip
    """c u is added to the stage cost: what the control costs, or where it is negative earns."""
    period: float = PROBLEM.choice(0.1, PERIODS, "Period", "T", "s")
    """Between two plans."""
    u_max: float = PROBLEM.knob(
        2.0, 0.2, 5.0, "u_{max}", "N·m", "Strongest control", step=0.05,
        units={"system": {"cart": "N"}},
    )  # fmt: skip
    """U = [-u_max, u_max]."""
    limited: bool = PROBLEM.toggle(True, "State limits")
    """X: |q| up to 0.5 rad and |v| up to 3 rad/s; of the cart 1 m and 1 m/s."""
    q_q: float = WEIGHTS.knob(
        1.0, 0.01, 100.0, "q_q", "1/rad²", "Position", scale="log",
        units={"system": {"cart": "1/m²"}},
    )  # fmt: skip
    """Q = diag(q_q, q_v)."""
    q_v: float = WEIGHTS.knob(
        0.1, 0.0, 100.0, "q_v", "s²/rad²", "Velocity", scale="log",
        units={"system": {"cart": "s²/m²"}},
    )  # fmt: skip
    """Q = diag(q_q, q_v); at zero l bounds |x|² no longer."""
    r: float = WEIGHTS.knob(
        1.0, 0.001, 100.0, "r", "1/(N·m)²", "Control", scale="log",
        units={"system": {"cart": "1/N²"}},
    )  # fmt: skip
    """R = r."""

    @property
    def start(self) -> np.ndarray:
        """(2,)"""
        return np.array([self.q0, self.v0])

    @property
    def formulation(self) -> Formulation:
        return formulate(
            FormulationSettings(
                system=self.system,
                period=self.period,
                task=self.task,
                weights=(self.q_q, self.q_v),
                r=self.r,
                N=round(self.N),
                terminal_cost=self.terminal_cost,
                alpha=self.alpha,
                rho=self.rho,
                terminal_set=self.terminal_set,
                u_max=self.u_max,
                limited=self.limited,
                amplitude=self.amplitude,
                frequency=self.frequency,
                price=self.price,
            )
        )
