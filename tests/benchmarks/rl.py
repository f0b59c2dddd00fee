"""Reinforcement learning: sweeps of prediction, testbeds of bandits, and deep Q-learning."""

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from labs.algorithms import bandits, prediction
from labs.algorithms.exploration import BOLTZMANN, CONFIDENCE_BOUND, THOMPSON, BehaviourPolicy
from labs.problems.episodes import UpdateRule
from labs.tasks.random_walk.walks import NINETEEN_STATE_WALK, walk_task
from tests.benchmarks import dqn, stable_baselines3

STEPS, DECAYS = 2 ** np.arange(10), (0.0, 0.4, 0.8, 0.9, 0.95, 0.975, 0.99, 1.0)
ALPHAS = np.linspace(0.0, 1.0, 11)
RUNS, EPISODES = 100, 10
STRATEGIES = {
    "greedy": BehaviourPolicy(epsilon=0.0),
    "epsilon = 0.1": BehaviourPolicy(epsilon=0.1),
    "epsilon = 1/n": BehaviourPolicy(epsilon=1.0, decay=1.0),
    "Boltzmann": BehaviourPolicy(BOLTZMANN, beta=4.0),
    "lowest bound": BehaviourPolicy(CONFIDENCE_BOUND, bound=1.0),
    "Thompson": BehaviourPolicy(THOMPSON, bound=1.0),
}


def rl_benchmarks() -> None:
    """All of them."""
    for measure in (sweeps, dqn.training, stable_baselines3.deep_q_learning):
        measure()
        print()


def sweeps() -> None:
    """The 19-state walk, all n or lambda and alpha of the book's figures, 100 runs of 10 episodes:
    a second at most. 2000 ten-armed testbeds, 1000 turns, six strategies: a second at most."""
    _predict("n-step TD", prediction.N_STEP, [{"n": int(n)} for n in STEPS])
    decays = [{"trace_decay": decay} for decay in DECAYS]
    for name, method in (
        ("lambda-returns", prediction.LAMBDA_RETURN),
        ("eligibility traces", prediction.ELIGIBILITY_TRACES),
        ("true online TD(lambda)", prediction.TRUE_ONLINE),
    ):
        _predict(name, method, decays)
    _play()


def _predict(name: str, method: int, settings: Sequence[Mapping[str, Any]]) -> None:
    task = walk_task(NINETEEN_STATE_WALK)
    learners = prediction.init(task, RUNS, np.random.default_rng(0))
    prediction.step(task, UpdateRule(0.1), method, learners, 1)  # compiled
    begin, wall, steps = time.process_time(), time.perf_counter(), 0
    best: tuple[float, Mapping[str, Any], float] = (np.inf, {}, 0.0)
    for setting in settings:
        for alpha in ALPHAS:
            rule = UpdateRule(float(alpha), **setting)
            after = prediction.step(task, rule, method, learners, EPISODES)
            steps += int(after.lengths.sum())
            best = min(best, (float(after.errors.mean()), setting, alpha), key=lambda b: b[0])
    seconds, wall = time.process_time() - begin, time.perf_counter() - wall
    error, setting, alpha = best
    print(
        f"{name}: {seconds:.2f} s ({wall:.2f} s by the wall) for {len(settings) * len(ALPHAS)} "
        f"settings, {steps / seconds / 1e6:.0f} million steps a second; least error {error:.3f} at "
        f"{setting}, alpha = {alpha:.1f}"
    )


def _play() -> None:
    tasks = bandits.gaussian_testbed(2000, 10, np.random.default_rng(0))
    start = bandits.init(tasks, np.random.default_rng(1))
    bandits.step(tasks, STRATEGIES["greedy"], bandits.SAMPLE_MEAN, start, 1)  # compiled
    total = 0.0
    for name, strategy in STRATEGIES.items():
        begin = time.process_time()
        after = bandits.step(tasks, strategy, bandits.SAMPLE_MEAN, start, 1000)
        seconds = time.process_time() - begin
        total += seconds
        print(
            f"  {name}: {seconds:.2f} s, regret {after.regrets[-1]:.0f}, "
            f"{100 * after.best[-100:].mean():.0f} % best choices at the end"
        )
    print(f"testbed: {total:.2f} s for 2000 tasks, 1000 turns and {len(STRATEGIES)} strategies")
