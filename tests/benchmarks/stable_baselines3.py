"""Our deep Q-learning beside Stable-Baselines3's, on the same pendulum.

Equal network (64, 64), mini-batch 64, an update every 4 steps, a target network, Adam; one thread
each. Stable-Baselines3 drives our environment through Gymnasium: one, or 16 in turn as we do."""

import time
import warnings
from importlib import import_module
from typing import Any

import numpy as np

from labs.algorithms import dqn
from labs.tasks.environments.swing_up import swing_up

HIDDEN, BATCH, UPDATE_EVERY, ROBOTS = (64, 64), 64, 4, 16
STEPS, PEER_STEPS, WARM_UP, REPEATS = 40_000, 4_000, 512, 3
ASKED = 10.0


def deep_q_learning() -> None:
    """Environment steps a second, updates included: at least ten times Stable-Baselines3's."""
    try:
        warnings.simplefilter("ignore")
        torch: Any = import_module("torch")
        peer: Any = import_module("stable_baselines3")
    except ImportError:
        print("Stable-Baselines3 is not installed: pip install 'orclab[peers]'")
        return
    torch.set_num_threads(1)
    ours = min(_own_step_seconds() for _ in range(REPEATS))
    print(f"ours, {ROBOTS} robots: {1.0 / ours:8.0f} steps a second")
    for robots in (1, ROBOTS):
        theirs = min(_sb3_step_seconds(peer, robots) for _ in range(REPEATS))
        print(
            f"Stable-Baselines3 {peer.__version__}, {robots:2} robots: {1.0 / theirs:6.0f} steps "
            f"a second; ours {theirs / ours:.0f} times (asked: {ASKED:.0f})"
        )


def _own_step_seconds() -> float:
    """[s] of a step."""
    environment = swing_up("pendulum")
    options = dqn.DqnOptions(batch_size=BATCH, update_every=UPDATE_EVERY, warm_up=WARM_UP)
    agent = dqn.init(environment, HIDDEN, np.random.default_rng(0), many=ROBOTS)
    agent = dqn.step(environment, options, agent, 2 * WARM_UP // ROBOTS)  # compiled, warm
    begin = time.process_time()
    before = agent.updates
    agent = dqn.step(environment, options, agent, STEPS // ROBOTS)
    assert agent.updates - before == STEPS // UPDATE_EVERY
    return (time.process_time() - begin) / STEPS


def _sb3_step_seconds(peer: Any, robots: int) -> float:
    """[s] of a step."""
    envs = peer.common.env_util.make_vec_env("labs.gym:orclab/Pendulum-v0", robots, seed=0)
    many = max(1, UPDATE_EVERY // robots)
    learner = peer.DQN(
        "MlpPolicy",
        envs,
        learning_rate=1e-3,
        batch_size=BATCH,
        buffer_size=50_000,
        learning_starts=WARM_UP,
        train_freq=many,
        gradient_steps=many * robots // UPDATE_EVERY,
        target_update_interval=200 * UPDATE_EVERY,
        policy_kwargs={"net_arch": list(HIDDEN)},
        device="cpu",
        seed=0,
    )
    learner.learn(2 * WARM_UP)
    begin, before = time.process_time(), learner._n_updates
    learner.learn(PEER_STEPS, reset_num_timesteps=False)
    seconds = time.process_time() - begin
    updates, wanted = learner._n_updates - before, PEER_STEPS // UPDATE_EVERY
    assert abs(updates - wanted) < 0.02 * wanted, updates
    return seconds / PEER_STEPS
