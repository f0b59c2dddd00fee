"""The tunables of a motion to plan by a direct method, in single and multiple shooting, collocation
and the race of direct methods."""

from dataclasses import replace

import numpy as np

from labs.algorithms.sqp_iterate import HESSIANS, SqpOptions
from labs.lab import ChoiceSettings
from labs.params import Group, Params
from labs.problems.continuous_control import ContinuousProblem
from labs.tasks.direct.systems import (
    TASK_TITLES,
    RestToRestTask,
    reaching_posture,
    rest_to_rest_task,
)
from labs.tasks.motion.continuous import OBJECTIVES, MotionLimits, continuous_motion
from labs.tasks.motion.motions import MotionWeights
from labs.tasks.motion.tip_constraints import Ball
from labs.tunables import ChoiceCondition

T_LIMITS = (0.2, 6.0)
"""[s] of a free horizon."""
LIGHT_SYSTEMS = tuple(name for name in TASK_TITLES if name != "ur5")
"""Systems whose derivatives cost little."""
MAX_HEAVY_PIECES = 12
"""Of the UR5, whose derivatives cost more, in shooting."""
NEEDS_LIMIT = ("least-time", "fastest-end")
"""Objectives that have no minimum without a limit of the control."""
MAY_LIMIT = {"objective": tuple(name for name in OBJECTIVES if name not in NEEDS_LIMIT)}
LIMITED = ({"limited": True}, {"objective": NEEDS_LIMIT})
UNBOUNDED_SPEED = ("double-pendulum", "ur5")
"""Systems whose final speed has no maximum that is found without a limit of the velocity."""
MAY_LIMIT_SPEED: tuple[ChoiceCondition, ...] = (
    {"objective": tuple(name for name in OBJECTIVES if name != "fastest-end")},
    {"system": tuple(name for name in TASK_TITLES if name not in UNBOUNDED_SPEED)},
)
SPEED_LIMITED: tuple[ChoiceCondition, ...] = (
    {"speed_limited": True},
    {"objective": "fastest-end", "system": UNBOUNDED_SPEED},
)
CHOICE_SETTINGS: ChoiceSettings = {
    "system": {"double-pendulum": {"limit": 1.0}, "ur5": {"horizon": 1.0}}
}
"""With which collocation and multiple shooting meet all objectives."""
SOFT_WEIGHT = 100.0
"""[1/s] of soft limits, passed by a unit."""
MOTION = Group("Motion", effect="restart")
LIMITS = Group("Limits", effect="solve")
COST = Group("Weights", effect="solve", when={"objective": "weighted"})
TARGET = Group("Target", effect="solve", when={"system": "ur5"})
OBSTACLE = Group("Obstacle", effect="solve", when={"system": "ur5", "obstacle": True})
SOLVER = Group("Solver", effect="solve")


