"""What the two clocks of the lab mpc-uncertainty must obey, and what its controllers plan with."""

import numpy as np
import pytest
from scipy.stats import binom

from labs.algorithms.linear_mpc import LinearPlanner, OptimalValues
from labs.algorithms.tube_mpc import TubePlanner, TubeValues
from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.optimal_control.mpc_uncertainty.controllers import (
    CONTROLLER_NAMES,
    NOMINAL,
    ROBUST,
    STOCHASTIC,
    controllers,
)
from labs.optimal_control.mpc_uncertainty.disturbances import WORST_CASE_STEPS, sample_disturbances
from labs.optimal_control.mpc_uncertainty.lab import REST_TICKS, TICKS_PER_STEP, UncertaintyState
from labs.optimal_control.mpc_uncertainty.params import DISTURBANCE_KINDS, UncertaintyParams
from labs.optimal_control.mpc_uncertainty.picture import UNIT_CIRCLE, phase_plane
from labs.optimal_control.mpc_uncertainty.runs import RUN_STEPS
from labs.optimal_control.mpc_uncertainty.statistics import CONFIDENCE, confidence_interval
from labs.problems.polyhedron import box
from labs.resumable import Resumable, run_to_completion
from labs.scene import NullScene
from tests.labs.solving import solve, solved_world

SLUG = "mpc-uncertainty"


def state(world: World) -> UncertaintyState:
    assert isinstance(world.state, UncertaintyState)
    return world.state


def test_all_controllers_meet_the_same_disturbances_and_limits_of_the_motor() -> None:
    """x+ - A x - B u is one w for all three, at every step of every run, and inside W."""
    world = solved_world(SLUG, {"count": 20.0, "kind": "corners"})
    params = UncertaintyParams(count=20.0, kind="corners")
    problem, runs = controllers(params).problems[NOMINAL], state(world).runs
    w = runs.X[:, 1:] - runs.X[:, :-1] @ problem.A.T - runs.U[..., None] @ problem.B.T
    np.testing.assert_allclose(w - w[:1], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(w), np.broadcast_to(params.w_max, w.shape), atol=1e-12)
    assert (np.abs(runs.U) <= params.u_max).all()


@pytest.mark.parametrize("kind", DISTURBANCE_KINDS)
def test_disturbances_are_of_their_kind(kind: str) -> None:
    params = UncertaintyParams(kind=kind, count=400.0, width=2.0)
    A_K = np.array([[0.9, 0.16], [-0.8, 0.4]])
    w = sample_disturbances(params, A_K, RUN_STEPS) / params.w_max
    np.testing.assert_array_equal(w * params.w_max, sample_disturbances(params, A_K, RUN_STEPS))
    if kind == "gaussian":
        np.testing.assert_allclose(w.std(axis=(0, 1)), 0.5, rtol=0.02)
        assert np.abs(w).max() > 1.0
        return
    assert np.abs(w).max() <= 1.0
    if kind == "worst":
        powers = [np.linalg.matrix_power(A_K, i)[0] for i in range(WORST_CASE_STEPS)]
        reached = sum(powers[WORST_CASE_STEPS - 1 - k] @ w[k, 0] for k in range(WORST_CASE_STEPS))
        assert reached == pytest.approx(np.abs(powers).sum()), "as far as W can lead"
        return
    deviations = UncertaintyParams(kind=kind).deviation / params.w_max
    np.testing.assert_allclose(w.std(axis=(0, 1)), deviations, rtol=0.02)


@pytest.mark.parametrize("source", ["predicted", "measured"])
def test_feasible_sets_hold_just_the_states_from_which_there_are_plans(source: str) -> None:
    chosen = controllers(UncertaintyParams(source=source, N=6.0))
    states = phase_plane(UncertaintyParams()).grid(15, 19).reshape(-1, 2)
    planners: list[LinearPlanner | TubePlanner] = [*chosen.planners, chosen.tube_planner]
    for name, corners, planner in zip(CONTROLLER_NAMES, chosen.feasible, planners, strict=True):
        answers: Resumable[OptimalValues | TubeValues] = planner.values(states)
        found = np.isfinite(run_to_completion(answers).V)
        edges = np.roll(corners, -1, axis=0) - corners
        away = states[:, None] - corners
        outside = edges[:, 1] * away[..., 0] - edges[:, 0] * away[..., 1]
        clear = np.abs(outside).min(axis=1) > 1e-6
        np.testing.assert_array_equal(found[clear], (outside <= 0.0).all(axis=1)[clear], name)
        assert 10 < found.sum() < len(states)


