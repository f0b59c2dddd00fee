"""Lyapunov functions (notes, B.1): where V decreases, the sets that no state leaves, and how fast
everything in them comes to rest."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.appendix.lyapunov.analysis import LyapunovAnalysis, analyse
from labs.appendix.lyapunov.params import LyapunovParams
from labs.appendix.lyapunov.picture import draw_phase_plane
from labs.appendix.lyapunov.plots import PLOTS, conditions, map_fields, run_fields
from labs.appendix.lyapunov.state_ensemble import (
    RUN_STEPS,
    StateEnsemble,
    advance_ensemble,
    hold_controls,
    initial_ensemble,
)
from labs.lab import Action, Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.params import Value
from labs.resumable import run_to_completion
from labs.scene import Scene
from labs.tasks.phase_plane.systems import SIMULATION_STEP

START = 0.6
"""Where the body starts, at rest, in parts of the window."""
LEVEL_TOLERANCE = 1e-9
"""By which, in parts of the level, V may be above it by rounding."""


@dataclass(kw_only=True)
class LyapunovState(State):
    """The body, the states let loose, and what is known of V. Arrays are never written after they
    are made."""

    x: np.ndarray
    """(2,) of the body."""
    u: np.ndarray
    """(1,) held now."""
    body_V: float = 0.0
    steps: int = 0
    """World steps done."""
    study: LyapunovAnalysis | None = None
    failure: str = ""
    """Why there is no V."""
    runs: StateEnsemble | None = None


class Lyapunov(Lab[LyapunovParams, LyapunovState]):
    """Closed loops of the plane and candidates for a Lyapunov function."""

    title = "Lyapunov functions"
    section = "B.1"
    summary = (
        "Shape a bowl over the plane of states and see where a controller always leads downhill: "
        "the set that no state leaves, and how fast everything in it comes to rest."
    )
    Params = LyapunovParams
    period = SIMULATION_STEP
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Pendulum, ellipses": {},
        "Upright, a weak motor": {"system": "lqr", "candidate": "riccati", "u_max": 1.0},
        "Cart under MPC": {"system": "mpc", "candidate": "value", "u_max": 0.5},
        "Van der Pol": {"system": "vanderpol", "candidate": "lyapunov"},
    }
    actions = (
        Action("release", "Let loose", "Sixty states start on the edge of the set.", group="Set"),
    )
    handles = (
        Handle("state", "Puts the body where it is dragged."),
        Handle("axis 1", "Turns and stretches the ellipse."),
        Handle("axis 2", "Stretches the ellipse."),
        Handle("corner", "Sizes the box."),
    )

    @classmethod
    def prepare(cls) -> None:
        params = LyapunovParams(system="mpc", candidate="value")
        run_to_completion(params.V.values(np.zeros((1, 2))))

    def init(self, params: LyapunovParams, rng: np.random.Generator) -> LyapunovState:
        return LyapunovState(x=np.array([START * params.loop.window[0], 0.0]), u=np.zeros(1))

    # The world's clock ------------------------------------------------------------------------

    def step(self, params: LyapunovParams, inputs: Inputs, state: LyapunovState) -> LyapunovState:
        """10 ms of the body and of all states, each under the control held since the law last
        looked."""
        loop, substeps = params.loop, round(params.period / SIMULATION_STEP)
        x, u, runs, body_V = state.x, state.u, state.runs, state.body_V
        held = inputs.handles.get("state")
        if held is not None:
            x = params.plane.state_at(held)
        if state.study is not None and (
            runs is None or runs.k >= RUN_STEPS or "release" in inputs.actions
        ):
            runs = initial_ensemble(state.study.starts)
        due = runs is not None and runs.clock % substeps == 0
        if due or (runs is None and state.steps % substeps == 0) or held is not None:
            many = x[None] if runs is None or not due else np.vstack([x, runs.X])
            U = run_to_completion(loop.control(many))
            u = U[0]
            if state.study is not None:
                V = run_to_completion(params.V.values(many))
                body_V = float(V[0])
                if runs is not None and due:
                    runs = hold_controls(
                        runs, U[1:], V[1:], self._outside(params, state.study, runs, V[1:])
                    )
        if runs is not None:
            runs = advance_ensemble(runs, loop.system, substeps)
        x = np.clip(
            loop.system.step(x, u, SIMULATION_STEP),
            -2.0 * params.plane.upper,
            2.0 * params.plane.upper,
        )
        count = state.steps + 1
        return replace(
            state, t=count * SIMULATION_STEP, steps=count, x=x, u=u, runs=runs, body_V=body_V
        )

    @staticmethod
    def _outside(
        params: LyapunovParams, found: LyapunovAnalysis, runs: StateEnsemble, V: np.ndarray
    ) -> np.ndarray:
        """Which of the runs (M,) are outside of the set."""
        if params.set == "box":
            return np.asarray(~params.box.contains(runs.X, 1e-9))
        return (
            np.asarray(found.level * (1.0 + LEVEL_TOLERANCE) < V)
            if found.level > 0.0
            else np.inf < V
        )

    # The solver's clock -----------------------------------------------------------------------

    def solve(self, params: LyapunovParams, state: LyapunovState) -> Iterator[Snapshot | None]:
        """V, its change and its level sets over the plane, at once."""
        found = yield from analyse(params)
        if isinstance(found, str):
            yield Snapshot(1, {"failure": found}, done=found)
            return
        yield Snapshot(1, dict(vars(found)) | {"failure": ""}, done=_summary(found))

    def accept(
        self, params: LyapunovParams, state: LyapunovState, snapshot: Snapshot
    ) -> LyapunovState:
        """The states start anew: they belong to the set of before."""
        data = dict(snapshot.data)
        failure = data.pop("failure")
        found = None if failure else LyapunovAnalysis(**data)
        return replace(state, study=found, failure=failure, runs=None)

    def edit(
        self, params: LyapunovParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        if handle == "state":
            return {}
        share = params.plane.state_at(point) / params.plane.upper
        if handle == "corner":
            names, sizes = ("box_1", "box_2"), np.abs(share)
            return {n: params.nearest(n, float(s)) for n, s in zip(names, sizes, strict=True)}
        length = float(np.linalg.norm(share))
        if handle == "axis 2":
            return {"axis_2": params.nearest("axis_2", length)}
        angle = np.degrees(np.arctan2(share[1], share[0]))
        angle = (angle + 90.0) % 180.0 - 90.0  # the ellipse is the same half a turn on
        return {
            "angle": params.nearest("angle", float(angle)),
            "axis_1": params.nearest("axis_1", length),
        }

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: LyapunovParams, state: LyapunovState) -> Measurement:
        measured: dict[str, float] = {"body_V": state.body_V}
        if state.runs is not None:
            measured["left"] = float(state.runs.left.sum())
        found = state.study
        if found is None:
            return measured
        a = found.constants
        measured |= {
            "level_max": found.level_max,
            "decreasing": 100.0 * found.decreasing,
            "covered": 100.0 * found.covered,
            "alpha_1": a.alpha_1,
            "alpha_2": a.alpha_2,
            "alpha_3": a.alpha_3,
        }
        return measured | ({"c": a.c, "gamma": a.gamma} if a.holds else {})

    def fields(self, params: LyapunovParams, state: LyapunovState) -> Mapping[str, np.ndarray]:
        return {**run_fields(state.runs, state.study), **map_fields(params, state.study)}

    def notes(self, params: LyapunovParams, state: LyapunovState) -> Mapping[str, str]:
        return {"conditions": conditions(params, state.study, state.failure)}

    def labels(self, params: LyapunovParams) -> Mapping[str, str | tuple[str, ...]]:
        system = params.loop.system
        names = (f"{name} [{unit}]" for name, unit in zip(system.names, system.units, strict=True))
        return dict(zip(("q_name", "v_name"), names, strict=True))

    def draw(self, scene: Scene, params: LyapunovParams, state: LyapunovState) -> None:
        draw_phase_plane(scene, params, state.study, state.runs, state.x)


def _summary(found: LyapunovAnalysis) -> str:
    if found.decreasing == 1.0:
        return f"V decreases everywhere in the window, below the level {found.level_max:.3g}."
    percent = 100.0 * found.decreasing
    if found.level_max > 0.0:
        return (
            f"V decreases in {percent:.1f} % of the window, and everywhere below the level "
            f"{found.level_max:.3g}."
        )
    return f"V decreases in {percent:.1f} % of the window, and in no level set throughout."
