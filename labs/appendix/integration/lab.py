"""Numerical integration (notes, A.1 and A.2): one pendulum for each method, side by side."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.algorithms.runge_kutta import gauss_legendre, order, runge_kutta_step
from labs.appendix.integration.accuracy import (
    STEP_COUNTS,
    errors_and_limit,
    one_step_method,
    tableau_of,
)
from labs.appendix.integration.params import (
    DORMAND_PRINCE,
    METHOD_NAMES,
    IntegrationParams,
)
from labs.appendix.integration.picture import draw_pendulums, tip_position
from labs.appendix.integration.plots import PLOTS, error_fields, stability_fields
from labs.arrays import with_row
from labs.lab import Inputs, Lab, Measurement, Snapshot, State
from labs.params import Value
from labs.scene import Scene

REFERENCE_METHOD = gauss_legendre(3)
"""Order 6, with steps of 10 ms: what the others are compared with in the scene."""
SPEED_LIMIT = 40.0
"""[rad/s] a pendulum faster than this has blown up; one that falls from upright makes 11."""


@dataclass(kw_only=True)
class IntegrationState(State):
    """Where each method is, and what is known of their errors so far. The rows are in the
    order of METHOD_NAMES."""

    x: np.ndarray
    """(8, 2 nq) the last step of each."""
    reference: np.ndarray
    """(2 nq,) the motion itself, at t."""
    stopped: np.ndarray
    """(8,) whether it has blown up."""
    steps: int = 0
    """World steps done: t = steps * period."""
    method_time: float = 0.0
    """[s] the time the methods have reached; behind t by less than h."""
    newton_iterations: int = 0
    """Iterations in the last implicit step."""
    global_errors: np.ndarray
    """(8, k) for STEP_SIZES; 0 where there is none (yet)."""
    local_errors: np.ndarray
    """(8, k)."""
    costs: np.ndarray
    """(8, k) evaluations of f."""
    limits: np.ndarray
    """(8,) [s] largest step that does not blow up; -1 while unknown, LONGEST_STEP where none
    does."""


class Integration(Lab[IntegrationParams, IntegrationState]):
    """Eight ways to integrate one motion."""

    title = "Numerical integration"
    section = "A.1"
    summary = (
        "Eight methods swing the same pendulum with the same step: their order, their cost, "
        "what they do to energy, and when they blow up."
    )
    Params = IntegrationParams
    period = 0.01
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Large steps": {"h": 0.3},
        "Small steps": {"h": 0.005},
        "Double pendulum": {"system": "double-pendulum", "start": 1.5, "h": 0.02},
        "Strong friction": {"friction": 2.0, "h": 0.1},
        "Dormand-Prince": {"tableau": DORMAND_PRINCE},
        "Gauss-Legendre": {"implicit": "gauss-legendre", "h": 0.2},
    }

    def init(self, params: IntegrationParams, rng: np.random.Generator) -> IntegrationState:
        x, many, k = params.x0(), len(METHOD_NAMES), len(STEP_COUNTS)
        return IntegrationState(
            x=np.tile(x, (many, 1)),
            reference=x,
            stopped=np.zeros(many, bool),
            global_errors=np.zeros((many, k)),
            local_errors=np.zeros((many, k)),
            costs=np.zeros((many, k)),
            limits=np.full(many, -1.0),
        )

    def step(
        self, params: IntegrationParams, inputs: Inputs, state: IntegrationState
    ) -> IntegrationState:
        """10 ms of the motion itself, and of the methods the steps of h that are due."""
        if state.trouble:
            return state
        t, n = (state.steps + 1) * self.period, params.rods
        x, stopped = state.x.copy(), state.stopped.copy()
        clock, newton = state.method_time, state.newton_iterations
        methods = [one_step_method(*params.method(m)) for m in METHOD_NAMES]
        with np.errstate(all="ignore"):
            while clock + params.h <= t + 1e-9:
                for i, method in enumerate(methods):
                    if stopped[i]:
                        continue
                    done = method(x[i], clock, params.h)
                    if done.status or not np.abs(done.x[n:]).max() <= SPEED_LIMIT:
                        stopped[i] = True
                        continue
                    x[i] = done.x
                    newton = done.iterations if METHOD_NAMES[i] == "implicit" else newton
                clock += params.h
            exact = runge_kutta_step(
                REFERENCE_METHOD, params.plant.vector_field, state.reference, state.t, self.period
            )
        reference = state.reference if exact.status else exact.x
        return replace(
            state,
            t=t,
            steps=state.steps + 1,
            x=x,
            stopped=stopped,
            method_time=clock,
            newton_iterations=newton,
            reference=reference,
        )

    def solve(self, params: IntegrationParams, state: IntegrationState) -> Iterator[Snapshot]:
        """One method an iteration: its errors for each of STEP_SIZES, and its limit. What is
        known for other parameters stands until it is replaced."""
        studied = {
            "global_errors": state.global_errors,
            "local_errors": state.local_errors,
            "costs": state.costs,
            "limits": state.limits,
        }
        for i, name in enumerate(METHOD_NAMES):
            errors, local, costs, limit = errors_and_limit(*params.method(name), params.start)
            studied = {
                "global_errors": with_row(studied["global_errors"], i, errors),
                "local_errors": with_row(studied["local_errors"], i, local),
                "costs": with_row(studied["costs"], i, costs),
                "limits": with_row(studied["limits"], i, limit),
            }
            done = "All methods studied." if i == len(METHOD_NAMES) - 1 else ""
            yield Snapshot(i + 1, studied, done, (i + 1) / len(METHOD_NAMES))

    def accept(
        self, params: IntegrationParams, state: IntegrationState, snapshot: Snapshot
    ) -> IntegrationState:
        return replace(state, **snapshot.data)

    def measure(self, params: IntegrationParams, state: IntegrationState) -> Measurement:
        plant, yours = params.plant, tableau_of(params.own_tableau)
        fall = plant.energy(np.eye(2 * params.rods)[0] * np.pi)
        initial = plant.energy(params.x0())
        measured: dict[str, float | np.ndarray] = {
            "tip": float(tip_position(state.reference[: params.rods])[1]),
            "energy": plant.energy(state.reference),
            "own_order": float(order(yours)),
            "own_sum": float(yours.b.sum()),
            "reach": params.h * float(np.abs(plant.eigenvalues).max()),
            "newton": float(state.newton_iterations),
            "going": float(len(METHOD_NAMES) - state.stopped.sum()),
        }
        for x, name in zip(state.x, METHOD_NAMES, strict=True):
            energy = plant.energy(x)
            measured[f"tip_{name}"] = float(tip_position(x[: params.rods])[1])
            measured[f"energy_{name}"] = energy
            measured[f"drift_{name}"] = float(np.log10(max(abs(energy - initial) / fall, 1e-12)))
        return measured

    def fields(
        self, params: IntegrationParams, state: IntegrationState
    ) -> Mapping[str, np.ndarray]:
        errors = error_fields(state.global_errors, state.local_errors, state.costs)
        return {**errors, **stability_fields(params, state.limits)}

    def draw(self, scene: Scene, params: IntegrationParams, state: IntegrationState) -> None:
        """The pendulums in echelon, the exact one in front, and a line through all the places
        where its tip would be."""
        n = params.rods
        draw_pendulums(scene, state.reference[:n], state.x[:, :n], state.stopped)
