"""Small tasks on which semi-gradient TD with linear features diverges. All costs are 0: the true
value is 0 and can be written.

Baird (1995; Sutton and Barto, 2nd edition, figure 11.1). Seven states, eight weights. `dashed`
leads to any of the upper six states, `solid` to the seventh. The value of always `solid` is asked
for while `dashed` is chosen 6 times of 7, gamma = 0.99.

Tsitsiklis and Van Roy (1996). One weight, two states of the values w and 2 w; the first leads to
the second, which stays with probability 1 - epsilon and ends else. Learning from both states alike,
the mean step is proportional to (gamma (6 - 4 epsilon) - 5) w: it diverges where

    gamma > 5 / (6 - 4 epsilon).

From the first state's transition alone, w to 2 w, it diverges where gamma > 1/2."""

from typing import NamedTuple

import numpy as np

from labs.algorithms.features import Features, features_from_matrix
from labs.problems.finite_mdp import FiniteMDP
from labs.problems.prediction import PredictionTask, prediction_task


class Counterexample(NamedTuple):
    """A task of prediction, its features and the weights to begin with."""

    task: PredictionTask
    features: Features
    w: np.ndarray
    """(d,)"""
    mdp: FiniteMDP


def baird(horizon: int = 1000, gamma: float = 0.99, off_policy: bool = True) -> Counterexample:
    """Baird's star, in episodes cut after `horizon` steps. On-policy, the value of the behaviour
    itself is learned."""
    P = np.zeros((2, 7, 7))
    P[0, :, :6] = 1.0 / 6.0
    P[1, :, 6] = 1.0
    mdp = FiniteMDP(np.zeros((7, 2)), gamma, np.zeros(7, bool), P=P)
    behaviour, solid = np.tile([6.0 / 7.0, 1.0 / 7.0], (7, 1)), np.tile([0.0, 1.0], (7, 1))
    target = solid if off_policy else None
    task = prediction_task(mdp, behaviour, np.zeros(7), range(7), horizon, target=target)
    phi = np.zeros((7, 8))
    phi[:6, :6] = 2.0 * np.eye(6)
    phi[:6, 7] = 1.0
    phi[6, 6:] = 1.0, 2.0
    return Counterexample(task, features_from_matrix(phi), np.array([1.0] * 6 + [10.0, 1.0]), mdp)


def two_states(
    gamma: float, epsilon: float, starts: tuple[int, ...] = (0, 1), horizon: int = 1
) -> Counterexample:
    """Tsitsiklis and Van Roy's, from `starts`, each alike: (0, 1) with a horizon of 1 is learning
    from both transitions alike, (0,) from the first alone; with a long horizon, on-policy."""
    P = np.array([[[0.0, 1.0, 0.0], [0.0, 1.0 - epsilon, epsilon], [0.0, 0.0, 1.0]]])
    mdp = FiniteMDP(np.zeros((3, 1)), gamma, np.arange(3) == 2, P=P)
    task = prediction_task(mdp, np.zeros(3, int), np.zeros(3), starts, horizon)
    return Counterexample(
        task, features_from_matrix(np.array([[1.0], [2.0], [0.0]])), np.ones(1), mdp
    )
