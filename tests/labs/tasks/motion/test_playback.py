"""A plan on the plant: against the plan itself, and against a loop written out."""

import numpy as np
import pytest

from labs.algorithms.integrators import rk4
from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import Mechanism, mechanism
from labs.tasks.motion.playback import (
    FEEDBACK,
    LARGEST_VELOCITY,
    OPEN_LOOP,
    SUBSTEP,
    NominalTrajectory,
    Playback,
    advance_playback,
    apply_state_jump,
    start_playback,
)


def random_plan(name: str, h: float, N: int = 12) -> NominalTrajectory:
    moved, rng = mechanism(name), np.random.default_rng(2)
    U = rng.normal(size=(N, moved.nu))
    X = DiscreteMechanism(moved, h, "rk4").rollout(np.zeros(moved.nx), U)
    return NominalTrajectory(X, U, rng.normal(size=(N, moved.nu, moved.nx)), h)


def play(
    plan: NominalTrajectory, plant: Mechanism, substeps: int = 2, **changes: np.ndarray
) -> Playback:
    runs, held = start_playback(plan), np.zeros(plant.nu)
    while not runs.finished(plan):
        runs = advance_playback(plan, runs, (plant.acceleration(held), held), substeps, **changes)
    return runs


def test_at_the_plans_own_step_both_runs_are_the_plan() -> None:
    plan = random_plan("double-pendulum", SUBSTEP)
    runs = play(plan, mechanism("double-pendulum"))
    for run in (FEEDBACK, OPEN_LOOP):
        np.testing.assert_array_equal(runs.X[run], plan.X)
        np.testing.assert_array_equal(runs.U[run], plan.U)
    assert runs.clock == plan.N


@pytest.mark.parametrize("h", [0.005, 0.01, 0.04])
@pytest.mark.parametrize("substeps", [1, 2, 7])
def test_runs_are_those_of_a_loop_written_out(h: float, substeps: int) -> None:
    """On another plant, with a limit and a disturbance; however many substeps go at once."""
    plan, plant = random_plan("cart-pole", h), mechanism("cart-pole", 0.4, 0.2)
    limit, disturbance = np.array([0.8]), np.array([0.3])
    runs = play(plan, plant, substeps, bound=limit, disturbance=disturbance)
    assert np.abs(runs.U[FEEDBACK] - runs.U[OPEN_LOOP]).max() > 1e-3, "K does something"
    for run, K in ((FEEDBACK, plan.K), (OPEN_LOOP, 0.0 * plan.K)):
        x = plan.X[0]
        for k in range(plan.N):
            u = np.clip(plan.U[k] + K[k] @ (x - plan.X[k]), -limit, limit)
            np.testing.assert_allclose(runs.X[run, k], x, atol=1e-12)
            np.testing.assert_allclose(runs.U[run, k], u, atol=1e-12)
            a = plant.acceleration(u + disturbance)
            for _ in range(round(h / SUBSTEP)):
                x = np.concatenate(rk4(a, x[:2], x[2:], SUBSTEP))
        np.testing.assert_allclose(runs.X[run, -1], x, atol=1e-12)


def test_noise_enters_through_the_feedback_alone() -> None:
    plan, plant = random_plan("pendulum", 0.01), mechanism("pendulum")
    noise = np.array([[0.1, -0.2], [9.0, 9.0]])  # between ticks nobody looks
    runs = play(plan, plant, 2, noise=noise)
    np.testing.assert_allclose(runs.X[OPEN_LOOP], plan.X, atol=1e-6)
    assert runs.U[FEEDBACK, 0] == pytest.approx(plan.U[0] + plan.K[0] @ noise[0])


def test_a_blow_changes_both() -> None:
    plan = random_plan("pendulum", 0.01)
    runs = apply_state_jump(start_playback(plan), np.array([[0.0, 1.0], [0.0, 2.0]]))
    np.testing.assert_array_equal(runs.x, plan.X[0] + [[0.0, 1.0], [0.0, 2.0]])


def test_a_run_that_diverges_stops_alone() -> None:
    plan, plant = random_plan("pendulum", 0.01, N=40), mechanism("pendulum")
    wild = NominalTrajectory(plan.X, plan.U, np.full_like(plan.K, 1e6), plan.h)
    noise = np.full((2, 2), 1e-3)
    runs = play(wild, plant, 2, noise=noise)
    np.testing.assert_array_equal(runs.diverged, [True, False])
    assert np.abs(runs.x[:, 1]).max() <= LARGEST_VELOCITY
    np.testing.assert_allclose(runs.X[OPEN_LOOP], plan.X, atol=1e-6)


def test_advancing_leaves_what_was_alone() -> None:
    plan, plant = random_plan("pendulum", 0.01), mechanism("pendulum")
    runs, held = start_playback(plan), np.zeros(1)
    before = [a.copy() for a in (runs.x, runs.u, runs.X, runs.U, runs.diverged)]
    advance_playback(plan, runs, (plant.acceleration(held), held), 4)
    for a, b in zip(before, (runs.x, runs.u, runs.X, runs.U, runs.diverged), strict=True):
        np.testing.assert_array_equal(a, b)
