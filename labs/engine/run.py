"""One run of a lab: the deterministic core that live sessions and headless runs share.

A run is fixed by the lab, the parameters at t = 0, the seed, and the events: what was changed,
pressed or dragged, and before which step. Wall-clock time appears nowhere.
"""

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import islice

import numpy as np

from labs.engine.catalog import CatalogEntry
from labs.engine.events import Event, Point, format_event, format_value
from labs.engine.record import LIVE_ROWS, Recorder, Recording, versions
from labs.engine.snapshots import Snapshots
from labs.engine.solution import Solution
from labs.errors import LabError, ParameterError
from labs.lab import Inputs, Snapshot
from labs.plots import channel_names
from labs.scene import NullScene

MAX_EVENTS = 20_000


class World:
    """A lab in motion."""

    shown: Snapshot | None
    """What the state holds of the solver; None until there is something."""
    _solver: Iterator[Snapshot | None] | None

    def __init__(
        self,
        entry: CatalogEntry,
        changes: Mapping[str, object] | None = None,
        seed: int = 0,
        capacity: int = LIVE_ROWS,
        solution: Solution | None = None,
    ) -> None:
        """With a `solution`, its parameters and seed hold, and it is taken in at t = 0."""
        self.entry = entry
        self.lab = entry.lab
        self.params = self.lab.Params().change(changes or {})
        self.seed = seed
        self._capacity = capacity
        self.runs = 0
        """Counts restarts."""
        self.solves = 0
        """Counts how often the solver was started."""
        if solution:
            self.load(solution)
        else:
            self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Back to t = 0 with the present parameters, and another seed if one is given; recording
        and events begin anew."""
        self.seed = self.seed if seed is None else seed
        self._begin(None, None)

    def load(self, solution: Solution) -> None:
        """Begins anew with the parameters and the seed of a solution that was saved, and takes it
        in; the solver goes on from there. Raises LabError, and changes nothing then."""
        lab = self.lab
        solution.check_lab(self.entry.slug)
        if not lab.has_solver():
            raise LabError(f"{self.entry.slug!r} has no solver: there is nothing to load")
        params = lab.Params().change(solution.params)
        state = lab.init(params, np.random.default_rng(solution.seed))
        own = list(islice(filter(None, lab.solve(params, state)), 2))
        if not own:
            raise LabError("with these parameters the solver finds nothing to compare with")
        snapshot = solution.snapshot(own)
        try:
            state = lab.accept(params, state, snapshot)
            lab.measure(params, state)
            lab.fields(params, state)
            lab.draw(NullScene(), params, state)
        except Exception as error:
            # Whatever a lab makes of numbers that are not its own, the run before goes on.
            raise LabError(
                f"this lab cannot show the solution ({type(error).__name__}: {error}): "
                "it is of another version, or was changed"
            ) from error
        self.params, self.seed = params, solution.seed
        self._begin(snapshot, replace(solution, results={}))

    def _begin(self, snapshot: Snapshot | None, solution: Solution | None) -> None:
        self.runs += 1
        self.steps = 0
        self.initial = self.params
        self.events: list[Event] = []
        self.complete = True
        """False once events were dropped: the run can no longer be reproduced."""
        self._actions: list[str] = []
        self._handles: dict[str, Point] = {}
        self.state = self.lab.init(self.params, np.random.default_rng(self.seed))
        self.loaded = solution
        """What this run began with."""
        if snapshot:
            self.state = self.lab.accept(self.params, self.state, snapshot)
        self._start_solver(snapshot)
        if self.solving:
            # Says that the events tell how far the solver went, even if it goes nowhere.
            self._record_event(Event(0, "solve", "iterate", 0))
        first = self.lab.measure(self.params, self.state)
        scalars = [name for plot in self.lab.plots for name in channel_names(plot)]
        self.recorder = Recorder(first, scalars, self._capacity)
        self.recorder.add(self.t, first)

    @property
    def t(self) -> float:
        """Simulated time [s]."""
        return self.steps * self.lab.period

    @property
    def trouble(self) -> str:
        trouble: str = self.state.trouble
        return trouble

    def change(self, changes: Mapping[str, object]) -> None:
        """New values for some parameters, seen from the next step on. Raises ParameterError."""
        params = self.lab.changed_params(self.params, changes)
        changed = params.changed_from(self.params)
        if not changed:
            return
        self.params = params
        effects = {params.tunables[name].effect for name in changed}
        if "restart" in effects:
            self.reset()
            return
        for name, value in changed.items():
            self._record_event(Event(self.steps, "set", name, value))
        if "solve" in effects:
            self._start_solver(None)

    def press(self, action: str) -> None:
        """Presses one of the lab's actions."""
        self.lab.check_action(action)
        self._actions.append(action)
        self._record_event(Event(self.steps, "press", action))

    def hold(self, handle: str, point: Point | None) -> None:
        """A handle is held at a point [m], or released (None). Raises ParameterError."""
        self.lab.check_handle(handle)
        if point is None:
            if self._handles.pop(handle, None) is None:
                return
        elif not np.all(np.isfinite(point)) or len(point) != 3:
            raise ParameterError(f"{handle} was dragged to {point}: three finite numbers [m] go")
        elif edits := self.lab.edit(self.params, handle, point):
            self.change(edits)
            return
        else:
            self._handles[handle] = point
        self._record_event(Event(self.steps, "hold", handle, point))

    def advance(self) -> None:
        """One period of simulated time, unless the world is in trouble or there is none."""
        if self.state.trouble or not self.lab.has_world():
            return
        inputs = Inputs(tuple(self._actions), self._handles)
        self._actions = []
        self._handles = dict(self._handles)
        self.state = self.lab.step(self.params, inputs, self.state)
        self.steps += 1
        self.recorder.add(self.t, self.lab.measure(self.params, self.state))

    # The solver's clock ---------------------------------------------------------------------

    @property
    def solving(self) -> bool:
        """Whether the solver has iterations left."""
        return self._solver is not None

    @property
    def latest(self) -> Snapshot | None:
        """The last thing the solver found, since it was started."""
        return self.snapshots.last

    def iterate(self) -> None:
        """One iteration of the solver, taken into the state: from the latest on, wherever one
        looked back to."""
        while not self.iterate_piece():
            pass

    def iterate_piece(self) -> bool:
        """A piece of an iteration, where the solver does it in pieces; whether that ended it."""
        if self._solver is None:
            return True
        try:
            snapshot = next(self._solver)
        except StopIteration:
            self._solver = None
            return True
        if snapshot is None:
            return False
        if snapshot.done:
            self._solver = None
        if self.latest and self.shown is not self.latest:
            self._accept(self.latest)
        snapshot = replace(snapshot, iteration=self._iterations_before + snapshot.iteration)
        self.snapshots.add(snapshot)
        self._accept(snapshot)
        self._record_event(Event(self.steps, "solve", "iterate", 1))
        return True

    def show(self, iteration: int) -> None:
        """Looks back at an iteration: the nearest kept one not after it. Raises ParameterError."""
        snapshot = self.snapshots.at(iteration)
        if snapshot is None:
            raise ParameterError("there is no iteration of the solver to look back at yet")
        self._accept(snapshot)
        self._record_event(Event(self.steps, "solve", "show", snapshot.iteration))

    def solution(self) -> Solution:
        """What is shown of the solver, to be saved. Raises LabError."""
        if self.shown is None:
            raise LabError("the solver has found nothing yet that could be saved")
        solution = Solution.of(self.entry.slug, self.params.model_dump(), self.seed, self.shown)
        shown = (self.params, self.state)
        plotted = {name: a for name, a in self.lab.fields(*shown).items() if np.size(a)}
        return replace(solution, results={**plotted, **self.lab.results(*shown)})

    def _accept(self, snapshot: Snapshot) -> None:
        self.state = self.lab.accept(self.params, self.state, snapshot)
        self.shown = snapshot

    def _start_solver(self, found: Snapshot | None) -> None:
        """From the present state, which holds what was `found` before."""
        self.solves += 1
        self.snapshots = Snapshots()
        self.shown = found
        self._iterations_before = found.iteration if found else 0
        if found:
            self.snapshots.add(found)
        has = self.lab.has_solver()
        self._solver = self.lab.solve(self.params, self.state) if has else None

    def _record_event(self, event: Event) -> None:
        last = self.events[-1] if self.events else None
        same = last and (last.step, last.kind, last.name) == (event.step, event.kind, event.name)
        if last and same and event.name == "iterate":
            self.events[-1] = replace(event, value=last.value + event.value)
        elif same and (event.kind in ("hold", "solve") or self._is_live(event)):
            self.events[-1] = event
        elif len(self.events) < MAX_EVENTS:
            self.events.append(event)
        else:
            self.complete = False

    def _is_live(self, event: Event) -> bool:
        """Whether only the last such change in a step matters. There and back, a change that
        starts the solver again has started it."""
        return event.kind == "set" and self.params.tunables[event.name].effect == "live"

    def recording(self) -> Recording:
        """What was recorded so far, with all that reproduces it."""
        rows = self.recorder.since(0)
        about = {
            "lab": self.entry.slug,
            "seed": self.seed,
            "period": self.lab.period,
            "params": self.initial.model_dump(),
            "changes": [
                {"t": e.step * self.lab.period, "step": e.step, "kind": e.kind}
                | {"name": e.name, "value": e.value}
                for e in self.events
            ],
            "changes_complete": self.complete,
            "covers": {"from": float(rows[0, 0]), "to": float(rows[-1, 0]), "rows": len(rows)},
            "trouble": self.trouble,
            "versions": versions(),
        }
        solution = self.loaded.to_dict() if self.loaded else None
        return Recording(about, self.recorder.columns, rows, self.recorder.channels(), solution)

    def command(self) -> str:
        """The `orclab run` line that reproduces this run up to now.

        Raises LabError where a line cannot hold it (hundreds of changes, as by dragging)."""
        if self.loaded:
            raise LabError(
                "this run began with a loaded solution, which no command line holds: export it as "
                "JSON and use orclab run --replay FILE"
            )
        if not self.complete or len(self.events) > 200:
            raise LabError(
                f"{len(self.events)} changes are too many for a command line: export the run as "
                "JSON and use orclab run --replay FILE"
            )
        words = ["orclab", "run", self.entry.slug, "--seed", str(self.seed)]
        words += ["--seconds", f"{self.t:.10g}"]
        for name, value in self.initial.changed_from(self.lab.Params()).items():
            words += ["--set", f"{name}={format_value(value)}"]
        for event in self.events:
            words += format_event(event, self.lab.period)
        return shlex.join(words)
