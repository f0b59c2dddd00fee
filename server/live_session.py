"""One live session's loop, which alone touches the world, the scene and the panel. Everything the
user does reaches it through the mailbox, and is read once a frame."""

import contextlib
import functools
import logging
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import viser

from labs.engine.catalog import find_lab
from labs.engine.headless import run_headless
from labs.engine.plot_data import PlotData
from labs.engine.run import World
from labs.engine.solution import Solution
from labs.errors import LabError
from server.broadcast import FRAME_PERIOD, Broadcast, SessionControls
from server.mailbox import Mailbox, WorkItem
from server.messages import ComparedRun, View
from server.pacing import Pacer
from server.panel import Panel
from server.pipe import CONTROL, STREAM, WorkerPipe
from server.solver_clock import SolverClock
from server.viser_scene import ViserScene

FRAME_BUDGET = 0.8 * FRAME_PERIOD
"""[s] What the world, and then the solver, may compute in a frame."""
COMPARED_ROWS = 600
"""Of a run compared with: about one a pixel of a plot."""

log = logging.getLogger("orclab.worker")


class LiveSession:
    """The session's loop. `opening` is what the web process keeps of a session: lab, params, seed,
    view, running, speed, and the solver's last status."""

    def __init__(
        self, link: WorkerPipe, mailbox: Mailbox, server: viser.ViserServer, opening: dict[str, Any]
    ) -> None:
        self.link, self.mailbox = link, mailbox
        self.world = World(find_lab(opening["lab"]), opening["params"], opening["seed"])
        self.controls = SessionControls(self.world, opening["running"], View(**opening["view"]))
        self.pacer = Pacer(self.world, opening["speed"])
        self.solver = SolverClock(self.world, opening["solver"])
        self.scene = ViserScene(server, mailbox, self.controls.view)
        self.panel = Panel(server, mailbox, self.world)
        self.broadcast = Broadcast(link, self.scene, self.controls, self.pacer, self.solver)

    def loop(self) -> None:
        """Mail, world, solver, viewers; for ever. Any other order would show a stale state."""
        while True:
            wake = self.broadcast.next_wake(time.perf_counter())
            for item in self.mailbox.take(wake - time.perf_counter()):
                self._dispatch(item)
            now = time.perf_counter()
            self.broadcast.record_lateness(now - wake)
            with self._catch_failures():
                if self.controls.time_advances:
                    self.pacer.advance(now, until=now + FRAME_BUDGET)
                    self._pause_if_due()
                if not self.controls.failure:
                    self.solver.iterate(now, until=now + FRAME_BUDGET)
            with self._catch_failures():
                self.broadcast.send_samples(now)
            with self._catch_failures():
                self.broadcast.draw(now)
            self.broadcast.send_due_status(now)

    # What the user does -----------------------------------------------------------------------

    def _dispatch(self, item: WorkItem) -> None:
        error = ""
        answer: Any = None
        try:
            if item.do.startswith("solver_"):
                self.solver.dispatch(item.do.removeprefix("solver_"), **item.arguments)
            else:
                answer = getattr(self, f"_do_{item.do}")(**item.arguments)
        except LabError as refused:
            error = str(refused)
            self.panel.show(self.world.params)  # puts a refused value back
        except Exception as broken:
            error = self._report_failure(broken)
        self.broadcast.request_update()
        if item.ref is not None:
            # The status goes first: who has the answer finds the session as it is now.
            self.broadcast.send_status(time.perf_counter())
            self.link.send(CONTROL, {"ref": item.ref, "answer": answer, "error": error})

    def _do_params(self, changes: dict[str, Any]) -> dict[str, Any]:
        runs = self.world.runs
        self.world.change(changes)
        self._on_change(restarted=self.world.runs != runs)
        return self.world.params.model_dump()

    def _do_apply(
        self,
        params: dict[str, Any],
        restart: bool,
        speed: float | None,
        pace: float | None,
        hold: float | None,
        compare: dict[str, Any] | None,
    ) -> dict[str, Any]:
        chosen = self.world.lab.Params().change(params)  # refused before the comparison is made
        compared = self._make_comparison(**compare) if compare else None
        answer = self._do_params(chosen.model_dump())
        if speed is not None:
            self._do_speed(speed)
        if pace is not None and self.world.lab.has_solver():
            self.solver.dispatch("pace", pace=pace)
        if restart:
            self._do_reset()
            self._do_run()
            if self.world.lab.has_solver():
                self.solver.dispatch("run")
        self.pacer.hold = hold
        if compared:
            self.link.send(STREAM, ComparedRun(self.world.runs, *compared))
        return answer

    def _make_comparison(
        self, params: dict[str, Any], seconds: float
    ) -> tuple[list[str], np.ndarray]:
        """Another world's run, which leaves this one's recording and events alone."""
        recorder = run_headless(
            self.world.entry.slug,
            params,
            seconds=seconds,
            seed=self.world.seed,
            progress=lambda part: self.broadcast.send_due_status(time.perf_counter()),
        ).recorder
        rows = recorder.since(0).astype("float32")
        return recorder.columns, rows[:: 1 + len(rows) // COMPARED_ROWS]

    def _pause_if_due(self) -> None:
        if self.pacer.is_hold_due():
            self.pacer.hold = None
            self._do_pause()
            self.broadcast.request_update()

    def _do_run(self) -> None:
        self.controls.running = True
        self.pacer.resync()

    def _do_pause(self) -> None:
        self.controls.running = False

    def _do_step(self, count: int) -> None:
        self.controls.running = False
        for _ in range(count):
            self.world.advance()

    def _do_reset(self) -> None:
        self._restart(self.world.seed)

    def _do_seed(self, seed: int) -> None:
        self._restart(seed)

    def _restart(self, seed: int) -> None:
        self.controls.failure = ""
        self.world.reset(seed)
        self._on_change(restarted=True)

    def _do_speed(self, factor: float) -> None:
        self.pacer.speed = factor
        self.pacer.resync()

    def _do_press(self, action: str) -> None:
        self.world.press(action)

    def _do_hold(self, handle: str, point: tuple[float, float, float] | None) -> None:
        runs = self.world.runs
        self.world.hold(handle, point)
        self._on_change(restarted=self.world.runs != runs)

    def _do_load(self, path: str) -> dict[str, Any]:
        """Takes up a saved solution; the solver waits then."""
        self.world.load(Solution.read(Path(path).read_bytes()))
        self.controls.failure = ""
        self.solver.dispatch("pause")
        self._on_change(restarted=True)
        return self.world.params.model_dump()

    def _do_view(self, view: dict[str, Any]) -> None:
        self.controls.view = View(**view)
        self.scene.set_view(self.controls.view)

    def _do_reset_view(self) -> None:
        self.scene.reset_view()

    def _do_viewers(self, count: int) -> None:
        if count > self.controls.viewers:
            self.broadcast.send_hello()
        self.controls.viewers = count

    def _do_command_line(self) -> str:
        return self.world.command()

    def _do_export(self, form: str, path: str, done: int) -> None:
        self._write_file(functools.partial(self.world.recording().write, form), path, done)

    def _do_solution(self, form: str, path: str, done: int) -> None:
        self._write_file(functools.partial(self.world.solution().write, form), path, done)

    def _do_plots(self, form: str, path: str, done: int, titles: list[str]) -> None:
        self._write_file(functools.partial(PlotData.of(self.world, titles).write, form), path, done)

    def _write_file(self, content: Callable[[], bytes], path: str, done: int) -> None:
        """Writes to `path`, on a thread of its own, and then answers `done`."""

        def write() -> None:
            try:
                Path(path).write_bytes(content())
                error = ""
            except LabError as refused:
                error = str(refused)
            except OSError as problem:
                error = f"the file could not be written: {problem}"
            self.link.send(CONTROL, {"ref": done, "answer": None, "error": error})

        threading.Thread(target=write, daemon=True).start()

    def _on_change(self, restarted: bool) -> None:
        self.panel.show(self.world.params)
        if restarted:
            self.pacer.hold = None
            self.pacer.resync()

    # When the lab itself breaks -----------------------------------------------------------------

    @contextlib.contextmanager
    def _catch_failures(self) -> Iterator[None]:
        """A defect of a lab stops its world, not its session."""
        try:
            yield
        except OSError:
            raise  # the pipe: the end of this process
        except Exception as error:
            self._report_failure(error)

    def _report_failure(self, error: Exception) -> str:
        log.exception("the lab failed")
        self.controls.failure = (
            f"The lab failed at t = {self.world.t:.2f} s ({type(error).__name__}: {error}). "
            "This is a defect of the lab, not of your settings. Reset starts again."
        )
        self.broadcast.request_update()
        return self.controls.failure
