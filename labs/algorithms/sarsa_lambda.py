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

from labs.algorithms.exploration import BehaviourPolicy, choose
from labs.algorithms.td_lambda import NEGLIGIBLE_TRACE
from labs.compiled import compiled
from labs.problems.episodes import (
    EpisodicTask,
    Learner,
    UpdateRule,
    initial_state,
    record_step,
    step_size,
    transition,
)


@compiled
def sarsa_lambda(
    task: EpisodicTask, behaviour: BehaviourPolicy, rule: UpdateRule, learner: Learner
) -> bool:
    """Episodes of one learner, which changes in place: as many as its costs and lengths hold.
    False where an estimate left the rule's limit, and with it the last episode begun."""
    q, visits, random, costs, lengths = learner
    controls, fading = q.shape[1], task.gamma * rule.trace_decay
    trace, traced = np.zeros(q.size), np.empty(q.size, np.int64)
    sound = True
    for k in range(len(costs)):
        many = 0  # The pairs with a trace are traced[:many], each as x U + u.
        learned = q.copy() if rule.offline else q
        x, discount = initial_state(task, random), 1.0
        u = choose(behaviour, x, q, visits, random)
        while sound and lengths[k] < task.horizon and not task.terminal[x]:
            next_x = transition(task, x, u, random)
            target, next_u = task.cost[x, u], 0
            if not task.terminal[next_x]:
                next_u = choose(behaviour, next_x, q, visits, random)
                target += task.gamma * q[next_x, next_u]
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
                if trace[z] < NEGLIGIBLE_TRACE:
                    trace[z] = 0.0
                    many -= 1
                    traced[i] = traced[many]
                else:
                    i += 1
            discount = record_step(task, learner, k, x, u, discount)
            x, u = next_x, next_u
        q[:] = learned
        trace[traced[:many]] = 0.0
        if not sound:
            return False
    return True
