"""What a live session sends to its viewers, each kind at its own rate: the scene, samples of the
measured channels and fields, and the status."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from labs.engine.plot_data import named_values
from labs.engine.run import World
from labs.plots import field_names, label_names
from server.messages import Hello, Status, Telemetry, View
from server.pacing import MEASURE_EVERY, Pacer
from server.pipe import HELLO, STATUS, STREAM, WorkerPipe
from server.solver_clock import SolverClock
from server.viser_scene import ViserScene

FRAME_PERIOD = 1 / 60
"""[s] The loop's beat, and the scene's; on a machine that is late, the scene's is twice that."""
LATE_THRESHOLD = 0.001
"""[s] Waking up later than this, on average, means that the machine is busy."""
TELEMETRY_PERIOD = 1 / 30
FIELDS_PERIOD = 1 / 5
STATUS_EVERY = MEASURE_EVERY
SOLVER_EVERY = 0.1
"""[s] As long as the solver comes on, its status is sent as often."""


@dataclass
class SessionControls:
    """What the user has chosen besides the world's parameters, and who watches."""

    world: World
    running: bool
    view: View
    viewers: int = 0
    failure: str = ""
    """A defect of the lab, in a sentence; empty while there is none."""

    @property
    def time_advances(self) -> bool:
        """Whether simulated time goes on."""
        stopped = self.world.trouble or self.failure
        return self.running and self.world.lab.has_world() and not stopped


class Broadcast:
    """Sends what is due."""

    def __init__(
        self,
        link: WorkerPipe,
        scene: ViserScene,
        controls: SessionControls,
        pacer: Pacer,
        solver: SolverClock,
    ) -> None:
        self._link, self._scene, self._controls = link, scene, controls
        self._pacer, self._solver = pacer, solver
        self._world = world = controls.world
        shown = (field_names(plot) + label_names(plot) for plot in world.lab.plots)
        self._fields = sorted({name for names in shown for name in names})
        self._due = dict.fromkeys(("scene", "telemetry", "fields", "status"), 0.0)
        self._sent_run = 0
        self._sent_rows = 0
        self._measured: tuple[Any, Any] = (world.state, world.params)
        """State and parameters of the last row that was sent."""
        self._status_sent, self._status_shown = 0.0, world.shown
        self._urgent = False
        self._rows_before = 0
        """Rows recorded when something was changed: later ones show its effect."""
        self._lateness = 0.0

    def request_update(self) -> None:
        """Something was changed: its effect is due now, not at the next beat."""
        self._urgent = True
        self._rows_before = self._world.recorder.count
        self._due["status"] = 0.0

    def next_wake(self, now: float) -> float:
        """The next frame; after a change already the next step, so that its effect shows soon."""
        frame = min(self._due["scene"], self._due["status"])
        if self._urgent and self._controls.time_advances:
            frame = min(frame, self._pacer.next_step_time(now))
        return max(frame, now)

    def record_lateness(self, late: float) -> None:
        """The loop woke up so many seconds after it had wished to."""
        self._lateness += 0.02 * (max(0.0, late) - self._lateness)

    def send_samples(self, now: float) -> None:
        """A greeting where a run began, and new samples if they are due."""
        if self._world.runs != self._sent_run:
            self._sent_run, self._sent_rows = self._world.runs, 0
            self._urgent, self._rows_before = True, 0
            self.send_hello()
        fresh = self._world.recorder.count > self._rows_before or not self._controls.time_advances
        if self._urgent and fresh:
            self._due["telemetry"] = self._due["fields"] = self._due["scene"] = 0.0
            self._urgent = False
        if self._is_due("telemetry", now, TELEMETRY_PERIOD):
            self._send_telemetry(now)

    def draw(self, now: float) -> None:
        """The scene, if it is due."""
        frame = FRAME_PERIOD if self._lateness < LATE_THRESHOLD else 2 * FRAME_PERIOD
        if self._is_due("scene", now, frame) and not self._controls.failure:
            self._scene.draw(self._world)

    def send_due_status(self, now: float) -> None:
        """The status, twice a second and when the solver has come on."""
        if self._world.shown is not self._status_shown:
            self._due["status"] = min(self._due["status"], self._status_sent + SOLVER_EVERY)
        if now >= self._due["status"]:
            self.send_status(now)

    def send_hello(self) -> None:
        """What a viewer has to know before the first sample."""
        columns = self._world.recorder.columns
        hello = Hello(worker=os.getpid(), columns=columns, period=self._world.lab.period)
        self._link.send(HELLO, hello.model_dump())

    def send_status(self, now: float) -> None:
        """The state of the session as it is."""
        world, controls, speed = self._world, self._controls, self._pacer.speed
        measured = self._pacer.real_time_factor(now) if controls.time_advances else 0.0
        status = Status(
            run=world.runs,
            t=world.t,
            params=world.params.model_dump(),
            seed=world.seed,
            running=controls.running,
            speed=speed,
            real_time_factor=speed if measured is None else measured,
            step_seconds=self._pacer.pop_step_seconds(),
            capped=controls.time_advances and measured is not None and measured < 0.95 * speed,
            trouble=controls.failure or world.trouble,
            solver=self._solver.status(),
            view=controls.view,
        )
        self._link.send(STATUS, status.model_dump())
        self._status_sent, self._status_shown = now, world.shown
        self._due["status"] = now + STATUS_EVERY

    def _is_due(self, what: str, now: float, every: float) -> bool:
        if now < self._due[what]:
            return False
        self._due[what] = max(self._due[what] + every, now + every / 2)
        return True

    def _send_telemetry(self, now: float) -> None:
        world, controls = self._world, self._controls
        rows = world.recorder.since(self._sent_rows)
        self._sent_rows = world.recorder.count
        fields = None
        wanted = controls.viewers and self._fields and not controls.failure
        if wanted and self._is_due("fields", now, FIELDS_PERIOD):
            known = named_values(world)
            fields = {name: known[name] for name in self._fields if name in known}
        if len(rows) and controls.time_advances:
            self._measured = world.state, world.params
        # A world that has come to a halt was perhaps changed after its last row.
        now_row = self._current_row()
        if controls.viewers and (len(rows) or fields or now_row is not None):
            # float32 halves the text; a plot has no use for more digits.
            sample = Telemetry(world.runs, rows.astype("float32"), now_row, fields)
            self._link.send(STREAM, sample)

    def _current_row(self) -> np.ndarray | None:
        """What a solver or a parameter has changed while the world stands still; once."""
        world, controls = self._world, self._controls
        known = world.state is self._measured[0] and world.params is self._measured[1]
        if known or not controls.viewers or controls.failure:
            return None
        self._measured = world.state, world.params
        measured = world.lab.measure(world.params, world.state)
        return world.recorder.row(world.t, measured).astype("float32")
