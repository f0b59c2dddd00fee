"""The tunables of the problem, of its transcription and of what is asked about it."""

import numpy as np

from labs.algorithms.shooting_steps import COST_FORMS, SHOOTING_METHODS, CostForm
from labs.algorithms.single_shooting import SingleShooting
from labs.algorithms.sqp_iterate import HESSIANS
from labs.lab import ChoiceSettings
from labs.params import Group
from labs.tasks.direct.plan_params import LIGHT_SYSTEMS, SOLVER, PlanParams

MAX_PIECES, MAX_STEPS = 60, 8

CHOICE_SETTINGS: ChoiceSettings = {
    "system": {
        "double-pendulum": {"horizon": 1.5, "guess": 0.5, "limit": 1.0, "hessian": "exact"},
        "ur5": {"horizon": 1.0, "guess": 0.0},
    }
}
"""With which all objectives are met but the weighted one, which takes too many iterations."""

SHOOTING = Group("Shooting", effect="solve")
ONE_CONTROL = Group("One control")
WORLD = Group("World")


class SingleShootingParams(PlanParams):
    """What the user can turn."""

    pieces: float = SHOOTING.knob(20.0, 2.0, MAX_PIECES, "N", "", "Pieces", step=1.0, key=True)
    """How many pieces the control is held on: the variables; of the UR5 at most 12."""
    steps: float = SHOOTING.knob(
        2.0,
        1.0,
        MAX_STEPS,
        "M",
        "",
        "Steps a piece",
        step=1.0,
        key=True,
        when={"system": LIGHT_SYSTEMS},
    )
    """Steps of integration in each piece: the accuracy of x. Of the UR5 it is one."""
    integrator: str = SHOOTING.choice(
        "rk4",
        {name: method.title for name, method in SHOOTING_METHODS.items()},
        "Integrator",
        key=True,
    )
    """By which x follows from the controls."""
    form: str = SHOOTING.choice(
        "augmented",
        {"augmented": "With the state: (x, c)", "sum": "The notes' sum: l h"},
        "Running cost",
    )
    """How the integral of l is computed."""

    piece: float = ONE_CONTROL.knob(
        1.0, 1.0, MAX_PIECES, "k", "", "Changed piece", step=1.0, key=True
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
    guess: float = SOLVER.knob(0.1, -1.0, 1.0, "A", "u₀", "First guess", step=0.01)
    """Size of the controls guessed at first, u = u_ref + A u_0 cos(2 pi f_0 t)."""
    guess_rate: float = SOLVER.knob(0.0, 0.0, 2.0, "f_0", "Hz", "Its frequency", step=0.05)
    """Of the first guess; at 0 it is a constant push."""
    study: str = SOLVER.choice(
        "none",
        {
            "none": "Nothing",
            "gradients": "Gradients, three ways",
            "integration": "Errors, over M",
        },
        "Measure also",
        when={"system": LIGHT_SYSTEMS},
    )
    """What is measured besides: at the first guess the gradient, by sensitivities, adjoint and
    finite differences; of the solution the error of state and cost over M."""

    @property
    def N(self) -> int:
        return self.cap_pieces(self.pieces)

    @property
    def M(self) -> int:
        return self.cap_steps(self.steps)

    @property
    def studied(self) -> str:
        """What is measured besides."""
        return "none" if self.costly_derivatives else self.study

    @property
    def chosen_piece(self) -> int:
        """The piece whose control is changed, from 0."""
        return min(round(self.piece), self.N) - 1

    @property
    def shooting(self) -> SingleShooting:
        """The problem as a programme, with nothing computed yet."""
        return self.transcription(self.N, self.M, self.integrator)

    def transcription(
        self, N: int, M: int, integrator: str, form: CostForm | None = None
    ) -> SingleShooting:
        """The problem with other pieces, steps and methods."""
        chosen = next(known for known in COST_FORMS if known == self.form)
        return SingleShooting(self.problem, N, M, integrator, form or chosen)

    def first_guess(self, N: int) -> np.ndarray:
        """U (N, nu), within the limits."""
        t = (np.arange(N) + 0.5) * self.horizon / N
        wave = self.guess * np.cos(2.0 * np.pi * self.guess_rate * t)[:, None] * self.task.u_0
        U = self.task.holding + wave
        return np.asarray(U if self.bound is None else np.clip(U, -self.bound, self.bound))
