"""Motions in pieces, first guesses, and plans that are played."""

from typing import Any

import numpy as np
import pytest

from labs.algorithms import sqp
from labs.algorithms.collocation import Collocation
from labs.models.mechanisms import mechanism
from labs.scene import NullScene
from labs.tasks.direct.guesses import first_guess, resample_motion
from labs.tasks.direct.history import ARC_POINTS, KEPT_PATHS, IterationHistory
from labs.tasks.direct.params import GUESSES, DirectParams
from labs.tasks.direct.picture import draw_goal, draw_paths, draw_robots, join_pieces
from labs.tasks.direct.plan_params import SOFT_WEIGHT
from labs.tasks.direct.player import (
    DirectState,
    advance_player,
    edit_balls,
    measure_player,
    play_motion,
)
from labs.tasks.direct.systems import TASK_TITLES, reaching_posture, rest_to_rest_task
from labs.tasks.direct.tracking import nominal_trajectory
from labs.tasks.direct.trajectory import PiecewiseTrajectory
from labs.tasks.motion.playback import FEEDBACK, OPEN_LOOP, start_playback

T = 2.0


def pushed(k: int = 8) -> PiecewiseTrajectory:
    """The mass under u = 3 t - 1, exactly."""
    t = np.linspace(0.0, T, k + 1)
    X = np.stack([0.5 * t**3 - 0.5 * t**2, 1.5 * t**2 - t], axis=1)
    u = 3.0 * t - 1.0
    return PiecewiseTrajectory(T, X, X[1:], np.stack([u[:-1], u[1:]], axis=1)[:, :, None])


def test_a_cubic_is_interpolated_exactly() -> None:
    motion, t = pushed(), np.linspace(0.0, T, 31)
    found = motion.states(mechanism("mass"), t)
    np.testing.assert_allclose(found[:, 0], 0.5 * t**3 - 0.5 * t**2, atol=1e-12)
    edges = np.array([0.0, 0.1, 0.33, 1.0, 1.9, 2.0])
    mean = motion.mean_controls(edges)[:, 0]
    np.testing.assert_allclose(mean, 1.5 * (edges[1:] + edges[:-1]) - 1.0, atol=1e-12)
    beyond = motion.mean_controls(np.array([2.0, 2.1]))
    assert beyond[0, 0] == pytest.approx(5.0)
    np.testing.assert_allclose(motion.state(0.125), 0.5 * (motion.X[0] + motion.X[1]))