@pytest.mark.parametrize("source", ["predicted", "measured"])
def test_what_is_drawn_about_a_plan_reaches_as_far_as_its_margins(source: str) -> None:
    chosen = controllers(UncertaintyParams(source=source, probability=95.0))
    margins = chosen.margins()
    fine = np.stack([f(np.linspace(0.0, 2.0 * np.pi, 2001)) for f in (np.cos, np.sin)], axis=1)
    reach = [(fine @ ellipse.T)[:, 0].max() for ellipse in chosen.ellipses]
    np.testing.assert_allclose(reach, margins[STOCHASTIC], atol=1e-6)
    np.testing.assert_allclose(chosen.tube[:, 0].max(), margins[ROBUST])
    assert not margins[NOMINAL].any()
    assert (UNIT_CIRCLE**2).sum(axis=1) == pytest.approx(1.0)


def test_robust_mpc_keeps_every_limit() -> None:
    """Of position, velocity and force, under the worst disturbance of all runs."""
    world = solved_world(SLUG, {"kind": "worst", "count": 20.0, "v_max": 0.8})
    runs = state(world).runs
    assert runs.planned[ROBUST].all()
    limits = box([-1.5, -0.8], [0.9, 0.8])
    assert limits.contains(runs.X[ROBUST], 1e-7).all()


def test_the_runs_are_played_and_begin_anew() -> None:
    world = World(find_lab(SLUG), {"count": 20.0})
    solve(world)
    assert state(world).clock == 0
    for _ in range(RUN_STEPS * TICKS_PER_STEP):
        world.advance()
    assert state(world).clock == RUN_STEPS * TICKS_PER_STEP
    for _ in range(REST_TICKS + 1):
        world.advance()
    assert state(world).clock == 0
    world.change({"w_v": 0.12})
    solve(world)
    assert state(world).runs.steps == RUN_STEPS


def test_the_start_is_dragged_in_the_plane() -> None:
    world = World(find_lab(SLUG), {})
    lab, params = world.lab, world.params
    assert isinstance(params, UncertaintyParams)
    point = phase_plane(params).place(np.array([-0.4, 0.3]))
    assert lab.edit(params, "start", tuple(point)) == pytest.approx({"p_0": -0.4, "v_0": 0.3})
    assert not lab.edit(params, "other", tuple(point))


def test_each_controller_is_shown_alone_or_beside_the_others() -> None:
    for shown in ("all", *CONTROLLER_NAMES):
        world = solved_world(SLUG, {"count": 20.0, "shown": shown})
        scene = NullScene()
        world.lab.draw(scene, world.params, world.state)
        seen = {name for name in CONTROLLER_NAMES if f"runs, {name}" in scene.names}
        assert seen == (set(CONTROLLER_NAMES) if shown == "all" else {shown})
        assert {f"{name} cart" for name in CONTROLLER_NAMES} <= set(scene.names)
        assert "start" in scene.names
    world.change({"zoom": True})
    near = NullScene()
    world.lab.draw(near, world.params, world.state)
    assert "start" not in near.names


def test_the_confidence_interval_is_that_of_the_binomial_distribution() -> None:
    for count in (20.0, 110.0, 400.0):
        for probability in (50.0, 63.0, 90.0, 99.0, 99.9):
            params = UncertaintyParams(count=count, probability=probability)
            exact = binom.interval(CONFIDENCE, round(count), 1.0 - probability / 100.0)
            assert confidence_interval(params) == tuple(float(k) / count for k in exact)
