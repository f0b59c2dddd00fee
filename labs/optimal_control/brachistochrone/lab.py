"""The brachistochrone (notes, 2.1.1): beads race down curves, and a solver finds the fastest."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.algorithms import sqp
from labs.algorithms.sqp import SqpOptions
from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.optimal_control.brachistochrone.curves import straight_line
from labs.optimal_control.brachistochrone.fastest_polyline import FastestPolyline, grid_abscissae
from labs.optimal_control.brachistochrone.history import DescentHistory
from labs.optimal_control.brachistochrone.params import BrachistochroneParams
from labs.optimal_control.brachistochrone.picture import draw_handles, draw_optimiser, draw_race
from labs.optimal_control.brachistochrone.plots import (
    PLOTS,
    bead_names,
    finish_note,
    optimiser_fields,
    race_fields,
)
from labs.optimal_control.brachistochrone.race import (
    CURVE_NAMES,
    BeadRace,
    nearest_release,
    simulate_race,
)
from labs.params import Value
from labs.scene import Scene

OPTIONS = SqpOptions(hessian="gauss-newton", tolerance=1e-7, iterations=100)
"""On each grid. This Hessian is the exact one wherever T is convex (`fastest_polyline`); the
tolerance is of the gradient, in parts of the straight line's."""
REST_DURATION = 1.5
"""[s] between the arrival of the last bead and the next race."""


@dataclass(kw_only=True)
class BrachistochroneState(State):
    """What the optimiser has, and for how long the beads have been sliding."""

    history: DescentHistory
    steps: int = 0
    """World steps done: t = steps * period."""
    race_steps: int = 0
    """Of them, since the beads were let go."""


class Brachistochrone(Lab[BrachistochroneParams, BrachistochroneState]):
    """Six beads race from A to B; one of the curves is improved before one's eyes."""

    title = "Brachistochrone"
    section = "2.1.1"
    summary = (
        "Race beads down a line, a circle, the cycloid and a curve of your own, and watch an "
        "optimiser find the fastest."
    )
    Params = BrachistochroneParams
    period = 0.005
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Far and hardly lower": {"x_b": 3.0, "z_b": 1.0, "z_a": 1.2},
        "One start, anywhere": {"race": "starts"},
        "Rough": {"mu": 0.3},
        "On the Moon": {"g": 1.62},
    }
    handles = (
        Handle("A", "Where the beads start."),
        Handle("B", "Where they should arrive."),
        Handle("knee", "The corner of the path that goes down steeply first."),
        Handle("control", "A control point of your curve.", 3),
        Handle("release", "Where your bead is let go, among six starts."),
    )

    def init(self, params: BrachistochroneParams, rng: np.random.Generator) -> BrachistochroneState:
        """The beads are let go; the optimiser has a straight line."""
        problem = _problem(params, params.grids[0])
        return BrachistochroneState(
            history=_initial_history(params, problem, problem.straight_line_speeds)
        )

    # The solver's clock -----------------------------------------------------------------------

    def solve(
        self, params: BrachistochroneParams, state: BrachistochroneState
    ) -> Iterator[Snapshot | None]:
        """One iteration a snapshot, on one grid or on several in turn."""
        problem, count = _problem(params, params.grids[0]), 0
        cold = params.start == "cold"
        v = problem.straight_line_speeds if cold else _speeds_along(problem, state.history.nodes)
        history = _initial_history(params, problem, v)
        if not params.in_reach:
            yield Snapshot(1, {"history": history}, _out_of_reach_message(params))
            return
        for segments in params.grids:
            problem = _problem(params, segments)
            at = _initial_iterate(
                problem, v if not count else _speeds_along(problem, history.nodes)
            )
            while not at.stopped:
                at = yield from sqp.resumable_step(problem, OPTIONS, at)
                count += 1
                history = history.append(
                    problem.nodes(at.y), at.values.f, _free_gradient_norm(problem, at)
                )
                if at.converged:
                    history = history.finish_grid()
                more = at.converged and segments != params.grids[-1]
                yield Snapshot(count, {"history": history}, "" if more else at.stopped)
            if not at.converged:
                return

    def accept(
        self, params: BrachistochroneParams, state: BrachistochroneState, snapshot: Snapshot
    ) -> BrachistochroneState:
        return replace(state, history=snapshot.data["history"])

    def edit(
        self, params: BrachistochroneParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """Both ends where they are dragged to; all else from A."""
        _, x, z = point
        across, depth = x - params.x_a, params.z_a - z
        if handle == "release":
            return {"release": params.nearest("release", nearest_release(params, across, depth))}
        dragged = {
            "A": {"x_a": x, "z_a": z},
            "B": {"x_b": x, "z_b": z},
            "knee": {"x_k": across, "y_k": depth},
            **{f"control {k}": {f"x_{k}": across, f"y_{k}": depth} for k in (1, 2, 3)},
        }
        return {name: params.nearest(name, value) for name, value in dragged[handle].items()}

    # The world's clock ------------------------------------------------------------------------

    def step(
        self, params: BrachistochroneParams, inputs: Inputs, state: BrachistochroneState
    ) -> BrachistochroneState:
        """5 ms of the race; when all have arrived a rest, and then the next."""
        steps, since = state.steps + 1, state.race_steps + 1
        if (
            since * self.period
            > simulate_race(params, state.history.nodes).duration + REST_DURATION
        ):
            since = 0
        return replace(state, t=steps * self.period, steps=steps, race_steps=since)

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: BrachistochroneParams, state: BrachistochroneState) -> Measurement:
        """Of each bead its motion and energies per kg; and by how much each curve is slower than
        the fastest there is. What does not arrive has no time."""
        race, t = self._race_and_time(params, state)
        now = race.at(t)
        height = np.round(race.end[1] - now.point[:, 1], 9) + 0.0  # 0 at the end, not what rounds
        measured: dict[str, float | np.ndarray] = {
            "speed": now.speed,
            "height": height,
            "kinetic": 0.5 * now.speed**2,
            "potential": params.g * height,
            "heat": now.friction_work,
            "iteration": float(len(state.history.gradient)),
        }
        if race.fastest:
            measured["fastest"] = race.fastest.time
        arrived = race.times[np.isfinite(race.times)]
        if params.race == "starts":
            measured["isochrone"] = float(
                np.pi * np.sqrt(params.generating_circle.radius / params.g)
            )
            if len(arrived):
                measured["spread"] = round(1e3 * float(np.ptp(arrived)), 3)
        elif race.fastest:
            measured |= {
                f"behind_{name}": 1e3 * float(time - race.shortest_time)
                for name, time in zip(CURVE_NAMES, race.times, strict=True)
                if np.isfinite(time)
            }
        return measured

    def fields(
        self, params: BrachistochroneParams, state: BrachistochroneState
    ) -> Mapping[str, np.ndarray]:
        race, _ = self._race_and_time(params, state)
        return race_fields(params, race) | optimiser_fields(race, state.history)

    def notes(
        self, params: BrachistochroneParams, state: BrachistochroneState
    ) -> Mapping[str, str]:
        return {"finish": finish_note(params, *self._race_and_time(params, state))}

    def labels(self, params: BrachistochroneParams) -> Mapping[str, tuple[str, ...]]:
        return bead_names(params)

    def draw(
        self, scene: Scene, params: BrachistochroneParams, state: BrachistochroneState
    ) -> None:
        race, t = self._race_and_time(params, state)
        draw_handles(scene, params, race)
        draw_race(scene, params, race, race.at(t).point, t)
        draw_optimiser(scene, params, state.history)

    @classmethod
    def prepare(cls) -> None:
        """The solver."""
        sqp.prepare()

    def _race_and_time(
        self, params: BrachistochroneParams, state: BrachistochroneState
    ) -> tuple[BeadRace, float]:
        """The race, and its time [s]."""
        return simulate_race(params, state.history.nodes), state.race_steps * self.period


