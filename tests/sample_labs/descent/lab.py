"""A small lab that has a solver and no world: gradient descent, one short step an iteration.

It goes on from where a solution that was loaded ended; its path grows, and it measures time."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from labs.lab import Lab, Measurement, Snapshot, State
from labs.params import Group, Params
from labs.plots import Curves, Readout, Trace
from labs.scene import Scene

BOWL = np.array([1.0, 10.0])


KNOBS = Group(effect="solve")


class DescentParams(Params):
    rate: float = KNOBS.knob(0.05, 0.001, 0.09, r"\alpha", step=0.001)
    """Step size."""
    many: float = KNOBS.knob(200.0, 1.0, 1000.0, "N", step=1.0)
    """Iterations."""
    fade: float = KNOBS.knob(0.5, 0.0, 1.0, "f", effect="live")
    """Of the path."""


@dataclass
class DescentState(State):
    x: np.ndarray = field(default_factory=lambda: np.array([1.0, 1.0]))
    path: np.ndarray = field(default_factory=lambda: np.array([[1.0, 1.0]]))
    best: float = 5.5
    steps: int = 0


class Descent(Lab[DescentParams, DescentState]):
    title = "Descent"
    section = "T.3"
    summary = "A point walks down a bowl."
    Params = DescentParams
    plots = (
        Curves("Path", "x_1", "x_2", Trace("first", "second", style="line", series=1)),
        Readout("best", "Cost", ""),
    )

    def init(self, params: DescentParams, rng: np.random.Generator) -> DescentState:
        return DescentState()

    def solve(self, params: DescentParams, state: DescentState) -> Iterator[Snapshot | None]:
        begun, path = time.perf_counter(), state.path
        for k in range(1, round(params.many) + 1):
            yield None  # an iteration of two pieces
            path = np.vstack([path, path[-1] - params.rate * BOWL * path[-1]])
            x = path[-1]
            data = {
                "point": {"x": x, "path": path},
                "best": float(0.5 * BOWL @ x**2),
                "counts": [state.steps + k],
                "seconds": {"all": time.perf_counter() - begun},
            }
            done = f"{round(params.many)} steps done." if k == round(params.many) else ""
            yield Snapshot(k, data, done, k / round(params.many))

    def accept(
        self, params: DescentParams, state: DescentState, snapshot: Snapshot
    ) -> DescentState:
        data = snapshot.data
        return replace(
            state,
            x=data["point"]["x"],
            path=data["point"]["path"],
            best=data["best"],
            steps=data["counts"][0],
            seconds=data["seconds"],
        )

    def measure(self, params: DescentParams, state: DescentState) -> Measurement:
        gone = float(np.linalg.norm(state.path[-1] - state.path[0]))
        return {"best": state.best, "steps": float(state.steps), "gone": gone}

    def fields(self, params: DescentParams, state: DescentState) -> Mapping[str, np.ndarray]:
        return {"first": state.path[:, 0], "second": state.path[:, 1]}

    def draw(self, scene: Scene, params: DescentParams, state: DescentState) -> None:
        scene.camera((0.0, -3.0, 3.0), (0.0, 0.0, 0.0))
        scene.sphere("point", (*state.x, 0.1), 0.05)
        if state.steps:
            path = np.column_stack([state.path, np.full(len(state.path), 0.1)])
            scene.trail("path", path, "muted", strength=1.0 - 0.9 * params.fade)
