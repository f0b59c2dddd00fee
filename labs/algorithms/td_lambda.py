"""TD(lambda) (notes, 3.5.6): the n-step returns of all n at once, with weights (1 - lambda)
lambda^(n-1); in an episode of T steps the rest of the weight, lambda^(T-t-1), is on the last.

    forward    J_t = l_t + gamma ((1 - lambda) V(x_(t+1)) + lambda J_(t+1)),  J_T = V(x_T)
               V(x_t) <- V(x_t) + alpha_n (J_t - V(x_t))                   at the episode's end
    backward   delta_t = l_t + gamma V(x_(t+1)) - V(x_t)                   at each step
               e(x) <- gamma lambda e(x) + 1(x = x_t)
               V(x) <- V(x) + alpha_n delta_t e(x)                         for all x

V = 0 in terminal states. The returns of the forward view are taken with the values from before
the episode. Offline, where values stand still through an episode, both views make the same update
but for rounding; lambda = 0 is TD(0), lambda = 1 every-visit Monte Carlo. Online they differ.

True online TD(lambda) is beyond the notes (van Seijen and Sutton 2014). With a trace that holds
the step size,

    e(x) <- gamma lambda e(x) + alpha (1 - gamma lambda e(x_t)) 1(x = x_t)
    d = V_t(x_t) - V_(t-1)(x_t)          what step t - 1 has changed of the value of x_t
    V(x) <- V(x) + (delta_t + d) e(x) - alpha d 1(x = x_t)

it is at each step exactly where the forward view would be, had it been run anew, online, up to
that step. It has no offline form.

Each update takes one episode and changes V and visits in place, as in `monte_carlo`."""

import numpy as np

from labs.algorithms.monte_carlo import update_to_returns
from labs.compiled import compiled
from labs.problems.episodes import UpdateRule, step_size
from labs.problems.prediction import Episode

NEGLIGIBLE_TRACE = 1e-12
"""A trace below this is over: it is beyond the digits of a float."""


@compiled
def lambda_return(
    gamma: float, episode: Episode, T: int, rule: UpdateRule, V: np.ndarray, N: np.ndarray
) -> None:
    """The forward view."""
    lam, states = rule.trace_decay, episode.states
    J = V[states[T]]
    for t in range(T - 1, -1, -1):
        J = episode.costs[t] + gamma * ((1.0 - lam) * V[states[t + 1]] + lam * J)
        episode.returns[t] = J
    update_to_returns(episode, T, rule, V, N)


@compiled
def eligibility_traces(
    gamma: float, episode: Episode, T: int, rule: UpdateRule, V: np.ndarray, N: np.ndarray
) -> None:
    """The backward view. Replacing traces are set to 1 by a visit instead of growing by 1."""
    learned = V.copy() if rule.offline else V
    states, fading = episode.states, gamma * rule.trace_decay
    trace, traced, many = np.zeros(len(V)), np.empty(len(V), np.int64), 0
    for t in range(T):
        x = states[t]
        N[x] += 1
        delta = episode.costs[t] + gamma * V[states[t + 1]] - V[x]
        if trace[x] == 0.0:
            traced[many] = x
            many += 1
        trace[x] = 1.0 if rule.replacing else trace[x] + 1.0
        i = 0
        while i < many:
            z = traced[i]
            weight = step_size(rule, N[z]) * trace[z]
            learned[z] += weight * delta
            trace[z] *= fading
            if trace[z] < NEGLIGIBLE_TRACE:
                trace[z] = 0.0
                many -= 1
                traced[i] = traced[many]
            else:
                i += 1
    if rule.offline:
        V[:] = learned


@compiled
def true_online(
    gamma: float, episode: Episode, T: int, rule: UpdateRule, V: np.ndarray, N: np.ndarray
) -> None:
    """True online TD(lambda)."""
    states, fading = episode.states, gamma * rule.trace_decay
    trace = np.zeros(len(V))
    before = V[states[0]]  # V_(t-1)(x_t)
    for t in range(T):
        x, ahead = states[t], V[states[t + 1]]
        N[x] += 1
        alpha, here = step_size(rule, N[x]), V[x]
        delta = episode.costs[t] + gamma * ahead - here
        kept = fading * trace[x]
        for z in range(len(V)):
            trace[z] *= fading
        trace[x] = kept + alpha * (1.0 - kept)
        for z in range(len(V)):
            V[z] += (delta + here - before) * trace[z]
        V[x] -= alpha * (here - before)
        before = ahead
