"""The tunables of multiple shooting, beside those of the motion."""

import numpy as np

from labs.algorithms.multiple_shooting import MultipleShooting
from labs.algorithms.shooting_steps import SHOOTING_METHODS
from labs.params import Group
from labs.tasks.direct.guesses import Guess
from labs.tasks.direct.params import DirectParams
from labs.tasks.direct.plan_params import LIGHT_SYSTEMS

MAX_PIECES, MAX_STEPS = 40, 4

SHOOTING = Group("Shooting", effect="solve")


class MultipleShootingParams(DirectParams):
    """What the user can turn."""

    segments: float = SHOOTING.knob(10.0, 1.0, MAX_PIECES, "m", "", "Segments", step=1.0, key=True)
    """How often the integration begins anew: 1 is single shooting; at most one a piece."""
    pieces: float = SHOOTING.knob(20.0, 2.0, MAX_PIECES, "N", "", "Pieces", step=1.0, key=True)
    """How many pieces the control is held on, split evenly among the segments."""
    steps: float = SHOOTING.knob(
        2.0, 1.0, MAX_STEPS, "M", "", "Steps a piece", step=1.0, when={"system": LIGHT_SYSTEMS}
    )
    """Steps of integration in each piece. They add no variables. Of the UR5 it is one."""
    integrator: str = SHOOTING.choice(
        "rk4", {name: method.title for name, method in SHOOTING_METHODS.items()}, "Integrator"
    )
    """By which the states of a segment follow from its start and its controls."""
    study: str = SHOOTING.choice(
        "none",
        {"none": "None", "segments": "Other numbers of segments"},
        "Compare",
        when={"system": LIGHT_SYSTEMS},
    )
    """What is solved besides: the same problem from the same guess with 1, 2, 4, ... segments."""

    @property
    def N(self) -> int:
        return round(self.pieces)

    @property
    def m(self) -> int:
        """Segments there are: no more than pieces."""
        return min(round(self.segments), self.N)

    @property
    def M(self) -> int:
        return self.cap_steps(self.steps)

    @property
    def compares(self) -> bool:
        return self.study == "segments" and not self.costly_derivatives

    def shooting(self, m: int) -> MultipleShooting:
        """The programme with m segments."""
        return MultipleShooting(self.problem, self.N, m, self.M, self.integrator)

    def resting_guess(self) -> Guess:
        """Where it starts, held there: what diverges from nowhere."""
        at = self.task
        X, U = np.tile(at.x0, (self.N + 1, 1)), np.tile(at.holding, (self.N, 1))
        return Guess(X, U, self.horizon)
