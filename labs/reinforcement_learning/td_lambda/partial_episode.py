"""The walk in the scene: one episode after another, learned from step by step by one or two methods
as it goes on.

What happens does not depend on what is learned, so that an episode is drawn first and then walked.
What has been learned after t of its steps is what the method makes of these steps: it is computed
from the values before the episode, anew at each step, so that a slider acts on the whole of it."""

from typing import NamedTuple

import numpy as np

from labs.algorithms.monte_carlo import every_visit
from labs.algorithms.td_lambda import eligibility_traces, lambda_return, true_online
from labs.algorithms.temporal_difference import n_step, n_step_ongoing, td0
from labs.problems.episodes import UpdateRule
from labs.problems.prediction import Episode, empty_episode, sample_episode
from labs.reinforcement_learning.td_lambda.tasks import PredictionPlace

END_OF_EPISODE_METHODS = ("forward", "monte-carlo")
"""Methods that learn nothing before an episode is over."""


class PartialEpisode(NamedTuple):
    """An episode of T steps, and how many of them were walked."""

    states: np.ndarray
    """(T + 1,) int64."""
    costs: np.ndarray
    """(T,)."""
    done: int = 0

    @property
    def over(self) -> bool:
        return self.done == len(self.costs)


def draw_episode(place: PredictionPlace, random: np.ndarray) -> PartialEpisode:
    """An episode before its first step. `random` (4,) changes in place."""
    room = empty_episode(place.task.task.horizon)
    T = int(sample_episode(place.task, random, room))
    return PartialEpisode(room.states[: T + 1].copy(), room.costs[:T].copy())


def updated_values(
    place: PredictionPlace, method: str, rule: UpdateRule, V: np.ndarray, steps: PartialEpisode
) -> np.ndarray:
    """(X,) the values after the steps done, from V (X,), those before the episode."""
    V, N, t = V.copy(), np.zeros(len(V), np.int32), steps.done
    gamma, over = place.task.task.gamma, steps.over
    if not over and (rule.offline or method in END_OF_EPISODE_METHODS):
        return V
    episode = Episode(steps.states, np.zeros(0, np.int64), steps.costs, np.zeros(len(steps.costs)))
    ended = bool(place.task.task.terminal[steps.states[-1]])
    match method:
        case "td0":
            td0(gamma, episode, t, rule, V, N)
        case "n-step" if over:
            n_step(gamma, episode, t, rule, V, N)
        case "n-step":
            n_step_ongoing(gamma, episode, t, rule, V, N)
        case "forward":
            lambda_return(gamma, episode, t, rule, V, N)
        case "backward":
            eligibility_traces(gamma, episode, t, rule, V, N)
        case "true-online":
            true_online(gamma, episode, t, rule, V, N)
        case _:
            every_visit(gamma, episode, t, ended, rule, V, N)
    return V


def eligibility(
    gamma: float, method: str, rule: UpdateRule, steps: PartialEpisode, states: int
) -> np.ndarray:
    """(X,) e: how much the surprise of the last step done counts in the update of each of so many
    states. Of TD(lambda) it is the eligibility trace. A method that waits has one, too: while the
    values stand still, the n-step return less V(x_t) is the sum of gamma^k delta_(t+k) over the
    next n steps, and so e holds gamma^k for a visit of k < n steps ago."""
    visited = steps.states[: steps.done]
    age = np.arange(len(visited))[::-1]
    if method == "true-online":
        return _dutch_trace(gamma * rule.trace_decay, rule.alpha, visited, states)
    fading = gamma * (rule.trace_decay if method in ("forward", "backward") else 1.0)
    window = {"td0": 1, "n-step": rule.n}.get(method, len(visited))
    return np.bincount(visited, np.where(age < window, fading**age, 0.0), minlength=states)


def _dutch_trace(fading: float, alpha: float, visited: np.ndarray, states: int) -> np.ndarray:
    """e / alpha of true online TD(lambda)."""
    trace = np.zeros(states)
    for x in visited:
        trace *= fading
        trace[x] += 1.0 - alpha * trace[x]
    return trace


def return_weights(method: str, rule: UpdateRule, ahead: int) -> np.ndarray:
    """(N,) the weight of each n-step return, n = 1 to N, in the target of a state N = `ahead` steps
    before the end; the last return is Monte Carlo's."""
    n = np.arange(1, ahead + 1)
    if method in ("td0", "n-step", "monte-carlo"):
        one = {"td0": 1, "n-step": min(rule.n, ahead)}.get(method, ahead)
        return np.asarray(n == one, float)
    lam = rule.trace_decay
    return np.asarray(np.where(n < ahead, 1.0 - lam, 1.0) * lam ** (n - 1.0))


def n_step_returns(gamma: float, V: np.ndarray, steps: PartialEpisode) -> np.ndarray:
    """(t,) J^(n) of the first state of the episode, n = 1 to the steps done, with the values V
    (X,) from before it."""
    t = steps.done
    discount = gamma ** np.arange(t + 1.0)
    paid = np.cumsum(discount[:-1] * steps.costs[:t])
    return np.asarray(paid + discount[1:] * V[steps.states[1 : t + 1]])
