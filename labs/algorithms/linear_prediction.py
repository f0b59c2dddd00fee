"""Incremental prediction with linear function approximation (notes, 3.7.2 and 3.7.3): steps down
the squared error of one sample, v(x, w) = phi(x)' w.

    oracle              w <- w + alpha (V(x_t) - v(x_t)) phi(x_t)
    gradient MC         the same with J_t for V(x_t)
    semi-gradient TD    delta_t = l_t + gamma v(x_(t+1)) - v(x_t)
                        w <- w + alpha rho_t delta_t phi(x_t)
    n-step              the same with the n-step return for the target
    TD(lambda)          e <- rho_t (gamma lambda e + phi(x_t)),  w <- w + alpha delta_t e

The first two go down the gradient of the value error and come to its least; only who knows the
answer can be an oracle (3.7.2). The others leave out that their target moves with w. On-policy
they come near it all the same; off-policy, rho_t the importance ratio, they may diverge. The cure,
beyond the notes, is a true gradient of another error (TDC; Sutton, Maei and others 2009), with
second weights h that track delta:

    TDC    w <- w + alpha rho (delta phi(x) - gamma phi(x') (h' phi(x)))
           h <- h + beta rho (delta - h' phi(x)) phi(x)

alpha_n = alpha / n^omega at a learner's n-th update. Each update takes one episode and changes w,
h (d,) and count (1,) in place; v = 0 in terminal states by their features. The last n steps of an
n-step method learn at the episode's end, as in the tabular form."""

import numpy as np

from labs.algorithms.features import Features, add_features, evaluate
from labs.algorithms.monte_carlo import costs_to_go
from labs.algorithms.temporal_difference import n_step_return
from labs.compiled import compiled, inlined
from labs.problems.episodes import UpdateRule, step_size
from labs.problems.prediction import Episode, PredictionTask, importance_ratio


@inlined
def _update_weights(
    features: Features,
    rule: UpdateRule,
    w: np.ndarray,
    count: np.ndarray,
    x: int,
    target: float,
    rho: float = 1.0,
) -> None:
    """v(x) towards a target."""
    count[0] += 1
    weight = step_size(rule, count[0]) * rho
    add_features(features, w, x, weight * (target - evaluate(features, w, x)))


@compiled
def gradient_oracle(
    task: PredictionTask,
    features: Features,
    episode: Episode,
    T: int,
    rule: UpdateRule,
    w: np.ndarray,
    count: np.ndarray,
) -> None:
    """The true value of the policy asked for is the target, whichever is followed."""
    for t in range(T):
        x = episode.states[t]
        _update_weights(features, rule, w, count, x, task.truth[x])


@compiled
def gradient_monte_carlo(
    task: PredictionTask,
    features: Features,
    episode: Episode,
    T: int,
    rule: UpdateRule,
    w: np.ndarray,
    count: np.ndarray,
) -> None:
    """Every visit moves; from an episode that was cut nothing is learned."""
    if not task.task.terminal[episode.states[T]]:
        return
    costs_to_go(task.task.gamma, episode, T, 0.0)
    for t in range(T):
        _update_weights(features, rule, w, count, episode.states[t], episode.returns[t])


@compiled
def semi_gradient_td(
    task: PredictionTask,
    features: Features,
    episode: Episode,
    T: int,
    rule: UpdateRule,
    w: np.ndarray,
    count: np.ndarray,
) -> None:
    """Semi-gradient TD(0)."""
    for t in range(T):
        x, y = episode.states[t], episode.states[t + 1]
        target = episode.costs[t] + task.task.gamma * evaluate(features, w, y)
        rho = importance_ratio(task, x, episode.controls[t])
        _update_weights(features, rule, w, count, x, target, rho)


@compiled
def semi_gradient_n_step(
    task: PredictionTask,
    features: Features,
    episode: Episode,
    T: int,
    rule: UpdateRule,
    w: np.ndarray,
    count: np.ndarray,
) -> None:
    """n-step semi-gradient TD, on-policy."""
    states, gamma, first = episode.states, task.task.gamma, max(T - rule.n, 0)
    for t in range(first):
        rest = evaluate(features, w, states[t + rule.n])
        J = n_step_return(gamma, episode, t, rule.n, rest)
        _update_weights(features, rule, w, count, states[t], J)
    costs_to_go(gamma, episode, T, evaluate(features, w, states[T]), first)
    for t in range(first, T):
        _update_weights(features, rule, w, count, states[t], episode.returns[t])


@compiled
def semi_gradient_lambda(
    task: PredictionTask,
    features: Features,
    episode: Episode,
    T: int,
    rule: UpdateRule,
    w: np.ndarray,
    count: np.ndarray,
) -> None:
    """Semi-gradient TD(lambda), accumulating traces of all weights."""
    trace, gamma = np.zeros(len(w)), task.task.gamma
    for t in range(T):
        x, y = episode.states[t], episode.states[t + 1]
        count[0] += 1
        rho, alpha = importance_ratio(task, x, episode.controls[t]), step_size(rule, count[0])
        fading = rho * gamma * rule.trace_decay
        for i in range(len(w)):
            trace[i] *= fading
        add_features(features, trace, x, rho)
        target = episode.costs[t] + gamma * evaluate(features, w, y)
        weight = alpha * (target - evaluate(features, w, x))
        for i in range(len(w)):
            w[i] += weight * trace[i]


@compiled
def gradient_td(
    task: PredictionTask,
    features: Features,
    episode: Episode,
    T: int,
    rule: UpdateRule,
    w: np.ndarray,
    h: np.ndarray,
    count: np.ndarray,
) -> None:
    """TDC, with beta = rule.beta."""
    gamma = task.task.gamma
    for t in range(T):
        x, y = episode.states[t], episode.states[t + 1]
        count[0] += 1
        rho, alpha = importance_ratio(task, x, episode.controls[t]), step_size(rule, count[0])
        target = episode.costs[t] + gamma * evaluate(features, w, y)
        delta, expected = target - evaluate(features, w, x), evaluate(features, h, x)
        add_features(features, w, x, alpha * rho * delta)
        add_features(features, w, y, -alpha * rho * gamma * expected)
        add_features(features, h, x, rule.beta * rho * (delta - expected))
