"""What a session can be told to do, by the HTTP API and by the page's WebSocket alike."""

from typing import Annotated, Literal

from pydantic import Field

from server.messages import Changes, FiniteFloat, Message, View
from server.session import Session


class Run(Message):
    """Let simulated time run."""

    command: Literal["run"]


class Pause(Message):
    """Hold simulated time."""

    command: Literal["pause"]


class Step(Message):
    """Pause, and advance by some of the lab's periods."""

    command: Literal["step"]
    count: Annotated[int, Field(ge=1, le=1000)] = 1


class Reset(Message):
    """Back to t = 0 with the present parameters."""

    command: Literal["reset"]


class Speed(Message):
    """Simulated seconds per second of the wall clock."""

    command: Literal["speed"]
    factor: Annotated[FiniteFloat, Field(ge=0.1, le=4.0)]


class Seed(Message):
    """A new seed; restarts."""

    command: Literal["seed"]
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)]


class Compare(Message):
    """A run made first, as fast as it goes and with the session's seed, to compare with."""

    params: Changes
    """As of `Apply`: all others have their defaults."""
    seconds: Annotated[FiniteFloat, Field(gt=0.0, le=120.0)]
    """How far it goes."""


class Apply(Message):
    """All parameters to their defaults but for `params` (a preset, an experiment, or none:
    the defaults); `restart` begins anew at t = 0, and runs. Speed and pace stay as they are
    unless given."""

    command: Literal["apply"]
    params: Changes = Field(default_factory=dict)
    restart: bool = True
    speed: Annotated[FiniteFloat, Field(ge=0.1, le=4.0)] | None = None
    """As of `Speed`."""
    pace: Annotated[FiniteFloat, Field(ge=0.0, le=1000.0)] | None = None
    """As of `SolverPace`."""
    hold: Annotated[FiniteFloat, Field(gt=0.0)] | None = None
    """[s] When this run pauses, once: a restart forgets it."""
    compare: Compare | None = None


class Press(Message):
    """Press one of the lab's actions."""

    command: Literal["press"]
    action: Annotated[str, Field(max_length=64)]


class SetView(Message):
    """Light or dark, high or low graphics."""

    command: Literal["view"]
    view: View


class ResetView(Message):
    """The camera of everybody back to where it has all in view, and follows again."""

    command: Literal["reset_view"]


class SolverRun(Message):
    """Let the solver run."""

    command: Literal["solver_run"]


class SolverPause(Message):
    """Hold the solver. The world runs on; and holding the world does not hold the solver."""

    command: Literal["solver_pause"]


class SolverStep(Message):
    """Pause the solver, and let it do some iterations."""

    command: Literal["solver_step"]
    count: Annotated[int, Field(ge=1, le=1000)] = 1


class SolverShow(Message):
    """Pause the solver, and look back at an iteration: the nearest kept one not after it."""

    command: Literal["solver_show"]
    iteration: Annotated[int, Field(ge=0, le=2**53)]


class SolverPace(Message):
    """Iterations per second at most; 0 for as many as go. It changes no result."""

    command: Literal["solver_pace"]
    pace: Annotated[FiniteFloat, Field(ge=0.0, le=1000.0)]


WorldCommand = Run | Pause | Step | Reset | Speed | Seed | Apply | Press | SetView | ResetView
SolverCommand = SolverRun | SolverPause | SolverStep | SolverShow | SolverPace
Command = Annotated[WorldCommand | SolverCommand, Field(discriminator="command")]


async def execute(session: Session, command: Command) -> None:
    """Does it. Raises LabError, Unavailable."""
    if isinstance(command, Press):
        session.entry.lab.check_action(command.action)
    await session.ask(command.command, **command.model_dump(exclude={"command"}))
