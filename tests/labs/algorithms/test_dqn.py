"""Deep Q-learning on tasks whose answer is known, and on the pendulum."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from labs.algorithms import dqn
from labs.algorithms.dqn import DqnAgent, DqnOptions
from labs.problems.environment import Environment
from labs.random_numbers import uniform
from labs.tasks.environments.swing_up import swing_up

QUICK = DqnOptions(gamma=0.9, warm_up=100, target_every=50, epsilon_steps=2000, learning_rate=3e-3)


@dataclass(frozen=True)
class Corridor:
    """Five cells; a step to the left or to the right costs 1; the left end ends the task, but for
    `endless` ones, where it costs nothing to stay."""

    endless: bool = False
    horizon: int = 12
    nx, observation_size, control_count, substeps = 1, 5, 2, 1

    def initial_states(self, random: np.ndarray, many: int) -> np.ndarray:
        return np.array([[1.0 + int(4 * uniform(random))] for _ in range(many)])

    def observe(self, X: np.ndarray) -> np.ndarray:
        return np.asarray(np.eye(5, dtype=np.float32)[X[:, 0].astype(int)])

    def substep(self, X: np.ndarray, U: np.ndarray) -> np.ndarray:
        return np.asarray(np.clip(X + (2 * U[:, None] - 1), 0, 4))

    def step(self, X: np.ndarray, U: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        after = self.substep(X, U)
        costs = np.where((X[:, 0] == 0) & (after[:, 0] == 0), 0.0, 1.0)
        return after, costs, (after[:, 0] == 0) & (not self.endless)


def trained(environment: Environment, options: DqnOptions, rounds: int, seed: int = 0) -> DqnAgent:
    agent = dqn.init(environment, (32,), np.random.default_rng(seed), many=8, capacity=4000)
    return dqn.step(environment, options, agent, rounds)


@pytest.mark.parametrize(
    "options",
    [QUICK, QUICK._replace(double_q_learning=True), QUICK._replace(polyak=0.02)],
    ids=["C", "double", "Polyak"],
)
def test_q_of_a_corridor(options: DqnOptions) -> None:
    """Q(x, left) = 1 + 0.9 + ... (x terms); two steps more to the right, but at the wall one."""
    agent = trained(Corridor(), options, 1500)
    q = dqn.q_values(agent.sizes, agent.w, np.eye(5, dtype=np.float32))
    steps = np.array([[x, min(x + 2, 5)] for x in range(1, 5)])
    np.testing.assert_allclose(q[1:], (1 - 0.9**steps) / 0.1, atol=0.06)


def test_the_end_of_an_episode_is_not_the_end_of_the_task() -> None:
    """Where nothing ends the task, only its horizon, the last state's value counts: going on costs
    1 a step where it goes on for ever, and not less for being cut after 3 steps."""
    walls = replace(Corridor(endless=True), horizon=3)
    agent = trained(walls, QUICK, 1500)
    q = dqn.q_values(agent.sizes, agent.w, np.eye(5, dtype=np.float32))
    assert q[4, 0] == pytest.approx(1 + 0.9 + 0.81 + 0.729, abs=0.08)
    assert q[0, 0] == pytest.approx(0.0, abs=0.05)


def test_the_same_seed_learns_the_same_and_leaves_the_old_agent_alone() -> None:
    corridor = Corridor()
    agent = dqn.init(corridor, (16, 16), np.random.default_rng(3), many=4, capacity=500)
    kept = [part.copy() for part in (agent.w, *agent.adam, *agent.replay, agent.random)]
    once = dqn.step(corridor, QUICK, agent, 300)
    parts = dqn.step(corridor, QUICK, dqn.step(corridor, QUICK, agent, 120), 180)
    np.testing.assert_array_equal(once.w, parts.w)
    np.testing.assert_array_equal(once.target, parts.target)
    assert (once.steps, once.updates, once.loss) == (parts.steps, parts.updates, parts.loss)
    now = (agent.w, *agent.adam, *agent.replay, agent.random)
    for before, after in zip(kept, now, strict=True):
        np.testing.assert_array_equal(before, after)
    other = trained(corridor, QUICK, 10, seed=4)
    assert not np.array_equal(other.w[:50], once.w[:50])


def test_target_weights_are_those_of_the_last_multiple_of_c() -> None:
    corridor, options = Corridor(), QUICK._replace(target_every=7, update_every=8)
    agent = trained(corridor, options, 40)  # a round of 8 robots is one update
    seen = {}
    for _ in range(30):
        agent = dqn.step(corridor, options, agent)
        seen[agent.updates] = agent.w
        last = agent.updates - agent.updates % 7
        if last in seen:
            np.testing.assert_array_equal(agent.target, seen[last])
    assert len(seen) == 30


def test_without_replay_only_the_latest_are_learned_from() -> None:
    corridor = Corridor()
    agent = trained(corridor, QUICK, 100)
    spoilt = replace(agent, replay=agent.replay._replace(costs=np.full_like(agent.replay.costs, 9)))
    latest = QUICK._replace(experience_replay=False, update_every=8)
    one, other = (dqn.step(corridor, latest, start).w for start in (agent, spoilt))
    np.testing.assert_array_equal(one, other)
    one, other = (dqn.step(corridor, QUICK, start).w for start in (agent, spoilt))
    assert not np.array_equal(one, other)


def test_exploration_goes_down_a_line() -> None:
    options = DqnOptions(epsilon=1.0, epsilon_end=0.1, epsilon_steps=100)
    shares = [dqn.epsilon(options, steps) for steps in (0, 50, 100, 1000)]
    assert shares == pytest.approx([1.0, 0.55, 0.1, 0.1])


def test_the_pendulum_is_swung_up_after_twenty_thousand_steps() -> None:
    """Where doing nothing costs some 1200; about the best there is costs 125."""
    environment = swing_up("pendulum")
    agent = dqn.init(environment, (64, 64), np.random.default_rng(0))
    options = DqnOptions(cost_scale=10.0)
    starts = environment.initial_states(np.arange(1, 5, dtype=np.uint64), 50)
    costs = []
    for _ in range(12):
        agent = dqn.step(environment, options, agent, 100)
        costs.append(dqn.greedy_cost(environment, agent, starts).mean())
    assert min(costs) < 170.0
