"""The tunables of a motion to plan (`labs.tasks.motion.motions`), in three groups."""

import numpy as np

from labs.algorithms.integrators import INTEGRATORS
from labs.params import Params, choice, knob, toggle
from labs.problems.optimal_control import Problem
from labs.tasks.motion.motions import MOTIONS, Motion, Weights, motion_problem

STEPS = {0.01: "10 ms", 0.02: "20 ms", 0.04: "40 ms"}


class MotionParams(Params):
    """The motion, its cost and its horizon."""

    system: str = choice(
        "pendulum",
        {name: motion.title for name, motion in MOTIONS.items()},
        label="System",
        group="Motion",
        effect="restart",
        help="What moves. All but the UR5 hang at first and should end upright and at rest.",
    )
    goal: float = knob(
        300.0,
        1.0,
        1e5,
        symbol="w_f",
        unit="1/rad²",
        label="Goal",
        group="Cost",
        scale="log",
        effect="solve",
        help="Weight of the distance from the goal at the end: of the posture, or the UR5's tip.",
    )
    rest: float = knob(
        10.0,
        0.01,
        1e4,
        symbol="w_{vf}",
        unit="s²/rad²",
        label="Rest at the end",
        group="Cost",
        scale="log",
        effect="solve",
        help="Weight of the velocity at the end.",
    )
    posture: float = knob(
        0.1,
        0.0,
        10.0,
        symbol="w_q",
        unit="1/(rad²·s)",
        label="Posture on the way",
        group="Cost",
        scale="log",
        effect="solve",
        help="Weight of the distance from the goal on the way; of the UR5, from where it starts.",
    )
    velocity: float = knob(
        0.01,
        0.0,
        10.0,
        symbol="w_v",
        unit="s/rad²",
        label="Velocity on the way",
        group="Cost",
        scale="log",
        effect="solve",
        help="Weight of the velocity on the way.",
    )
    control: float = knob(
        1.0,
        1e-4,
        100.0,
        symbol="w_u",
        unit="1/s",
        label="Control",
        group="Cost",
        scale="log",
        effect="solve",
        help="Weight of the controls, R: each is measured in units of its own size u_0.",
    )
    horizon: float = knob(
        2.0,
        0.5,
        3.0,
        symbol="T",
        unit="s",
        label="Horizon",
        group="Horizon",
        step=0.1,
        effect="solve",
        help="How long the motion may take; N = T / h steps.",
    )
    h: float = choice(
        0.02,
        STEPS,
        label="Time step",
        symbol="h",
        unit="s",
        group="Horizon",
        effect="solve",
        help="Of the plan; the plant is integrated in steps of 5 ms.",
    )
    integrator: str = choice(
        "rk4",
        {name: method.title for name, method in INTEGRATORS.items()},
        label="Integrator",
        group="Horizon",
        effect="solve",
        help="The method that is x+ = f(x, u) in the plan; the plant goes by Runge-Kutta.",
    )
    limited: bool = toggle(
        False,
        label="Torque limit",
        group="Horizon",
        effect="solve",
        help="Solve within |u| <= u_max and cut what is played to it (beyond the notes).",
    )
    limit: float = knob(
        0.5,
        0.2,
        2.0,
        symbol="u_{max}/u_0",
        unit="",
        label="Limit",
        group="Horizon",
        step=0.05,
        effect="solve",
        help="Most that a control may be, in units of its size u_0; only with the torque limit.",
    )

    target_x: float = knob(
        0.4,
        -0.8,
        0.8,
        symbol="p^*_x",
        unit="m",
        label="Target x",
        group="Target",
        step=0.01,
        effect="solve",
        help="Target of the UR5's tip; or drag the ball in the scene.",
    )
    target_y: float = knob(
        -0.35,
        -0.8,
        0.8,
        symbol="p^*_y",
        unit="m",
        label="Target y",
        group="Target",
        step=0.01,
        effect="solve",
        help="Target of the UR5's tip; or drag the ball in the scene.",
    )
    target_z: float = knob(
        0.25,
        0.05,
        1.0,
        symbol="p^*_z",
        unit="m",
        label="Target z",
        group="Target",
        step=0.01,
        effect="solve",
        help="Target of the UR5's tip; or drag the ball in the scene.",
    )

    @property
    def motion(self) -> Motion:
        return MOTIONS[self.system]

    @property
    def size(self) -> np.ndarray:
        """u_0 (nu,)."""
        return np.array(self.motion.size)

    @property
    def target(self) -> np.ndarray:
        return np.array([self.target_x, self.target_y, self.target_z])

    @property
    def bound(self) -> np.ndarray | None:
        """(nu,) most that |u| may be."""
        return self.limit * self.size if self.limited else None

    def problem(self, N: int, h: float) -> Problem:
        """With a horizon of N steps of h."""
        return motion_problem(
            self.system,
            Weights(self.goal, self.rest, self.posture, self.velocity, self.control),
            N,
            h,
            method=self.integrator,
            target=None if self.motion.goal else self.target,
            limit=self.limit if self.limited else np.inf,
        )
