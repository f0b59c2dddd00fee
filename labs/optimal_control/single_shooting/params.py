"""The tunables of the problem, of its transcription and of what is asked about it."""

from dataclasses import replace

import numpy as np

from labs.algorithms.shooting_steps import FORMS, METHODS, CostForm
from labs.algorithms.single_shooting import SingleShooting
from labs.algorithms.sqp_iterate import HESSIANS
from labs.params import Group, Params
from labs.problems.continuous_control import ContinuousProblem
from labs.tasks.direct.systems import TITLES, System, system
from labs.tasks.motion.continuous import OBJECTIVES, MotionLimits, continuous_motion
from labs.tasks.motion.motions import MotionWeights

MOST_PIECES, MOST_STEPS = 60, 8
PLANAR = {name: title for name, title in TITLES.items() if system(name).planar}
T_LIMITS = (0.2, 6.0)
"""[s] of a free horizon."""
NEEDS_LIMIT = ("least-time", "fastest-end")
"""Objectives that have no minimum without one."""
MAY_LIMIT = {"objective": tuple(name for name in OBJECTIVES if name not in NEEDS_LIMIT)}
LIMITED = ({"limited": True}, {"objective": NEEDS_LIMIT})

MOTION = Group("Motion", effect="restart")
COST = Group("Weights", effect="solve", when={"objective": "weighted"})
SHOOTING = Group("Shooting", effect="solve")
ONE_CONTROL = Group("One control")
WORLD = Group("World")
SOLVER = Group("Solver", effect="solve")


