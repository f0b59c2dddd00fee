"""The solver's clock of a live session: when it iterates. What it finds never depends on that."""

import time
from collections.abc import Mapping
from typing import Any

from labs.engine.run import World
from labs.errors import LabError
from server.messages import SolverStatus

MAX_PENDING = 1000
MAX_LAG = 0.2
"""[s] It may lag behind its pace and still catch up; what is beyond is given up."""
ESTIMATE_AFTER = 0.5
"""[s] of its own time, before which nobody can tell how long it will take."""


class SolverClock:
    """Runs, holds and steps a world's solver, and looks back at what it found."""

    def __init__(self, world: World, status: Mapping[str, Any] | None) -> None:
        """`status`: the last one of the session's solver, if it had one."""
        self._world = world
        self.running: bool = status["running"] if status else True
        self.pace: float = status["pace"] if status else 0.0
        self._pending = 0
        """Iterations to do although paused."""
        self._mid_iteration = False
        """Whether an iteration has begun and not ended."""
        self._next = 0.0
        """When the next one is due [s, wall clock]."""
        self._on_restart(0.0)

    def _detect_restart(self, now: float) -> None:
        if self._world.solves != self._solves:
            self._on_restart(now)

    def _on_restart(self, now: float) -> None:
        """The solver was started anew."""
        self._solves = self._world.solves
        self._pending = 0
        self._mid_iteration = False
        self._next = 0.0
        self._active = False
        self._last = now
        self._spent = 0.0
        """[s] of the wall clock, since it was started and while it ran."""
        self._before = self._progress()

    def dispatch(self, do: str, **arguments: Any) -> None:
        """Runs, pauses, steps, shows or sets the pace. Raises LabError."""
        if not self._world.lab.has_solver():
            raise LabError("this lab has no solver")
        self._detect_restart(time.perf_counter())
        getattr(self, f"_do_{do}")(**arguments)

    def _do_run(self) -> None:
        """Goes on from the latest iteration, wherever one looked back to."""
        self.running, self._pending = True, 0
        if self._world.latest and not self._world.solving:
            self._world.show(self._world.latest.iteration)

    def _do_pause(self) -> None:
        self.running = self._active = False
        self._pending = 0

    def _do_step(self, count: int) -> None:
        self.running = False
        self._pending = min(self._pending + count, MAX_PENDING)

    def _do_show(self, iteration: int) -> None:
        self._do_pause()
        self._world.show(iteration)

    def _do_pace(self, pace: float) -> None:
        self.pace, self._next = pace, 0.0

    def iterate(self, now: float, until: float) -> None:
        """What is due: one piece of an iteration at least, and none begins after `until`."""
        world = self._world
        self._detect_restart(now)
        if self._active:
            self._spent += now - self._last
        self._last = now
        self._active = world.solving and (self.running or self._pending > 0)
        while world.solving and (self._pending or self._is_due(now)):
            self._mid_iteration = not world.iterate_piece()
            if self._pending and not self._mid_iteration:
                self._pending -= 1
            if time.perf_counter() > until:
                break

    def status(self) -> SolverStatus | None:
        """How it stands; None where there is no solver."""
        world = self._world
        if not world.lab.has_solver():
            return None
        first, latest = world.snapshots.first, world.latest
        return SolverStatus(
            iteration=world.shown.iteration if world.shown else 0,
            latest=latest.iteration if latest else 0,
            kept=(first.iteration, latest.iteration) if first and latest else None,
            running=self.running,
            pace=self.pace,
            done=latest.done if latest else "",
            progress=latest.progress if latest else None,
            seconds_left=self._seconds_left(),
        )

    def _is_due(self, now: float) -> bool:
        if not self.running or self._mid_iteration:
            return self.running
        if self.pace:
            if now < self._next:
                return False
            self._next = max(self._next, now - MAX_LAG) + 1.0 / self.pace
        return True

    def _progress(self) -> float:
        latest = self._world.latest
        return (latest.progress or 0.0) if latest else 0.0

    def _seconds_left(self) -> float | None:
        made = self._progress() - self._before
        if not self._world.solving or made <= 0.0 or self._spent < ESTIMATE_AFTER:
            return None
        return self._spent * (1.0 - self._progress()) / made
