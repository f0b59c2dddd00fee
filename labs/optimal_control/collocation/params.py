"""The tunables of the transcription, beside those of the problem."""

from labs.algorithms.collocation import Collocation
from labs.algorithms.collocation_schemes import SCHEMES
from labs.params import Group
from labs.tasks.direct.params import DirectParams

MAX_STEPS = 60

TRANSCRIPTION = Group("Collocation", effect="solve")


class CollocationParams(DirectParams):
    """What the user can turn."""

    steps: float = TRANSCRIPTION.knob(30.0, 4.0, MAX_STEPS, "N", "", "Steps", step=1.0, key=True)
    """Of the grid: as many pieces of the motion, and of defects."""
    scheme: str = TRANSCRIPTION.choice(
        "midpoint", {name: scheme.title for name, scheme in SCHEMES.items()}, "Rule", key=True
    )
    """What a step must obey: the notes' midpoint rule, or one of two beyond the notes."""
    study: str = TRANSCRIPTION.choice(
        "none",
        {
            "none": "Nothing",
            "order": "Error, over N",
            "sizes": "Dense and sparse, over N",
        },
        "Measure also",
    )
    """What is measured besides, once there is a solution: the error of the three rules, or what a
    Newton step costs with full matrices and with sparse ones."""

    @property
    def N(self) -> int:
        return round(self.steps)

    @property
    def program(self) -> Collocation:
        """The problem as a programme, with nothing computed yet."""
        return self.transcription(self.N, self.scheme)

    def transcription(self, N: int, scheme: str) -> Collocation:
        """The problem on another grid, by another rule."""
        return Collocation(self.problem, N, scheme)