class SingleShootingParams(Params):
    """What the user can turn."""

    system: str = MOTION.choice("pendulum", PLANAR, "System", key=True)
    """What moves: from rest to rest; all but the upright pendulum hang at first."""
    objective: str = MOTION.choice("least-energy", OBJECTIVES, "Minimise", key=True)
    """What is minimised. All but the weighted one end at the goal exactly."""
    horizon: float = MOTION.knob(
        2.0, 0.5, 4.0, "T", "s", "Horizon", step=0.1, key=True, effect="solve"
    )
    """How long the motion takes; in least time, the first guess of it."""
    limited: bool = MOTION.toggle(False, "Limit the control", effect="solve", when=MAY_LIMIT)
    """Solve within |u| <= u_max."""
    limit: float = MOTION.knob(
        0.5, 0.2, 3.0, "u_{max}/u_0", "", "Limit", step=0.05, effect="solve", when=LIMITED
    )
    """Most that a control may be, in units of its size u_0."""
    goal: float = COST.knob(300.0, 1.0, 1e4, "w_f", "1/rad²", "Goal", scale="log", key=True)
    """Weight of the distance from the goal at the end."""
    rest: float = COST.knob(10.0, 0.01, 1e3, "w_{vf}", "s²/rad²", "Rest at the end", scale="log")
    """Weight of the velocity at the end."""
    posture: float = COST.knob(0.1, 0.0, 10.0, "w_q", "1/(rad²·s)", "On the way", scale="log")
    """Weight of the distance from the goal on the way."""
    velocity: float = COST.knob(0.01, 0.0, 10.0, "w_v", "s/rad²", "Velocity", scale="log")
    """Weight of the velocity on the way."""
    control: float = COST.knob(1.0, 1e-3, 100.0, "w_u", "1/s", "Control", scale="log", key=True)
    """Weight of the controls, each in units of its own size u_0."""

    pieces: float = SHOOTING.knob(20.0, 2.0, MOST_PIECES, "N", "", "Pieces", step=1.0, key=True)
    """How many pieces the control is held on: the variables."""
    steps: float = SHOOTING.knob(2.0, 1.0, MOST_STEPS, "M", "", "Steps a piece", step=1.0, key=True)
    """Steps of integration in each piece: the accuracy of x."""
    integrator: str = SHOOTING.choice(
        "rk4", {name: method.title for name, method in METHODS.items()}, "Integrator", key=True
    )
    """By which x follows from the controls."""
    form: str = SHOOTING.choice(
        "augmented",
        {"augmented": "With the state: (x, c)", "sum": "The notes' sum: l h"},
        "Running cost",
    )
    """How the integral of l is computed."""

    piece: float = ONE_CONTROL.knob(
        1.0, 1.0, MOST_PIECES, "k", "", "Changed piece", step=1.0, key=True
    )
    """The piece whose control is changed; or drag the ball in the scene."""
    delta: float = ONE_CONTROL.knob(
        0.5, -2.0, 2.0, r"\delta", "u₀", "Its change", step=0.01, key=True
    )
    """What is added to it, to see where the motion would go; or drag the ball in the scene."""

    feedback: bool = WORLD.toggle(False, "Track the plan by LQR")
    """Whether the robot is played with a linear quadratic regulator about the plan, or with the
    planned controls alone."""

    hessian: str = SOLVER.choice("bfgs", HESSIANS, "Hessian", key=True)
    """Exact, by Gauss-Newton without the curvature of the dynamics, or learnt from gradients."""
    start: str = SOLVER.choice(
        "warm", {"warm": "Warm: the present solution", "cold": "Cold: the first guess"}, "Start"
    )
    """What a change of the problem is solved from."""
    guess: float = SOLVER.knob(0.1, -1.0, 1.0, "A", "u₀", "First guess", step=0.01)
    """Size of the controls guessed at first, u = A u_0 cos(2 pi f_0 t)."""
    guess_rate: float = SOLVER.knob(0.0, 0.0, 2.0, "f_0", "Hz", "Its frequency", step=0.05)
    """Of the first guess; at 0 it is a constant push."""
    iterations: float = SOLVER.knob(100.0, 1.0, 200.0, "n_{max}", "", "Most iterations", step=1.0)
    """Before the solver stops short."""
    study: str = SOLVER.choice(
        "none",
        {
            "none": "Nothing",
            "gradients": "Gradients, three ways",
            "integration": "Errors, over M",
        },
        "Measure also",
    )
    """What is measured besides: at the first guess the gradient, by sensitivities, adjoint and
    finite differences; of the solution the error of state and cost over M."""

    @property
    def task(self) -> System:
        return system(self.system)

    @property
    def N(self) -> int:
        return round(self.pieces)

    @property
    def M(self) -> int:
        return round(self.steps)

    @property
    def chosen(self) -> int:
        """The piece whose control is changed, from 0."""
        return min(round(self.piece), self.N) - 1

    @property
    def problem(self) -> ContinuousProblem:
        """A new one."""
        at = self.task
        limited = self.limited or self.objective in NEEDS_LIMIT
        motion = continuous_motion(
            at.motion,
            self.objective,
            self.horizon,
            weights=MotionWeights(self.goal, self.rest, self.posture, self.velocity, self.control),
            limits=MotionLimits(control=self.limit if limited else np.inf),
            T_limits=T_LIMITS if self.objective == "least-time" else None,
        )
        return replace(motion, x0=at.x0)

    @property
    def shooting(self) -> SingleShooting:
        """The problem as a programme, with nothing computed yet."""
        return self.transcription(self.N, self.M, self.integrator)

    def transcription(
        self, N: int, M: int, integrator: str, form: CostForm | None = None
    ) -> SingleShooting:
        """The problem with other pieces, steps and methods."""
        chosen = next(known for known in FORMS if known == self.form)
        return SingleShooting(self.problem, N, M, integrator, form or chosen)

    def first_guess(self, N: int) -> np.ndarray:
        """U (N, nu), within the limits."""
        t = (np.arange(N) + 0.5) * self.horizon / N
        U = self.guess * np.cos(2.0 * np.pi * self.guess_rate * t)[:, None] * self.task.u_0
        return np.asarray(np.clip(U, self.problem.u_lower, self.problem.u_upper))
