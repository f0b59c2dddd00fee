"""A lab that goes wrong on demand: it diverges, raises, or never comes back."""

import os
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numba.core import event

from labs.lab import Inputs, Lab, Measurement, State
from labs.params import Group, Params
from labs.plots import Line, TimeSeries
from labs.scene import Scene

KNOBS = Group()


class TroublesomeParams(Params):
    fault: str = KNOBS.choice(
        "none",
        {"none": "None", "trouble": "Trouble", "raise": "Raise", "hang": "Hang", "slow": "Slow"},
        "Fault",
    )
    """What goes wrong."""


@dataclass
class TroublesomeState(State):
    x: float = 0.0


class Troublesome(Lab[TroublesomeParams, TroublesomeState]):
    title = "Trouble"
    section = "T.2"
    summary = "Goes wrong on demand."
    Params = TroublesomeParams
    plots = (TimeSeries("Position", "m", Line("x", "x")),)

    def init(self, params: TroublesomeParams, rng: np.random.Generator) -> TroublesomeState:
        return TroublesomeState()

    def step(
        self, params: TroublesomeParams, inputs: Inputs, state: TroublesomeState
    ) -> TroublesomeState:
        t = state.t + self.period
        match params.fault:
            case "trouble":
                return replace(state, t=t, trouble="It diverged at once: choose another fault.")
            case "raise":
                raise ZeroDivisionError("as asked")
            case "hang":
                while True:
                    pass
            case "slow":
                end = time.perf_counter() + 0.05
                while time.perf_counter() < end:
                    pass
        return replace(state, t=t, x=float(np.sin(t)))

    @classmethod
    def prepare(cls) -> None:
        """Lasts until a file is there: as on a machine that has never compiled the solvers."""
        file = os.environ.get("PREPARED_BY")
        if file:
            with event.trigger_event("numba:compile"):
                while not Path(file).exists():
                    time.sleep(0.02)

    def measure(self, params: TroublesomeParams, state: TroublesomeState) -> Measurement:
        return {"x": state.x}

    def draw(self, scene: Scene, params: TroublesomeParams, state: TroublesomeState) -> None:
        scene.sphere("ball", (0.0, state.x, 0.5), 0.1)
