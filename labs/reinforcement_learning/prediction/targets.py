"""The targets of Monte Carlo and TD(0), sampled: what an estimate of V(x) is moved to.

Monte Carlo   J = l_0 + gamma l_1 + ... of an episode that starts in x    unbiased, wide
TD(0)         l_0 + gamma V(x_1), V the estimates there are               biased, narrow
"""

import numpy as np

from labs.algorithms.temporal_difference import n_step_return
from labs.compiled import compiled
from labs.problems.prediction import PredictionTask, empty_episode, sample_episode

TARGET_EPISODES = 1000


def sample_targets(
    task: PredictionTask, x: int, V: np.ndarray, random: np.ndarray, many: int = TARGET_EPISODES
) -> np.ndarray:
    """(2, k): of both methods, from up to `many` episodes that start in x: Monte Carlo has none
    where an episode was cut, NaN. `random` (4,) uint64 stays as it is."""
    alone = task._replace(task=task.task._replace(starts=np.array([x], np.int64)))
    targets = np.empty((2, many))
    _sample(alone, V, random.copy(), targets)
    return targets


@compiled
def _sample(task: PredictionTask, V: np.ndarray, random: np.ndarray, targets: np.ndarray) -> None:
    gamma, episode = task.task.gamma, empty_episode(task.task.horizon)
    for k in range(targets.shape[1]):
        T = sample_episode(task, random, episode)
        J = n_step_return(gamma, episode, 0, T, 0.0)
        targets[0, k] = J if task.task.terminal[episode.states[T]] else np.nan
        targets[1, k] = episode.costs[0] + gamma * V[episode.states[1]]
