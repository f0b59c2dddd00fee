"""A small lab that uses every part of the contract: both clocks, every plot, every tunable."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.lab import Action, Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.params import Group, Params, Value
from labs.plots import Bars, Curves, HeatMap, Line, Matrix, Note, Readout, TimeSeries, Trace
from labs.scene import Scene

KNOBS = Group()


class OscillatorParams(Params):
    omega: float = KNOBS.knob(2.0, 0.1, 10.0, r"\omega", "rad/s", "ω", key=True)
    """Frequency."""
    gain: float = KNOBS.knob(10.0, 0.0, 1000.0, "k_p", "1/s", scale="log", key=True)
    """Gain."""
    shape: str = KNOBS.choice("sine", {"sine": "Sine", "square": "Square"}, "Shape", key=True)
    """Form."""
    noisy: bool = KNOBS.toggle(False, "Noise", key=True)
    """Adds noise."""
    start: float = KNOBS.knob(1.0, -1.0, 1.0, "x_0", "m", effect="restart")
    """Where it starts."""
    guess: float = KNOBS.knob(9.0, 1.0, 100.0, "a", effect="solve")
    """The root sought is of it."""


@dataclass
class OscillatorState(State):
    x: float = 0.0
    key: int = 0
    kicks: int = 0
    pulled: float = 0.0
    root: float = 0.0


class Oscillator(Lab[OscillatorParams, OscillatorState]):
    title = "Oscillator"
    section = "T.1"
    summary = "A point swings, and a solver draws a root."
    Params = OscillatorParams
    plots = (
        TimeSeries("Position", "m", Line("x", "x"), Line("both", "y", "dash"), select="part"),
        Curves("Phase", "angle [rad]", "wave", Trace("angle", "wave", style="line", series=1)),
        Curves(
            "Waves",
            "angle [rad]",
            "wave",
            Trace("angle", "wave", "wave", "marked", 1, note="size"),
            Trace("angle", "square", "square", "dash", 2),
            Trace("size", "size", style="points"),
            log_y=True,
        ),
        HeatMap("Field", "angle", "angle", "field", "a [rad]", "b [rad]", "value"),
        Matrix("Matrix", "matrix", "M", shade=True),
        Bars("Bars", "bars", "b", "m", "limits", "marks"),
        Note("Note", "side"),
        Readout("root", "Root", ""),
        Readout("late", "Late", "s"),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {"Fast": {"omega": 8.0}}
    actions = (Action("kick", "Kick", "Kicks it."),)
    handles = (Handle("pull", "Pulls the ball."),)

    def init(self, params: OscillatorParams, rng: np.random.Generator) -> OscillatorState:
        return OscillatorState(x=params.start, key=int(rng.integers(2**32)))

    def step(
        self, params: OscillatorParams, inputs: Inputs, state: OscillatorState
    ) -> OscillatorState:
        t = state.t + self.period
        wave = np.cos(params.omega * t)
        x = float(np.sign(wave) if params.shape == "square" else wave) * params.start
        if params.noisy:
            x += float(np.random.default_rng([state.key, round(t / self.period)]).normal(0, 0.01))
        pulled = inputs.handles.get("pull", (0.0, 0.0, 0.0))[0]
        kicks = state.kicks + len(inputs.actions)
        return replace(state, t=t, x=x, kicks=kicks, pulled=pulled)

    def solve(self, params: OscillatorParams, state: OscillatorState) -> Iterator[Snapshot]:
        root = params.guess
        for iteration in range(1, 50):
            root = 0.5 * (root + params.guess / root)
            done = "converged" if abs(root * root - params.guess) < 1e-12 * params.guess else ""
            yield Snapshot(iteration, {"root": root}, done)
            if done:
                return

    def accept(
        self, params: OscillatorParams, state: OscillatorState, snapshot: Snapshot
    ) -> OscillatorState:
        return replace(state, root=snapshot.data["root"])

    def measure(self, params: OscillatorParams, state: OscillatorState) -> Measurement:
        measured: dict[str, float | np.ndarray] = {
            "x": state.x,
            "both": np.array([state.x, -state.x]),
            "root": state.root,
            "kicks": float(state.kicks),
            "pulled": state.pulled,
        }
        if state.t > 0.5:
            measured["late"] = state.t
        return measured

    def fields(self, params: OscillatorParams, state: OscillatorState) -> Mapping[str, np.ndarray]:
        angle = np.linspace(0, 2 * np.pi, 40)
        wave = np.sin(angle + state.t)
        return {
            "angle": angle,
            "wave": wave,
            "square": wave**2,
            "size": np.array([abs(state.x)]),
            "field": np.outer(wave, np.cos(angle)),
            "matrix": np.array([[state.x, 1.0], [1.0, -state.x]]),
            "bars": np.array([state.x, 0.5]),
            "limits": np.array([1.0, 1.0]),
            "marks": np.array([0.0, 0.25]),
        }

    def notes(self, params: OscillatorParams, state: OscillatorState) -> Mapping[str, str]:
        side = "right" if state.x > 0.0 else "left"
        return {"side": f"The point is on the {side}.\nIt swings."}

    def draw(self, scene: Scene, params: OscillatorParams, state: OscillatorState) -> None:
        scene.camera((2.0, -2.0, 1.5), (0.0, 0.0, 0.5))
        scene.sphere("ball", (state.x, 0.0, 0.5), 0.1)
        scene.handle("pull", (state.x, 0.0, 0.8))
        scene.label("name", f"x = {state.x:.1f}", (state.x, 0.0, 1.0))
        scene.arrow("arrow", (0.0, 0.0, 0.5), (state.x, 0.0, 0.5))
        scene.trail("line", np.array([[-1.0, 0, 0], [1.0, 0, 0]]), "muted")
        for k in (1, 2, 3):  # fading behind the ball
            ends = np.array([[state.x - 0.1 * k, 0, 0], [state.x - 0.1 * k, 0, 0.2]])
            scene.trail(f"echo {k}", ends, "actual", strength=0.25 * (4 - k))
