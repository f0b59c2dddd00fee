"""Messages on the wire, typed: the HTTP API, the page's stream, and the worker's pipe; what a
session can be told to do is in commands.py.

The API validates what comes in; numbers are finite, sizes bounded. Page and worker messages are
JSON objects with a `type`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from labs.params import Value

Changes = Annotated[dict[Annotated[str, Field(max_length=64)], Value], Field(max_length=100)]
LinkTexts = Annotated[dict[Annotated[str, Field(max_length=64)], str], Field(max_length=100)]
FiniteFloat = Annotated[float, Field(allow_inf_nan=False)]


class Message(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


# The HTTP API ------------------------------------------------------------------------------


class View(Message):
    """How a page wants its scene. It never changes what is simulated."""

    dark: bool = False
    graphics: Literal["high", "low"] = "high"


class NewSession(Message):
    lab: Annotated[str, Field(max_length=64)]
    params: Changes = {}
    link: LinkTexts = {}
    """Parameters and the seed as texts: what a page's address says. What it cannot mean is left
    out, with a remark; `params` count where both name one."""
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 0
    view: View = View()


class SessionInfo(Message):
    id: str
    lab: str
    params: dict[str, Value]
    seed: int
    state: Literal["starting", "live", "recovering", "failed"]
    scene: str
    """Path of the 3D scene, for an iframe."""
    stream: str
    """Path of the WebSocket that tells what happens."""
    remarks: list[str]
    """On each part of the link that could not hold as it was."""


class LabInfo(Message):
    slug: str
    title: str
    section: str
    summary: str
    chapter: str
    params: list[dict[str, Any]]
    presets: dict[str, dict[str, Value]]
    actions: list[str]


class ParamValues(Message):
    params: dict[str, Value]


class CommandLine(Message):
    command: str


class Health(Message):
    status: Literal["ok"]
    version: str
    sessions: int
    workers: int
    spares: int
    preparing: bool
    """Whether the first worker is still awaited, while all is loaded and compiled."""


class ErrorBody(Message):
    """What every refused request answers."""

    error: str
    """What was wrong, what is allowed, what to do: for people."""
    code: str
    """The kind of problem: for programs."""


# The page's stream (server to page) ----------------------------------------------------------


class Answer(Message):
    """To a request that came over the stream."""

    type: Literal["answer"] = "answer"
    ref: int
    """The request's own."""
    error: str = ""
    """Why it was refused, what is allowed; empty if it was done."""


class Hello(Message):
    """First on every stream, and again after a worker was replaced."""

    type: Literal["hello"] = "hello"
    worker: int
    """Which process speaks: another one has another scene."""
    columns: list[str]
    """Names of a telemetry row's entries: "t", then channels; a vector's are "q[0]", "q[1]"."""
    period: float


@dataclass(frozen=True)
class Telemetry:
    """New samples, 30 times a second at most. On the wire arrays are lists and NaN, such as a
    missing scalar, is null (server/pipe.py)."""

    run: int
    """Counts restarts: rows of another run are another curve."""
    rows: np.ndarray
    """(k, columns)."""
    now: np.ndarray | None = None
    """(columns,): the state as it is, where it changed since the last sample without time going
    on."""
    fields: Mapping[str, np.ndarray | str | tuple[str, ...]] | None = None
    """Arrays for curves, heat maps, matrices and bars, notes and labels, a few times a second."""
    type: Literal["telemetry"] = "telemetry"


@dataclass(frozen=True)
class ComparedRun:
    """The run that an experiment compares with, made before its own."""

    run: int
    """The run that it stands beside."""
    columns: list[str]
    rows: np.ndarray
    """(k, columns), as many as a plot can show."""
    type: Literal["compared"] = "compared"


class SolverStatus(Message):
    """How the solver stands."""

    iteration: int
    """What is shown; 0 before the first."""
    latest: int
    """How far the solver has come."""
    kept: tuple[int, int] | None
    """The first and the last iteration one can look at; null before the first."""
    running: bool
    """Whether it may run. One that is done has nothing left to do."""
    pace: float
    """Iterations per second at most; 0: as many as go."""
    done: str
    """Why it stopped, in a sentence; empty while it has iterations left."""
    progress: float | None
    """The part done, in [0, 1], where it is known."""
    seconds_left: float | None
    """Wall-clock time it will still run, as far as its progress tells."""


class Status(Message):
    """The state of the session; sent when it changes, and twice a second."""

    type: Literal["status"] = "status"
    run: int
    t: float
    params: dict[str, Value]
    seed: int
    running: bool
    speed: float
    real_time_factor: float
    """Simulated seconds per second of the wall clock, over the last second."""
    step_seconds: float
    """Wall-clock time one step of the world took, on average over the last second."""
    capped: bool
    """The machine is too slow for the chosen speed: simulated time slows down."""
    trouble: str
    """Why the world stopped, in a sentence; empty while all is well."""
    solver: SolverStatus | None
    """Null where there is none."""
    view: View


class Notice(Message):
    """Something happened that the page should say."""

    type: Literal["notice"] = "notice"
    state: Literal["live", "recovering", "failed", "ended"]
    text: str
