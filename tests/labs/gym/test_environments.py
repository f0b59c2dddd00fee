"""The labs' tasks in Gymnasium: by its own checker, and step by step as the labs have them."""

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import labs.gym
from labs.errors import LabError
from labs.gym.tables import TableEnv
from labs.gym.torques import TorqueEnv
from labs.problems.episodes import transition
from labs.random_numbers import random_states
from labs.tasks.random_walk.walks import MAX_STEPS

NAMES = [*labs.gym.CONTINUOUS_HORIZONS, *labs.gym.FINITE_HORIZONS]
VARIANTS: list[tuple[str, dict[str, Any]]] = [
    *((name, {}) for name in NAMES),
    ("GridWorld", {"map": "windy", "kings": True, "slip": 0.1}),
    ("GridWorld", {"map": "frozen lake", "slip": 2 / 3, "sideways": True, "living": 0.0}),
    ("GridWorld", {"map": "S.\n.G"}),
    ("RandomWalk", {"states": 1000, "reach": 100}),
]


def made(name: str, **settings: Any) -> Any:
    """The environment without what `make` wraps around it."""
    return gymnasium.make(f"orclab/{name}-v0", **settings).unwrapped


@pytest.mark.parametrize(("name", "settings"), VARIANTS, ids=str)
def test_gymnasiums_own_checker_has_nothing_to_say(name: str, settings: dict[str, Any]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(made(name, **settings), skip_render_check=False)


@pytest.mark.parametrize("name", labs.gym.CONTINUOUS_HORIZONS)
def test_a_robot_steps_bit_for_bit_as_in_the_lab(name: str) -> None:
    """Through a whole episode that `make` truncates; its start is that of the lab's generator."""
    env = gymnasium.make(f"orclab/{name}-v0")
    bare = env.unwrapped
    assert isinstance(bare, TorqueEnv)
    lab, controls = bare.environment, np.random.default_rng(1)
    seen, info = env.reset(seed=7)
    X = lab.initial_states(random_states(np.random.Generator(np.random.PCG64(7)), 1)[0], 1)
    assert np.array_equal(info["state"], X[0])
    truncated, steps = False, 0
    while not truncated:
        u = np.int64(controls.integers(lab.control_count))
        X, costs, _ = lab.step(X, np.array([u]))
        seen, reward, terminated, truncated, info = env.step(u)
        assert np.array_equal(seen, lab.observe(X)[0])
        assert np.array_equal(info["state"], X[0])
        assert reward == -costs[0]
        assert not terminated
        assert env.observation_space.contains(seen)
        steps += 1
    assert steps == lab.horizon == labs.gym.CONTINUOUS_HORIZONS[name]


def test_a_table_draws_as_the_learners_do_and_ends_at_the_goal() -> None:
    env = made("GridWorld", map="cliff", slip=0.2)
    assert isinstance(env, TableEnv)
    x, _ = env.reset(seed=3)
    assert x == env.mdp.X - 2  # the start, in the last row; the cliff's cells are no states
    random, goal, terminated, steps = env.random.copy(), env.mdp.X - 1, False, 0
    up, right, down = 0, 1, 2
    while not terminated:
        u = up if x == goal - 1 else right if x % 12 < 11 else down
        after, cost = transition(env.task, int(x), u, random), env.mdp.C[x, u]
        x, reward, terminated, truncated, _ = env.step(np.int64(u))
        assert (int(x), reward, truncated) == (after, -cost, False)
        steps += 1
    assert x == goal
    assert steps >= 13


def test_a_walk_ends_at_its_ends_and_costs_there() -> None:
    env = made("RandomWalk", states=5, left=0.0, right=-1.0)
    assert env.reset(seed=0)[0] == 3
    rewards = [env.step(np.int64(1))[1:3] for _ in range(3)]
    assert rewards == [(0.0, False), (0.0, False), (1.0, True)]
    assert labs.gym.FINITE_HORIZONS["RandomWalk"] == MAX_STEPS


def test_seeds_repeat_and_without_one_episodes_differ() -> None:
    env = made("Pendulum")
    first, _ = env.reset(seed=5)
    second, _ = env.reset()
    assert not np.array_equal(first, second)
    assert np.array_equal(env.reset(seed=5)[0], first)
    assert np.array_equal(env.reset()[0], second)
    seen, info = env.reset(options={"state": [np.pi, 0.0]})
    assert info["state"].tolist() == [np.pi, 0.0]
    np.testing.assert_allclose(seen, [1.0, 0.0, 0.0], atol=1e-7)


def test_what_is_no_map_is_refused_in_a_sentence() -> None:
    with pytest.raises(LabError, match="no goal G"):
        made("GridWorld", map="S..")


def test_many_at_once_and_by_the_modules_name() -> None:
    """As Stable-Baselines3 and CleanRL make them."""
    many = gymnasium.make_vec("labs.gym:orclab/UR5Reach-v0", 2, vectorization_mode="sync")
    seen, _ = many.reset(seed=1)
    assert seen.shape == (2, 8)
    assert not np.array_equal(seen[0], seen[1])
    many.close()
