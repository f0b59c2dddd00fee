"""Linear quadratic regulator (notes, 2.4): weights, the policy they make, and how far it holds."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from labs.arrays import clip_norm, with_row
from labs.lab import Action, Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.models.plant import Force
from labs.optimal_control.lqr.comparison import COMPARED_HORIZONS, HORIZON_COUNT, compare
from labs.optimal_control.lqr.linear_systems import SIMULATION_STEP, LinearSystem
from labs.optimal_control.lqr.own_system import OwnSystem, step_own_system
from labs.optimal_control.lqr.params import LqrParams
from labs.optimal_control.lqr.picture import draw_regulated, draw_state_components
from labs.optimal_control.lqr.plots import (
    PLOTS,
    closed_loop_fields,
    comparison_fields,
    plot_labels,
    recursion_fields,
    region_fields,
)
from labs.optimal_control.lqr.region_of_attraction import GRID_POINTS, SYSTEM_CODES
from labs.optimal_control.lqr.regulator import Regulator
from labs.params import Value
from labs.problems.linear_quadratic import LqrProblem
from labs.scene import Scene

PUSH_STEPS = 20
"""World steps a push lasts: 0.2 s."""
PATH_POINTS = 200
"""World steps of the path that is shown: 2 s."""
TIMING_ROUNDS = 3
"""Of the comparison with least squares; the shortest duration of each horizon counts."""
ADVICE = "The policy knows of no limits: start closer, push less, or weigh otherwise; then reset."


@dataclass(kw_only=True)
class LqrState(State):
    """The system, its policy's place in the horizon, the account of its cost, and what the study
    of the policy found. Arrays are never written after they are made."""

    x: np.ndarray
    u: np.ndarray
    """(nu,) [N; N m] the control held now."""
    force: np.ndarray
    """(3,) [N] on the tip."""
    steps: int = 0
    """World steps done: t = steps * period."""
    since_update: int = 10**6
    """World steps since the control was last computed."""
    index: int = 0
    """t of K_t, the gain now used."""
    push_left: int = 0
    """World steps the push still lasts."""
    past_cost: float = 0.0
    """Of the steps before the present one, since the account was opened."""
    stage_cost: float = 0.0
    """Of the present one."""
    cost_to_go: float = 0.0
    """V_t(x_t), what the policy expected to pay from it on."""
    predicted_cost: float = 0.0
    """V_0(x_0) when the account was opened."""
    cost_settings: str = ""
    """The settings it was opened for; empty when the next update opens another."""
    path: np.ndarray
    """(k, 2) the newest last: coordinate and rate in the phase plane, [rad; m]."""
    region: np.ndarray
    """(GRID_POINTS, GRID_POINTS) of the phase plane: 1 where the policy recovers, 0 where not, -1
    where not known (yet)."""
    largest_recoverable: float = -1.0
    """[rad; m] the largest deviation at rest it recovers from; -1 while not known."""
    differences: np.ndarray
    """(HORIZON_COUNT,) between Riccati and least squares; 0 where not known (yet)."""


class Lqr(Lab[LqrParams, LqrState]):
    """A system near a rest, under the policy its weights make."""

    title = "Linear quadratic regulator"
    section = "2.4"
    summary = (
        "Weigh deviation against effort and get the best policy there is: Riccati's recursion, its "
        "steady state, and how far from upright it still saves a nonlinear pole."
    )
    Params = LqrParams
    period = SIMULATION_STEP
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Cart-pole": {},
        "Cart-pole, over again": {"policy": "window", "horizon": 80.0, "alpha": 0.0},
        "Pendulum, weak motor": {"system": "pendulum", "limit": 4.0, "r": 1.0, "push_force": 8.0},
        "Mass on a line": {"system": "mass", "deviation": 1.0, "push_force": 5.0},
        "Your matrices": {"system": "own", "period": 0.1},
        "UR5": {
            "system": "ur5",
            "q_turn": 1000.0,
            "q_turn_rate": 10.0,
            "r": 0.001,
            "push_force": 100.0,
        },
    }
    actions = (Action("push", "Push", "Pushes the tip along +y for 0.2 s.", group="World"),)
    handles = (Handle("pull", "Pulls the tip towards where it is dragged."),)

    @classmethod
    def prepare(cls) -> None:
        LqrParams().closed_loop.recovers_in_row(0)

    def init(self, params: LqrParams, rng: np.random.Generator) -> LqrState:
        """At rest, off by the deviation: the pole, the pendulum, the mass or every joint."""
        system = params.linear_system
        x = system.x_eq.copy()
        if isinstance(system, OwnSystem):
            x += system.x0
        else:
            x[0 if params.system == "ur5" else system.nq - 1 : system.nq] += params.deviation
        return LqrState(
            x=x,
            u=system.u_eq.copy(),
            force=np.zeros(3),
            path=system.phase_point(x)[None],
            region=np.full((GRID_POINTS, GRID_POINTS), -1),
            differences=np.zeros(HORIZON_COUNT),
            trouble=params.regulator.trouble,
        )

    # The world's clock ------------------------------------------------------------------------

    def step(self, params: LqrParams, inputs: Inputs, state: LqrState) -> LqrState:
        """10 ms: a new control where a period is over, then the nonlinear system."""
        if state.trouble:
            return state
        regulator, system = params.regulator, params.linear_system
        if regulator.trouble:
            return replace(state, trouble=regulator.trouble)
        push_left = PUSH_STEPS if "push" in inputs.actions else state.push_left
        force = _force(params, system, push_left, inputs.handles.get("pull"))
        length = round(params.period / SIMULATION_STEP)
        if state.since_update >= length:
            state = self._update_control(params, regulator, state)
        if isinstance(system, LinearSystem):
            x = system.step(state.x, state.u, force)
        elif state.since_update + 1 < length:
            x = state.x
        else:
            x = step_own_system(regulator.problem, state.x, state.u, force)
        count = state.steps + 1
        if why := system.out_of_range(x):
            return replace(state, trouble=f"At t = {state.t:.2f} s {why}. {ADVICE}")
        return replace(
            state,
            t=count * SIMULATION_STEP,
            steps=count,
            since_update=state.since_update + 1,
            x=x,
            force=_force_on_tip(system, x, force),
            push_left=max(push_left - 1, 0),
            cost_settings="" if force else state.cost_settings,
            path=np.vstack([state.path[-PATH_POINTS + 1 :], system.phase_point(x)]),
        )

    def _update_control(self, params: LqrParams, regulator: Regulator, state: LqrState) -> LqrState:
        """u_t = u_eq + K_t dx_t, cut to the limits; what it costs is put on the account. New
        settings, the end of a push and the start of a window open a new one."""
        system, dx = regulator.system, state.x - regulator.system.x_eq
        account = repr(regulator.settings)
        changed = state.cost_settings != account
        index = 0 if changed else (state.index + 1) % len(regulator.gains)
        opened = changed or (index == 0 and params.policy == "window")
        du = regulator.gains[index] @ dx
        if params.limits:
            limit = params.control_limit
            du = np.clip(system.u_eq + du, -limit, limit) - system.u_eq
        value = float(dx @ regulator.values[index] @ dx)
        return replace(
            state,
            u=system.u_eq + du,
            since_update=0,
            index=index,
            past_cost=0.0 if opened else state.past_cost + state.stage_cost,
            stage_cost=regulator.cost(dx, du),
            cost_to_go=value,
            predicted_cost=value if opened else state.predicted_cost,
            cost_settings=account,
        )

    # The solver's clock -----------------------------------------------------------------------

    def solve(self, params: LqrParams, state: LqrState) -> Iterator[Snapshot]:
        """Row by row, where in the phase plane the policy recovers; then, horizon by horizon, what
        Riccati and least squares take for the same problem."""
        regulator, p = params.regulator, params.regulator.problem
        if regulator.trouble:
            yield Snapshot(1, done=regulator.trouble)
            return
        rows = GRID_POINTS if params.system in SYSTEM_CODES else 0
        horizons = TIMING_ROUNDS * tuple(enumerate(COMPARED_HORIZONS[params.system]))
        last, count = rows + bool(rows) + len(horizons), 0
        data: dict[str, Any] = {"region": state.region, "largest_recoverable": -1.0}
        data |= {name: np.zeros(HORIZON_COUNT) for name in ("differences", "riccati", "at_once")}
        for row in range(rows):
            recovers = params.closed_loop.recovers_in_row(row)
            data["region"] = with_row(data["region"], row, recovers)
            count += 1
            yield Snapshot(count, dict(data), progress=count / last)
        if rows:
            data["largest_recoverable"] = params.closed_loop.largest_recoverable_deviation()
            count += 1
            yield Snapshot(count, dict(data), progress=count / last)
        for i, horizon in horizons:
            both = compare(LqrProblem(horizon, p.a, p.b, p.q, p.r, p.q))
            data["differences"] = with_row(data["differences"], i, both.difference)
            for name, took in (("riccati", both.riccati), ("at_once", both.least_squares)):
                data[name] = with_row(data[name], i, min(data[name][i] or np.inf, took))
            count += 1
            done = _summary(regulator) if count == last else ""
            yield Snapshot(count, dict(data), done, progress=count / last)

    def accept(self, params: LqrParams, state: LqrState, snapshot: Snapshot) -> LqrState:
        data = dict(snapshot.data)
        names = [name for name in ("riccati", "at_once") if name in data]
        seconds: dict[str, Any] = {name: data.pop(name) for name in names}
        return replace(state, **data, seconds=seconds)

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: LqrParams, state: LqrState) -> Measurement:
        regulator, system = params.regulator, params.linear_system
        nq = system.nq
        measured: dict[str, float | np.ndarray] = {
            "dq": (state.x - system.x_eq)[:nq],
            "u": state.u,
            "u_max": params.control_limit,
            "u_min": -params.control_limit,
            "paid": state.past_cost,
            "total": state.past_cost + state.cost_to_go,
            "predicted": state.predicted_cost,
        }
        if nq < system.nx:
            measured["v"] = state.x[nq:]
        if regulator.trouble:
            return measured
        if params.policy != "steady":
            left = regulator.settings.horizon - (state.index if params.policy == "window" else 0)
            measured["to_end"] = left * params.period
        if regulator.steady and not regulator.steady.trouble:
            measured["recursions"] = regulator.steady.iterations
        if state.largest_recoverable >= 0.0:
            measured["lean"] = state.largest_recoverable
        return measured | {
            "growth": regulator.spectral_radius,
            "settled": regulator.constant_gain_count,
        }

    def fields(self, params: LqrParams, state: LqrState) -> Mapping[str, np.ndarray]:
        regulator, system = params.regulator, params.linear_system
        gain = np.zeros((system.nu, 1))
        if not regulator.trouble:
            gain = regulator.gains[min(state.index, len(regulator.gains) - 1)]
        return (
            region_fields(params.system, state.region, state.path)
            | closed_loop_fields(regulator, gain)
            | recursion_fields(regulator)
            | comparison_fields(params.system, state.differences, state.seconds)
        )

    def results(self, params: LqrParams, state: LqrState) -> Mapping[str, np.ndarray]:
        return params.regulator.results()

    def labels(self, params: LqrParams) -> Mapping[str, str | tuple[str, ...]]:
        return plot_labels(params.linear_system)

    def draw(self, scene: Scene, params: LqrParams, state: LqrState) -> None:
        """The system, a ghost at its rest, and the forces on it."""
        if isinstance(params.linear_system, OwnSystem):
            draw_state_components(scene, params.linear_system, state.x)
            return
        draw_regulated(scene, params, state.x, state.u, state.force)


def _summary(regulator: Regulator) -> str:
    """Said when the study is over."""
    if regulator.steady is None:
        return "Studied; there is no steady state to go to."
    if regulator.steady.trouble:
        return regulator.steady.trouble
    if regulator.riccati_error < 0.0:
        return "Studied. SciPy does not solve this equation."
    return f"Studied. Recursion and SciPy differ by {regulator.riccati_error:.0e} of P's size."


def _force_on_tip(
    system: LinearSystem | OwnSystem, x: np.ndarray, force: Force | None
) -> np.ndarray:
    """(3,) [N] to be seen."""
    if force is None or isinstance(system, OwnSystem):
        return np.zeros(3)
    return force(system.mechanism.tip(x[: system.nq]))


def _force(
    params: LqrParams,
    system: LinearSystem | OwnSystem,
    push_left: int,
    handle: tuple[float, float, float] | None,
) -> Force | None:
    """On the tip: a push while it lasts, and a spring towards the handle while it is held."""
    push = np.array([0.0, params.push_force if push_left > 0 else 0.0, 0.0])
    if handle is None or isinstance(system, OwnSystem):
        return (lambda tip: push) if push.any() else None
    target, stiffness = np.array(handle), system.pull_stiffness
    return lambda tip: push + clip_norm(stiffness * (target - tip), 0.5 * stiffness)