def _free_gradient_norm(problem: FastestPolyline, at: sqp.SqpIterate) -> float:
    """max |dT/dv| [ms/(m/s)], without what pushes against a bound."""
    return float(np.abs(problem.derivatives(at.y).f_y + at.nu).max())


def _out_of_reach_message(params: BrachistochroneParams) -> str:
    return (
        f"No curve arrives: up to B friction takes the height of {params.mu * params.across:.2f} m "
        f"and more, and B lies {params.depth:.2f} m down. Lower μ, or move B."
    )


def _problem(params: BrachistochroneParams, segments: int) -> FastestPolyline:
    x = grid_abscissae(params.across, segments, params.grid)
    floor = max(params.floor, params.depth)
    return FastestPolyline(x, params.depth, params.g, params.mu, floor)


def _initial_history(
    params: BrachistochroneParams, problem: FastestPolyline, v: np.ndarray
) -> DescentHistory:
    """These speeds; where B is out of reach, a straight line without a time."""
    if not params.in_reach:
        return DescentHistory.start(
            straight_line(params.across, params.depth), np.inf, params.grids
        )
    return DescentHistory.start(problem.nodes(v), problem.values(v).f, params.grids)


def _initial_iterate(problem: FastestPolyline, v: np.ndarray) -> sqp.SqpIterate:
    """At these speeds. A gradient is small beside the straight line's, wherever one starts."""
    scale = float(np.abs(problem.derivatives(problem.straight_line_speeds).f_y).max())
    return replace(sqp.init(problem, v, OPTIONS), largest_gradient=scale)


def _speeds_along(problem: FastestPolyline, nodes: np.ndarray) -> np.ndarray:
    """Speeds down the curve through `nodes`, stretched to the problem's ends; down the straight
    line where a bead is there sooner."""
    straight = problem.straight_line_speeds
    scale = np.array([problem.x[-1], problem.depth]) / nodes[-1]
    v = problem.speeds(np.interp(problem.x[1:-1], *(scale * nodes).T))
    return v if problem.values(v).f < problem.values(straight).f else straight
