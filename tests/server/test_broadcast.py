"""When what a live session has to tell is sent."""

from typing import Any, cast

from labs.engine.catalog import find_lab
from labs.engine.run import World
from server.broadcast import STATUS_EVERY, TELEMETRY_PERIOD, Broadcast, SessionControls
from server.messages import Telemetry, View
from server.pacing import Pacer
from server.pipe import STATUS, STREAM, WorkerPipe
from server.solver_clock import SolverClock
from server.viser_scene import ViserScene


class RecordingPipe:
    """A link that keeps what goes through it."""

    def __init__(self) -> None:
        self.messages: list[tuple[int, Any]] = []

    def send(self, kind: int, message: Any) -> None:
        self.messages.append((kind, message))

    def take(self, kind: int) -> list[Any]:
        found = [message for sent, message in self.messages if sent == kind]
        self.messages.clear()
        return found


def broadcast_of(world: World) -> tuple[Broadcast, RecordingPipe]:
    sent, solver = RecordingPipe(), SolverClock(world, None)
    controls = SessionControls(world, running=True, view=View(), viewers=1)
    link, scene = cast(WorkerPipe, sent), cast(ViserScene, None)
    return Broadcast(link, scene, controls, Pacer(world, 1.0), solver), sent


def test_a_change_is_shown_by_the_first_step_that_knows_it() -> None:
    world = World(find_lab("joint-control"), {"reference": "set-point", "amplitude": 0.2})
    column = world.recorder.columns.index("q_ref[0]")
    broadcast, sent = broadcast_of(world)
    now = 100.0
    world.advance()
    broadcast.send_samples(now)
    assert sent.take(STREAM)
    world.advance()  # a row that is not due yet, and knows nothing of the change
    world.change({"amplitude": 0.5})
    broadcast.request_update()
    broadcast.send_samples(now + 0.1 * TELEMETRY_PERIOD)
    assert not sent.take(STREAM)
    world.advance()
    broadcast.send_samples(now + 0.2 * TELEMETRY_PERIOD)
    (telemetry,) = sent.take(STREAM)
    assert isinstance(telemetry, Telemetry)
    assert len(telemetry.rows) == 2
    assert telemetry.rows[1][column] - telemetry.rows[0][column] > 0.25


def test_a_status_that_was_sent_is_not_due_again() -> None:
    world = World(find_lab("joint-control"))
    broadcast, sent = broadcast_of(world)
    now = 100.0
    broadcast.request_update()
    broadcast.send_status(now)
    assert len(sent.take(STATUS)) == 1
    broadcast.send_due_status(now + 0.001)
    assert not sent.take(STATUS)
    broadcast.send_due_status(now + STATUS_EVERY)
    assert len(sent.take(STATUS)) == 1
