"""The tunables of the race, beside those of the motion."""

from labs.optimal_control.direct_methods.methods import TRANSCRIPTIONS
from labs.params import Group
from labs.tasks.direct.params import WORLD, DirectParams
from labs.tasks.direct.plan_params import LIGHT_SYSTEMS

MAX_PIECES, MAX_STEPS = 40, 4
VIEWS = {"plans": "The three plans", "played": "One plan, played"}

TRANSCRIPTION = Group("Transcription", effect="solve")
SCENE = Group("Scene")


class DirectMethodsParams(DirectParams):
    """What the user can turn."""

    view: str = SCENE.choice("plans", VIEWS, "Show", key=True)
    """The three motions as they are planned, side by side; or one of them on the simulator."""
    played: str = WORLD.choice("collocation", TRANSCRIPTIONS, "Play", key=True)
    """Whose plan the simulator plays: alone (open loop), and with a regulator about it."""

    pieces: float = TRANSCRIPTION.knob(20.0, 4.0, MAX_PIECES, "N", "", "Pieces", step=1.0, key=True)
    """How many pieces the control is held on, in all three; of the UR5 at most 12. They are the
    steps of collocation, too."""
    segments: float = TRANSCRIPTION.knob(
        5.0, 2.0, MAX_PIECES, "m", "", "Segments", step=1.0, key=True
    )
    """Of multiple shooting: how often its integration begins anew; at most once a piece."""
    steps: float = TRANSCRIPTION.knob(
        2.0, 1.0, MAX_STEPS, "M", "", "Steps a piece", step=1.0, when={"system": LIGHT_SYSTEMS}
    )
    """Steps of Runge-Kutta 4 in each piece, in both kinds of shooting. Of the UR5 it is one."""

    @property
    def N(self) -> int:
        return self.cap_pieces(self.pieces)

    @property
    def m(self) -> int:
        """Segments there are: no more than pieces."""
        return min(round(self.segments), self.N)

    @property
    def M(self) -> int:
        return self.cap_steps(self.steps)
