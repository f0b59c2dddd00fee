"""Episodes under a policy: how often what happens in them, and what they count."""

import numpy as np
import pytest

from labs.errors import LabError
from labs.problems.finite_mdp import FiniteMDP
from labs.problems.prediction import (
    PredictionTask,
    empty_episode,
    importance_ratio,
    prediction_task,
    sample_episode,
    weighted_error,
)
from labs.random_numbers import random_states

MDP = FiniteMDP(
    np.array([[1.0, 2.0, 4.0], [3.0, 5.0, 7.0], [0.0, 0.0, 0.0]]),
    0.9,
    np.array([0, 0, 1], bool),
    P=np.array(
        [
            [[0.2, 0.7, 0.1], [0.5, 0.0, 0.5], [0.0, 0.0, 1.0]],
            [[0.0, 0.6, 0.4], [0.9, 0.0, 0.1], [0.0, 0.0, 1.0]],
            [[0.3, 0.3, 0.4], [0.1, 0.8, 0.1], [0.0, 0.0, 1.0]],
        ]
    ),
)
POLICY = np.array([[0.5, 0.0, 0.5], [0.25, 0.75, 0.0], [1.0, 0.0, 0.0]])


def counted(task: PredictionTask, episodes: int) -> tuple[np.ndarray, np.ndarray]:
    """(X, U) how often each control was applied and (X, U, X) where it led."""
    room, random = empty_episode(task.task.horizon), random_states(np.random.default_rng(1), 1)[0]
    led = np.zeros((3, 3, 3))
    for _ in range(episodes):
        T = sample_episode(task, random, room)
        np.add.at(led, (room.states[:T], room.controls[:T], room.states[1 : T + 1]), 1.0)
        paid = MDP.C[room.states[:T], room.controls[:T]]
        np.testing.assert_array_equal(room.costs[:T], paid)
        assert task.task.horizon == T or room.states[T] == 2
    return led.sum(axis=2), led


@pytest.mark.parametrize("even", [False, True])
def test_episodes_follow_policy_and_dynamics(even: bool) -> None:
    policy = np.full((3, 3), 1 / 3) if even else POLICY
    task = prediction_task(MDP, policy, np.zeros(3), [0, 1], 30)
    tried, led = counted(task, 8000)
    shares = tried[:2] / tried[:2].sum(axis=1, keepdims=True)
    np.testing.assert_allclose(shares, policy[:2], atol=0.02)
    assert (tried[:2][policy[:2] == 0.0] == 0.0).all()
    for x in range(2):
        for u in np.flatnonzero(policy[x]):
            np.testing.assert_allclose(led[x, u] / tried[x, u], MDP.probabilities[u, x], atol=0.025)


def test_a_deterministic_policy_is_followed() -> None:
    task = prediction_task(MDP, np.array([2, 1, 0]), np.zeros(3), [0], 30)
    tried, _ = counted(task, 300)
    assert tried[[0, 0, 1, 1], [0, 1, 0, 2]].sum() == 0.0


def test_the_ratio_turns_one_policy_s_mean_into_another_s() -> None:
    wanted = np.array([[0.1, 0.0, 0.9], [1.0, 0.0, 0.0], [0.3, 0.3, 0.4]])
    wide = np.full((3, 3), 1 / 3)
    task = prediction_task(MDP, wide, np.zeros(3), [0], 30, target=wanted)
    ratios = np.array([[importance_ratio(task, x, u) for u in range(3)] for x in range(3)])
    np.testing.assert_allclose(ratios * wide, wanted, atol=1e-15)
    assert importance_ratio(prediction_task(MDP, wide, np.zeros(3), [0], 30), 0, 1) == 1.0
    with pytest.raises(LabError, match="never tries"):
        prediction_task(MDP, POLICY, np.zeros(3), [0], 30, target=wide)


def test_errors_are_weighed() -> None:
    truth = np.array([1.0, 2.0, 0.0])
    alike = prediction_task(MDP, POLICY, truth, [0], 30)
    assert weighted_error(alike, np.array([2.0, 5.0, 9.0])) == pytest.approx(np.sqrt(10 / 2))
    chosen = prediction_task(MDP, POLICY, truth, [0], 30, weight=np.array([3.0, 1.0, 0.0]))
    assert weighted_error(chosen, np.array([2.0, 5.0, 9.0])) == pytest.approx(np.sqrt(12 / 4))
    with pytest.raises(LabError, match="finite number"):
        prediction_task(MDP, POLICY, np.array([np.inf, 0.0, 0.0]), [0], 30)
