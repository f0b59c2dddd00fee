"""One live session: a process with one loop, which alone touches the world, the scene and the
panel. Everything the user does reaches it through the mailbox, and is read once a frame.

Simulated time follows the wall clock at the chosen speed. When the machine is too slow it falls
behind, and says so; what is computed never depends on the wall clock."""

import contextlib
import functools
import logging
import os
import signal
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import viser

from labs.engine.catalog import find
from labs.engine.run import World
from labs.engine.solution import Solution
from labs.errors import LabError
from labs.plots import pictured
from server.mailbox import Item, Mailbox
from server.messages import Hello, Status, Telemetry, View
from server.panel import Panel
from server.pipe import CONTROL, HELLO, STATUS, STREAM, Link
from server.process import die_with_parent, viser_server
from server.solver_clock import SolverClock
from server.viser_scene import ViserScene

FRAME = 1 / 60
"""[s] The loop's beat, and the scene's; on a machine that is late, the scene's is twice that."""
LATE = 0.001
"""[s] Waking up later than this, on average, means that the machine is busy."""
TELEMETRY = 1 / 30
FIELDS = 1 / 5
STATUS_EVERY = 0.5
SOLVER_EVERY = 0.1
"""[s] As long as the solver comes on, its status is told as often."""
SLIP = 0.2
"""[s] Wall-clock time the simulation may lag and still catch up; what is beyond is given up."""

log = logging.getLogger("orclab.worker")


def main(sock: socket.socket) -> None:
    """Runs until the web process closes the pipe."""
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    link, mailbox = Link(sock), Mailbox()
    threading.Thread(target=_listen, args=(link, mailbox), daemon=True).start()
    server = viser_server()
    try:
        link.send(CONTROL, {"ready": True, "port": server.get_port()})
        opening = _wait_for_opening(link, mailbox)
        Live(link, mailbox, server, opening).loop()
    except OSError:
        os._exit(0)  # The web process is gone: nobody is left to tell.


