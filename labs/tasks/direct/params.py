"""The tunables of a motion that is guessed, planned and played, in collocation, multiple shooting
and the race of direct methods."""

from labs.params import Group
from labs.tasks.direct.plan_params import SOLVER, PlanParams

GUESSES = {
    "line": "A straight line in x",
    "still": "To stay at the start",
    "controls": "Controls, integrated",
}

WORLD = Group("World")


class DirectParams(PlanParams):
    """The motion, its limits and weights, the solver, the first guess and the plant."""

    guess: str = SOLVER.choice("line", GUESSES, "First guess", key=True)
    """Of the motion: what the solver begins with."""
    guess_size: float = SOLVER.knob(
        0.1, -1.0, 1.0, "A", "u₀", "Its size", step=0.01, when={"guess": "controls"}
    )
    """Size of the controls guessed at first, u = u_ref + A u_0 cos(2 pi f_0 t)."""
    guess_rate: float = SOLVER.knob(
        0.0, 0.0, 2.0, "f_0", "Hz", "Its frequency", step=0.05, when={"guess": "controls"}
    )
    """Of the controls guessed at first; at 0 they are a constant push."""

    tracking: float = WORLD.knob(100.0, 1.0, 1e4, "w_{track}", "1/rad²", "Tracking", scale="log")
    """What a deviation from the plan costs the regulator that plays it, beside R = 1/u_0^2."""
    payload: float = WORLD.knob(0.0, 0.0, 3.0, "m_{load}", "kg", "Payload", step=0.01)
    """A point mass at the tip that the plan does not know of."""
