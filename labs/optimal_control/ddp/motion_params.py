"""The tunables of a motion to plan (`labs.tasks.motion.motions`)."""

import numpy as np

from labs.algorithms.integrators import INTEGRATORS
from labs.params import Group, Params
from labs.problems.optimal_control import OptimalControlProblem
from labs.tasks.motion.motions import MOTIONS, MotionTask, MotionWeights, motion_problem

TIME_STEPS = {0.01: "10 ms", 0.02: "20 ms", 0.04: "40 ms"}


MOTION = Group("Motion", effect="restart")
COST = Group("Cost", effect="solve")
HORIZON = Group("Horizon", effect="solve")
TARGET = Group("Target", effect="solve", when={"system": "ur5"})


class MotionParams(Params):
    """The motion, its cost and its horizon."""

    system: str = MOTION.choice(
        "pendulum", {name: motion.title for name, motion in MOTIONS.items()}, "System", key=True
    )
    """What moves. All but the UR5 hang at first and should end upright and at rest."""
    goal: float = COST.knob(300.0, 1.0, 1e5, "w_f", "1/rad²", "Goal", scale="log", key=True)
    """Weight of the distance from the goal at the end: of the posture, or the UR5's tip."""
    rest: float = COST.knob(10.0, 0.01, 1e4, "w_{vf}", "s²/rad²", "Rest at the end", scale="log")
    """Weight of the velocity at the end."""
    posture: float = COST.knob(
        0.1, 0.0, 10.0, "w_q", "1/(rad²·s)", "Posture on the way", scale="log"
    )
    """Weight of the distance from the goal on the way; of the UR5, from where it starts."""
    velocity: float = COST.knob(
        0.01, 0.0, 10.0, "w_v", "s/rad²", "Velocity on the way", scale="log"
    )
    """Weight of the velocity on the way."""
    control: float = COST.knob(1.0, 1e-4, 100.0, "w_u", "1/s", "Control", scale="log", key=True)
    """Weight of the controls, R: each is measured in units of its own size u_0."""
    horizon: float = HORIZON.knob(2.0, 0.5, 3.0, "T", "s", "Horizon", step=0.1, key=True)
    """How long the motion may take; N = T / h steps."""
    h: float = HORIZON.choice(0.02, TIME_STEPS, "Time step", "h", "s")
    """Of the plan; the plant is integrated in steps of 5 ms."""
    integrator: str = HORIZON.choice(
        "rk4", {name: method.title for name, method in INTEGRATORS.items()}, "Integrator"
    )
    """The method that is x+ = f(x, u) in the plan; the plant goes by Runge-Kutta."""
    limited: bool = HORIZON.toggle(False, "Torque limit", key=True)
    """Solve within |u| <= u_max and cut what is played to it (beyond the notes)."""
    limit: float = HORIZON.knob(
        0.5, 0.2, 2.0, "u_{max}/u_0", "", "Limit", step=0.05, key=True, when={"limited": True}
    )
    """Most that a control may be, in units of its size u_0."""

    target_x: float = TARGET.knob(0.4, -0.8, 0.8, "p^*_x", "m", "Target x", step=0.005)
    """Of the tip; or drag the ball in the scene."""
    target_y: float = TARGET.knob(-0.35, -0.8, 0.8, "p^*_y", "m", "Target y", step=0.005)
    """Of the tip; or drag the ball in the scene."""
    target_z: float = TARGET.knob(0.25, 0.05, 1.0, "p^*_z", "m", "Target z", step=0.005)
    """Of the tip; or drag the ball in the scene."""

    @property
    def motion(self) -> MotionTask:
        return MOTIONS[self.system]

    @property
    def control_scale(self) -> np.ndarray:
        """u_0 (nu,)."""
        return np.array(self.motion.control_scale)

    @property
    def target(self) -> np.ndarray:
        return np.array([self.target_x, self.target_y, self.target_z])

    @property
    def bound(self) -> np.ndarray | None:
        """(nu,) most that |u| may be."""
        return self.limit * self.control_scale if self.limited else None

    def problem(self, N: int, h: float) -> OptimalControlProblem:
        """With a horizon of N steps of h."""
        return motion_problem(
            self.system,
            MotionWeights(self.goal, self.rest, self.posture, self.velocity, self.control),
            N,
            h,
            method=self.integrator,
            target=None if self.motion.goal else self.target,
            limit=self.limit if self.limited else np.inf,
        )