class Live:
    """The session's loop."""

    def __init__(
        self, link: Link, mailbox: Mailbox, server: viser.ViserServer, opening: dict[str, Any]
    ) -> None:
        self.link, self.mailbox, self.server = link, mailbox, server
        self.world = World(find(opening["lab"]), opening["params"], opening["seed"])
        self.view = View(**opening["view"])
        self.running: bool = opening["running"]
        self.speed: float = opening["speed"]
        self.viewers = 0
        self.failure = ""
        self._fields = sorted({name for plot in self.world.lab.plots for name in pictured(plot)})
        self.solver = SolverClock(self.world, opening["solver"])
        self.scene = ViserScene(server, mailbox, self.view)
        self.panel = Panel(server, mailbox, self.world)
        self._sent_run = 0
        self._sent_rows = 0
        self._measured: tuple[Any, Any] = (self.world.state, self.world.params)
        self._due = dict.fromkeys(("scene", "telemetry", "fields", "status"), 0.0)
        self._pace: deque[tuple[float, float]] = deque(maxlen=4)
        self._urgent = False
        self._lateness = 0.0
        self._told, self._told_of = 0.0, self.world.shown
        self._anchor()

    def loop(self) -> None:
        """Mail, world, solver, viewers; for ever. Any other order would show a stale state."""
        while True:
            wake = self._next_wake(time.perf_counter())
            for item in self.mailbox.take(wake - time.perf_counter()):
                self._obey(item)
            now = time.perf_counter()
            self._lateness += 0.02 * (max(0.0, now - wake) - self._lateness)
            with self._guard():
                self._advance(now)
                self._iterate(now)
            self._tell(now)

    # What the user does -----------------------------------------------------------------------

    def _obey(self, item: Item) -> None:
        error = ""
        answer: Any = None
        try:
            if item.do.startswith("solver_"):
                self.solver.obey(item.do.removeprefix("solver_"), **item.arguments)
            else:
                answer = getattr(self, f"_do_{item.do}")(**item.arguments)
        except LabError as refused:
            error = str(refused)
            self.panel.show(self.world.params)  # puts a refused value back
        except Exception as broken:
            error = self._fail(broken)
        if item.ref is not None:
            # The status goes first: who has the answer finds the session as it is now.
            self._status(time.perf_counter())
            self.link.send(CONTROL, {"ref": item.ref, "answer": answer, "error": error})
        self._urgent = True
        self._due["status"] = 0.0

    def _do_params(self, changes: dict[str, Any]) -> dict[str, Any]:
        runs = self.world.runs
        self.world.change(changes)
        self._changed(restarted=self.world.runs != runs)
        return self.world.params.model_dump()

    def _do_apply(self, params: dict[str, Any], restart: bool) -> dict[str, Any]:
        defaults = self.world.lab.Params().model_dump()
        answer = self._do_params(defaults | params)
        if restart:
            self._do_reset()
            self._do_run()
            if self.world.lab.has_solver():
                self.solver.obey("run")
        return answer

    def _do_run(self) -> None:
        self.running = True
        self._anchor()

    def _do_pause(self) -> None:
        self.running = False

    def _do_step(self, count: int) -> None:
        self.running = False
        for _ in range(count):
            self.world.advance()

    def _do_reset(self) -> None:
        self.failure = ""
        self.world.reset()
        self._changed(restarted=True)

    def _do_speed(self, factor: float) -> None:
        self.speed = factor
        self._anchor()

    def _do_seed(self, seed: int) -> None:
        self.world.seed = seed
        self._do_reset()

    def _do_press(self, action: str) -> None:
        self.world.press(action)

    def _do_hold(self, handle: str, point: tuple[float, float, float] | None) -> None:
        runs = self.world.runs
        self.world.hold(handle, point)
        self._changed(restarted=self.world.runs != runs)

    def _do_load(self, path: str) -> dict[str, Any]:
        """Takes up a saved solution; the solver waits then."""
        self.world.load(Solution.read(Path(path).read_bytes()))
        self.failure = ""
        self.solver.obey("pause")
        self._changed(restarted=True)
        return self.world.params.model_dump()

    def _do_view(self, view: dict[str, Any]) -> None:
        self.view = View(**view)
        self.scene.set_view(self.view)

    def _do_viewers(self, count: int) -> None:
        if count > self.viewers:
            self._hello()
        self.viewers = count

    def _do_command_line(self) -> str:
        return self.world.command()

    def _do_export(self, form: str, path: str, done: int) -> None:
        self._write(functools.partial(self.world.recording().write, form), path, done)

    def _do_solution(self, form: str, path: str, done: int) -> None:
        self._write(functools.partial(self.world.solution().write, form), path, done)

    def _write(self, content: Callable[[], bytes], path: str, done: int) -> None:
        """Writes to `path`, on a thread of its own, and then answers `done`."""

        def write() -> None:
            try:
                Path(path).write_bytes(content())
                error = ""
            except OSError as problem:
                error = f"the file could not be written: {problem}"
            self.link.send(CONTROL, {"ref": done, "answer": None, "error": error})

        threading.Thread(target=write, daemon=True).start()

    def _changed(self, restarted: bool) -> None:
        self.panel.show(self.world.params)
        if restarted:
            self._anchor()

    # The world ----------------------------------------------------------------------------------

    @property
    def _moving(self) -> bool:
        return (
            self.running
            and self.world.lab.has_world()
            and not self.world.trouble
            and not self.failure
        )

    def _anchor(self) -> None:
        """Simulated time follows the wall clock from here on."""
        self._wall0, self._steps0 = time.perf_counter(), self.world.steps
        self._pace.clear()
        self._spent, self._taken = 0.0, 0  # [s] of the wall clock, steps

    def _steps_due(self, now: float) -> float:
        elapsed = (now - self._wall0) * self.speed
        return elapsed / self.world.lab.period - (self.world.steps - self._steps0)

    def _next_wake(self, now: float) -> float:
        """The next frame; after a change already the next step, so that its effect shows soon."""
        frame = min(self._due["scene"], self._due["status"])
        if self._urgent and self._moving:
            missing = max(0.0, 1.0 - self._steps_due(now))
            frame = min(frame, now + missing * self.world.lab.period / self.speed)
        return max(frame, now)

    def _advance(self, now: float) -> None:
        if not self._moving:
            return
        due = int(self._steps_due(now))
        steps = self.world.steps
        for _ in range(due):
            if self.world.trouble or time.perf_counter() - now > 0.8 * FRAME:
                break
            self.world.advance()
        self._spent += time.perf_counter() - now
        self._taken += self.world.steps - steps
        lag = self._steps_due(now) * self.world.lab.period / self.speed
        if lag > SLIP:
            self._wall0 += lag - SLIP

    def _iterate(self, now: float) -> None:
        if not self.failure:
            self.solver.iterate(now, until=now + 0.8 * FRAME)

    # The viewers --------------------------------------------------------------------------------

    def _tell(self, now: float) -> None:
        if self.world.runs != self._sent_run:
            self._sent_run, self._sent_rows = self.world.runs, 0
            self._urgent = True
            self._hello()
        fresh = self.world.recorder.count > self._sent_rows or not self._moving
        if self._urgent and fresh:
            # What was changed shows now, not at the next beat.
            self._due["telemetry"] = self._due["fields"] = self._due["scene"] = 0.0
            self._urgent = False
        if self._beat("telemetry", now, TELEMETRY):
            with self._guard():
                self._telemetry(now)
        frame = FRAME if self._lateness < LATE else 2 * FRAME
        if self._beat("scene", now, frame) and not self.failure:
            with self._guard():
                self.scene.draw(self.world)
        if self.world.shown is not self._told_of:
            self._due["status"] = min(self._due["status"], self._told + SOLVER_EVERY)
        if self._beat("status", now, STATUS_EVERY):
            self._status(now)

    def _beat(self, what: str, now: float, every: float) -> bool:
        if now < self._due[what]:
            return False
        self._due[what] = max(self._due[what] + every, now + every / 2)
        return True

    def _hello(self) -> None:
        columns = self.world.recorder.columns
        hello = Hello(worker=os.getpid(), columns=columns, period=self.world.lab.period)
        self.link.send(HELLO, hello.model_dump())

    def _telemetry(self, now: float) -> None:
        rows = self.world.recorder.since(self._sent_rows)
        self._sent_rows = self.world.recorder.count
        fields = None
        wanted = self.viewers and self._fields and not self.failure
        if wanted and self._beat("fields", now, FIELDS):
            lab, params, state = self.world.lab, self.world.params, self.world.state
            found = {**lab.fields(params, state), **lab.notes(params, state)}
            fields = {name: found[name] for name in self._fields if name in found}
        now_row = None if len(rows) else self._unrecorded()
        if len(rows):
            self._measured = self.world.state, self.world.params
        if self.viewers and (len(rows) or fields or now_row is not None):
            message = Telemetry.model_construct(type="telemetry", run=self.world.runs, rows=rows)
            # float32 halves the text; a plot has no use for more digits.
            self.link.send(
                STREAM,
                vars(message) | {"rows": rows.astype("float32"), "fields": fields, "now": now_row},
            )

    def _unrecorded(self) -> np.ndarray | None:
        """What a solver or a parameter has changed while the world stands still; once."""
        state, params = self.world.state, self.world.params
        known = state is self._measured[0] and params is self._measured[1]
        if known or not self.viewers or self.failure:
            return None
        self._measured = state, params
        measured = self.world.lab.measure(self.world.params, self.world.state)
        return self.world.recorder.row(self.world.t, measured).astype("float32")

    def _status(self, now: float) -> None:
        if not self._pace or now - self._pace[-1][0] > 0.9 * STATUS_EVERY:
            self._pace.append((now, self.world.t))
        (w0, t0), (w1, t1) = self._pace[0], self._pace[-1]
        factor = (t1 - t0) / (w1 - w0) if w1 > w0 else self.speed
        measuring = self._moving and w1 - w0 >= 2 * STATUS_EVERY
        status = Status(
            run=self.world.runs,
            t=self.world.t,
            params=self.world.params.model_dump(),
            seed=self.world.seed,
            running=self.running,
            speed=self.speed,
            real_time_factor=factor if measuring else (self.speed if self._moving else 0.0),
            step_seconds=self._spent / self._taken if self._taken else 0.0,
            capped=measuring and factor < 0.95 * self.speed,
            trouble=self.failure or self.world.trouble,
            solver=self.solver.status(),
            view=self.view,
        )
        self.link.send(STATUS, status.model_dump())
        self._told, self._told_of = now, self.world.shown
        self._spent, self._taken = 0.0, 0

    # When the lab itself breaks -----------------------------------------------------------------

    @contextlib.contextmanager
    def _guard(self) -> Iterator[None]:
        """A defect of a lab stops its world, not its session."""
        try:
            yield
        except OSError:
            raise  # the pipe: the end of this process
        except Exception as error:
            self._fail(error)

    def _fail(self, error: Exception) -> str:
        log.exception("the lab failed")
        self.failure = (
            f"The lab failed at t = {self.world.t:.2f} s ({type(error).__name__}: {error}). "
            "This is a defect of the lab, not of your settings. Reset starts again."
        )
        self._due["status"] = 0.0
        return self.failure


def _listen(link: Link, mailbox: Mailbox) -> None:
    while (message := link.receive()) is not None:
        mailbox.put(message["do"], message.get("ref"), **message.get("with", {}))
    # The web process is gone or wants us gone; the loop may be hung, so do not ask it.
    os._exit(0)


def _wait_for_opening(link: Link, mailbox: Mailbox) -> dict[str, Any]:
    while not (items := mailbox.take(STATUS_EVERY)):
        link.send(CONTROL, {"idle": True})
    opening = items[0]
    for item in items[1:]:
        mailbox.put(item.do, item.ref, **item.arguments)
    return opening.arguments