class PlanParams(Params):
    """The motion, its limits and weights, and the solver."""

    system: str = MOTION.choice("pendulum", TASK_TITLES, "System", key=True)
    """What moves: from rest to rest; all but the upright pendulum hang at first."""
    objective: str = MOTION.choice("least-energy", OBJECTIVES, "Minimise", key=True)
    """What is minimised. All but the weighted one end at the goal exactly."""
    horizon: float = MOTION.knob(
        2.0, 0.5, 4.0, "T", "s", "Horizon", step=0.1, key=True, effect="solve"
    )
    """How long the motion takes; in least time, the first guess of it."""

    limited: bool = LIMITS.toggle(False, "Limit the control", when=MAY_LIMIT)
    """Solve within |u| <= u_max."""
    limit: float = LIMITS.knob(
        0.5, 0.2, 3.0, "u_{max}/u_0", "", "Control limit", step=0.05, when=LIMITED
    )
    """Most that a control may be, in units of its size u_0."""
    position_limited: bool = LIMITS.toggle(False, "Limit the position")
    """Solve within q_min <= q <= q_max: d beyond where it starts and where it should end."""
    position_margin: float = LIMITS.knob(
        1.0, 0.05, 3.0, "d", "rad", "Position margin", step=0.05,
        units={"system": {"mass": "m", "cart-pole": "m"}}, when={"position_limited": True},
    )  # fmt: skip
    """How far a joint may go beyond start and goal; of the cart-pole, the cart alone."""
    speed_limited: bool = LIMITS.toggle(False, "Limit the velocity", when=MAY_LIMIT_SPEED)
    """Solve within |v| <= v_max, at every joint."""
    speed_limit: float = LIMITS.knob(
        3.0, 0.5, 10.0, "v_{max}", "rad/s", "Velocity limit", step=0.1, when=SPEED_LIMITED
    )
    """Most that a joint's velocity may be."""
    soft: bool = LIMITS.toggle(
        False,
        "Soft limits",
        when=(*SPEED_LIMITED, {"position_limited": True}, {"system": "ur5", "obstacle": True}),
    )
    """Positions, velocities and obstacles may be passed a little, at a price, not never."""

    goal: float = COST.knob(300.0, 1.0, 1e4, "w_f", "1/rad²", "Goal", scale="log", key=True)
    """Weight of the distance from the goal at the end: of the posture, or the UR5's tip."""
    rest: float = COST.knob(10.0, 0.01, 1e3, "w_{vf}", "s²/rad²", "Rest at the end", scale="log")
    """Weight of the velocity at the end."""
    posture: float = COST.knob(0.1, 0.0, 10.0, "w_q", "1/(rad²·s)", "On the way", scale="log")
    """Weight of the distance from the goal on the way; of the UR5, from where it starts."""
    velocity: float = COST.knob(0.01, 0.0, 10.0, "w_v", "s/rad²", "Velocity", scale="log")
    """Weight of the velocity on the way."""
    control: float = COST.knob(1.0, 1e-3, 100.0, "w_u", "1/s", "Control", scale="log", key=True)
    """Weight of the controls, each in units of its own size u_0."""

    target_x: float = TARGET.knob(0.4, -0.8, 0.8, "p^*_x", "m", "Target x", step=0.005)
    """Of the tip; or drag the ball in the scene."""
    target_y: float = TARGET.knob(-0.35, -0.8, 0.8, "p^*_y", "m", "Target y", step=0.005)
    """Of the tip; or drag the ball in the scene."""
    target_z: float = TARGET.knob(0.25, 0.05, 1.0, "p^*_z", "m", "Target z", step=0.005)
    """Of the tip; or drag the ball in the scene."""
    obstacle: bool = TARGET.toggle(False, "Obstacle", key=True)
    """A ball that the tip must not enter."""
    obstacle_x: float = OBSTACLE.knob(0.45, -0.8, 0.8, "m_x", "m", "Its x", step=0.005)
    """Of its centre; or drag it in the scene."""
    obstacle_y: float = OBSTACLE.knob(-0.1, -0.8, 0.8, "m_y", "m", "Its y", step=0.005)
    """Of its centre; or drag it in the scene."""
    obstacle_z: float = OBSTACLE.knob(0.35, 0.05, 1.0, "m_z", "m", "Its z", step=0.005)
    """Of its centre; or drag it in the scene."""
    obstacle_radius: float = OBSTACLE.knob(0.1, 0.03, 0.25, "r", "m", "Its radius", step=0.005)
    """What the tip must stay away from its centre."""

    hessian: str = SOLVER.choice("exact", HESSIANS, "Hessian", key=True)
    """Exact, by Gauss-Newton without the curvature of the dynamics, or learnt from gradients."""
    start: str = SOLVER.choice(
        "warm", {"warm": "Warm: the present solution", "cold": "Cold: the first guess"}, "Start"
    )
    """What a change of the problem is solved from."""
    iterations: float = SOLVER.knob(100.0, 1.0, 200.0, "n_{max}", "", "Most iterations", step=1.0)
    """Before the solver stops short."""

    @property
    def task(self) -> RestToRestTask:
        return rest_to_rest_task(self.system)

    @property
    def costly_derivatives(self) -> bool:
        """Whether those of the dynamics cost much, as the UR5's."""
        return self.system not in LIGHT_SYSTEMS

    @property
    def target(self) -> np.ndarray:
        """p* (3,) [m] of a reach."""
        return np.array([self.target_x, self.target_y, self.target_z])

    @property
    def ball(self) -> Ball | None:
        """The obstacle, if there is one."""
        if self.system != "ur5" or not self.obstacle:
            return None
        center = np.array([self.obstacle_x, self.obstacle_y, self.obstacle_z])
        return Ball(center, self.obstacle_radius)

    @property
    def goal_posture(self) -> np.ndarray:
        """q (nq,) that a straight line leads to."""
        return reaching_posture(self.system, self.target)

    @property
    def goal_position(self) -> np.ndarray:
        """Where the tip should end (3,) [m]."""
        at = self.task
        return at.mechanism.tip(at.goal) if len(at.goal) else self.target

    def goal_error(self, q: np.ndarray) -> float:
        """How far q (nq,) is from the goal: in its own units, or the tip from its target [m]."""
        at = self.task
        error = q - at.goal if len(at.goal) else at.mechanism.tip(q) - self.target
        return float(np.linalg.norm(error))

    @property
    def bound(self) -> np.ndarray | None:
        """(nu,) most that |u| may be."""
        limited = self.limited or self.objective in NEEDS_LIMIT
        return self.limit * self.task.u_0 if limited else None

    @property
    def problem(self) -> ContinuousProblem:
        """A new one."""
        ball, far = self.ball, self.position_margin if self.position_limited else np.inf
        q_lower, q_upper = self.task.position_limits(far)
        limits = MotionLimits(
            q_lower,
            q_upper,
            velocity=self.speed_limit if self.acts("speed_limit") else np.inf,
            control=np.inf if self.bound is None else self.limit,
            obstacles=(ball,) if ball else (),
            soft_weight=SOFT_WEIGHT if self.soft and self.acts("soft") else None,
        )
        motion = continuous_motion(
            self.task.motion,
            self.objective,
            self.horizon,
            weights=MotionWeights(self.goal, self.rest, self.posture, self.velocity, self.control),
            limits=limits,
            target=None if len(self.task.goal) else self.target,
            T_limits=T_LIMITS if self.objective == "least-time" else None,
        )
        return replace(motion, x0=self.task.x0)

    def cap_pieces(self, pieces: float) -> int:
        """N of as many pieces as asked for; of the UR5 at most MAX_HEAVY_PIECES."""
        return min(round(pieces), MAX_HEAVY_PIECES) if self.costly_derivatives else round(pieces)

    def cap_steps(self, steps: float) -> int:
        """M, the steps of integration in a piece; of the UR5 one."""
        return 1 if self.costly_derivatives else round(steps)

    @property
    def options(self) -> SqpOptions:
        return SqpOptions(hessian=self.hessian, iterations=round(self.iterations))
