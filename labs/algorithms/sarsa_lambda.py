"""SARSA(lambda) by eligibility traces (notes, 3.5.6 and 3.6.5): every pair met in an episode
learns from every surprise that comes after it,

    delta = l + gamma Q(x', u') - Q(x, u)
    e(x, u) <- gamma lambda e(x, u) + 1          (accumulating; replacing: e(x, u) <- 1)
    Q(z) <- Q(z) + alpha_n(z) delta e(z)         for all pairs z

At lambda = 0 this is SARSA. Offline, with Q standing still through an episode, the sum of the
updates is that of the lambda-return, and at lambda = 1 of every-visit Monte Carlo. Accumulating
traces reach 1 / (1 - gamma lambda) where a pair repeats itself, and alpha times that may exceed 2:
then the estimates diverge. Replacing traces never exceed 1."""

import numpy as np

from labs.algorithms.exploration import Behavior, choose
from labs.compiled import compiled
from labs.problems.episodes import Problem, Rule, begin, step_size, transition

FAINT = 1e-12
"""A trace below this is over: it is beyond the digits of a float."""


@compiled
def sarsa_lambda(
    problem: Problem,
    behavior: Behavior,
    rule: Rule,
    q: np.ndarray,
    visits: np.ndarray,
    state: np.ndarray,
    costs: np.ndarray,
    lengths: np.ndarray,
) -> bool:
    """Episodes of one learner, as many as fit into `costs` and `lengths` (k,), which they fill.
    `q` (X, U), `visits` (X, U) and the random `state` change in place. False where an estimate
    left the rule's limit, and with it the last episode begun."""
    controls, fading = q.shape[1], problem.gamma * rule.decay
    trace, traced = np.zeros(q.size), np.empty(q.size, np.int64)
    sound = True
    for k in range(len(costs)):
        many = 0  # The pairs with a trace are traced[:many], each as x U + u.
        learned = q.copy() if rule.offline else q
        x, discount = begin(problem, state), 1.0
        u = choose(behavior, x, q, visits, state)
        while sound and lengths[k] < problem.horizon and not problem.terminal[x]:
            following = transition(problem, x, u, state)
            target, next_u = problem.cost[x, u], 0
            if not problem.terminal[following]:
                next_u = choose(behavior, following, q, visits, state)
                target += problem.gamma * q[following, next_u]
            delta = target - q[x, u]
            visits[x, u] += 1
            pair = x * controls + u
            if trace[pair] == 0.0:
                traced[many] = pair
                many += 1
            trace[pair] = 1.0 if rule.replacing else trace[pair] + 1.0
            i = 0
            while i < many:
                z = traced[i]
                zx, zu = z // controls, z % controls
                weight = step_size(rule, visits[zx, zu]) * trace[z]
                learned[zx, zu] += weight * delta
                sound = sound and abs(learned[zx, zu]) <= rule.limit
                trace[z] *= fading
                if trace[z] < FAINT:
                    trace[z] = 0.0
                    many -= 1
                    traced[i] = traced[many]
                else:
                    i += 1
            costs[k] += discount * problem.cost[x, u]
            lengths[k] += 1
            discount *= problem.gamma
            x, u = following, next_u
        q[:] = learned
        trace[traced[:many]] = 0.0
        if not sound:
            return False
    return True