@pytest.mark.parametrize("system", TASK_TITLES)
@pytest.mark.parametrize("guess", GUESSES)
def test_a_first_guess_starts_at_the_start(system: str, guess: str) -> None:
    params = DirectParams(system=system, guess=guess)
    X, U, horizon = first_guess(params, 7)
    nx, nu = params.task.mechanism.nx, params.task.mechanism.nu
    assert X.shape == (8, nx)
    assert U.shape == (7, nu)
    assert horizon == 2.0
    assert np.isfinite(X).all()
    np.testing.assert_array_equal(X[0], params.task.x0)
    if guess == "line":
        tip = params.task.mechanism.tip(X[-1, : nx // 2])
        np.testing.assert_allclose(tip, params.goal_position, atol=1e-3)


SHOULDER, LINKS, WRIST, TOOL, ASIDE = 0.089159, 0.425 + 0.39225, 0.09465, 0.0823, 0.10915
"""[m] of the UR5: its height, upper arm and forearm, the wrist's two parts, and how far the plane
they move in lies beside the axis of the base."""


def distance_of_what_it_reaches(target: np.ndarray) -> float:
    """[m] from a place (3,) outside of all that the UR5 reaches, by its geometry: stretched out at
    any elevation, its tool turned out of the arm's plane by any angle."""
    elevation, turn = np.meshgrid(np.linspace(-np.pi, np.pi, 2001), np.linspace(-np.pi, np.pi, 401))
    stretched = LINKS + np.hypot(WRIST, TOOL * np.cos(turn))
    beside = np.hypot(stretched * np.cos(elevation), ASIDE + TOOL * np.sin(turn))
    above = SHOULDER + stretched * np.sin(elevation)
    return float(np.hypot(np.hypot(*target[:2]) - beside, target[2] - above).min())


@pytest.mark.parametrize(
    "target",
    [(0.9, 0.9, 1.0), (-0.9, -0.9, 0.05), (-0.87, 0.56, 0.92), (0.7, -0.7, 0.6), (0.7, -0.5, 0.64)],
)
def test_a_place_out_of_reach_is_come_as_near_to_as_the_arm_can(
    target: tuple[float, float, float],
) -> None:
    place, at = np.array(target), rest_to_rest_task("ur5").mechanism
    q = reaching_posture("ur5", place)
    least = distance_of_what_it_reaches(place)
    assert least > 0.05
    assert np.linalg.norm(at.tip(q) - place) == pytest.approx(least, abs=1e-4)
    assert np.abs(q - at.arm.home).max() <= np.pi


def test_so_is_the_axis_of_the_base() -> None:
    """No nearer than the tool can lead back across the distance by which the arm lies aside."""
    place, at = np.array([0.0, 0.0, 0.3]), rest_to_rest_task("ur5").mechanism
    tip = at.tip(reaching_posture("ur5", place))
    assert np.linalg.norm(tip - place) == pytest.approx(ASIDE - TOOL, abs=1e-4)


def test_of_places_within_reach_none_is_missed() -> None:
    """All around the base, behind it too, and each joint within half a turn of home."""
    at, rng = rest_to_rest_task("ur5").mechanism, np.random.default_rng(0)
    for _ in range(200):
        q = at.arm.home + rng.uniform(-3.0, 3.0, 6)
        place = at.tip(q)
        found = reaching_posture("ur5", place)
        np.testing.assert_allclose(at.tip(found), place, atol=1e-3)
        assert np.abs(found - at.arm.home).max() <= np.pi


def test_a_path_is_parted_where_it_has_gaps() -> None:
    arcs = np.zeros((4, 2, 3))
    arcs[:, :, 0] = [[0.0, 1.0], [1.0, 2.0], [2.5, 3.0], [3.0, 4.0]]
    first, second = join_pieces(arcs)
    assert first[-1, 0] == 2.0
    assert second[0, 0] == 2.5


def solved(params: DirectParams, N: int = 40) -> DirectState:
    program = Collocation(params.problem, N, "trapezoidal")
    at = sqp.init(program, program.variables(*first_guess(params, N)), params.options)
    motions = [_motion(program, at)]
    history = IterationHistory.start(params, at, motions[0])
    while not at.stopped:
        at = sqp.step(program, params.options, at)
        motions.append(_motion(program, at))
        history = history.append(params, at, motions[-1])
    assert at.converged, at.stopped
    plan = nominal_trajectory(params, motions[-1])
    state = DirectState(
        motion=motions[0],
        plan=plan,
        history=history,
        playback=start_playback(plan),
        goal_errors=np.zeros(0),
    )
    return play_motion(state, motions[-1], plan, history, failed=False)


def _motion(program: Collocation, at: sqp.SqpIterate) -> PiecewiseTrajectory:
    T, X, U = program.trajectory(at.y)
    both = np.stack([U[:-1], U[1:]], axis=1)
    return PiecewiseTrajectory(T, X, X[1:] - program.defects(at.values.c), both)


def test_a_plan_is_played_and_the_regulator_holds_it() -> None:
    params = DirectParams(system="pendulum", payload=0.1)
    state = solved(params)
    history = state.history
    assert history.gaps.shape == (history.iterations + 1, 40)
    assert history.gaps[0].max() > 0.05
    assert history.gaps[-1].max() < 1e-8
    assert history.tips.shape == (KEPT_PATHS, 40, ARC_POINTS, 3)
    while not state.playback.finished(state.plan):
        state = advance_player(params, state)
    assert state.goal_errors[FEEDBACK] < 0.1 < state.goal_errors[OPEN_LOOP]
    assert measure_player(params, state)["missed"] == state.goal_errors[FEEDBACK]
    scene = NullScene()
    draw_robots(scene, params, state)
    draw_paths(scene, params, state)
    draw_goal(scene, params)
    assert {"robot", "open loop", "of open loop", "piece 1", "now", "goal"} <= set(scene.names)
    plain = DirectParams(system="pendulum")
    state = play_motion(state, state.motion, state.plan, history, failed=False)
    while not state.playback.finished(state.plan):
        state = advance_player(plain, state)
    assert state.goal_errors[FEEDBACK] < 1e-3, "the plant being as the plan has it"
    assert state.goal_errors[OPEN_LOOP] < 0.2, "the errors of 40 steps, grown near the unstable end"
    again = resample_motion(params, state.motion, 20)
    np.testing.assert_allclose(again.X, state.motion.X[::2], atol=1e-12)


def test_positions_are_limited_beyond_start_and_goal() -> None:
    def limits(system: str, **more: Any) -> tuple[np.ndarray, np.ndarray]:
        problem = DirectParams(system=system, position_limited=True, **more).problem
        n = problem.dynamics.nx // 2
        return problem.x_lower[:n], problem.x_upper[:n]

    np.testing.assert_allclose(limits("pendulum", position_margin=0.3), [[-0.3], [np.pi + 0.3]])
    np.testing.assert_allclose(limits("cart-pole"), [[-1.0, -np.inf], [1.0, np.inf]])
    home = mechanism("ur5").arm.home
    np.testing.assert_allclose(limits("ur5", position_margin=1.0), [home - 1.0, home + 1.0])
    assert np.isinf(limits("ur5", soft=True)).all()
    soft = DirectParams(position_limited=True, soft=True).problem
    x, u = np.array([[-1.1, 0.0], [0.0, 0.0]]), np.zeros((2, 1))
    beyond, within = soft.cost.running(x, u)
    assert beyond - within == pytest.approx(SOFT_WEIGHT * 0.1**2)
    assert np.isinf(DirectParams().problem.x_lower).all()


@pytest.mark.parametrize("system", TASK_TITLES)
def test_velocities_that_run_away_are_limited(system: str) -> None:
    params = DirectParams(system=system, objective="fastest-end")
    limited = system in ("double-pendulum", "ur5")
    assert params.acts("speed_limit") == limited != params.acts("speed_limited")
    n = params.task.mechanism.nq
    np.testing.assert_array_equal(params.problem.x_upper[n:], 3.0 if limited else np.inf)


def test_balls_are_dragged() -> None:
    params = DirectParams(system="ur5", obstacle=True)
    assert edit_balls(params, "target", (0.301, 0.0, 2.0)) == {
        "target_x": 0.3,
        "target_y": 0.0,
        "target_z": 1.0,
    }
    assert set(edit_balls(params, "obstacle", (0.1, 0.2, 0.3))) == {
        "obstacle_x",
        "obstacle_y",
        "obstacle_z",
    }
    assert not edit_balls(params, "other", (0.0, 0.0, 0.0))
    assert params.problem.path is not None
    assert DirectParams(system="ur5", obstacle=True, soft=True).problem.path is None
