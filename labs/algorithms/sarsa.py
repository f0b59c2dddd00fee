"""SARSA and SARSA(n) (notes, 3.6.5 and 3.5.5): on-policy, the value of what is really done.

    delta = l + gamma Q(x', u') - Q(x, u),    Q(x, u) <- Q(x, u) + alpha_n delta

u' is the control that is applied next, exploration included. SARSA(n) waits for n costs:

    J_t = l_t + gamma l_(t+1) + ... + gamma^(n-1) l_(t+n-1) + gamma^n Q(x_(t+n), u_(t+n))
    Q(x_t, u_t) <- Q(x_t, u_t) + alpha_n (J_t - Q(x_t, u_t))

with Q = 0 in terminal states; near the end of an episode J_t takes the costs that are left. Where
an episode is cut short, the value of the pair it was cut at stands for the rest."""

import numpy as np

from labs.algorithms.exploration import BehaviourPolicy, choose
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
def sarsa(
    task: EpisodicTask, behaviour: BehaviourPolicy, rule: UpdateRule, learner: Learner
) -> bool:
    """Episodes of one learner, which changes in place: as many as its costs and lengths hold.
    False where an estimate left the rule's limit, and with it the last episode begun."""
    q, visits, random, costs, lengths = learner
    for k in range(len(costs)):
        x, discount = initial_state(task, random), 1.0
        u = choose(behaviour, x, q, visits, random)
        while lengths[k] < task.horizon and not task.terminal[x]:
            next_x = transition(task, x, u, random)
            target, next_u = task.cost[x, u], 0
            if not task.terminal[next_x]:
                next_u = choose(behaviour, next_x, q, visits, random)
                target += task.gamma * q[next_x, next_u]
            visits[x, u] += 1
            q[x, u] += step_size(rule, visits[x, u]) * (target - q[x, u])
            discount = record_step(task, learner, k, x, u, discount)
            if not abs(q[x, u]) <= rule.limit:
                return False
            x, u = next_x, next_u
    return True


@compiled
def sarsa_n(
    task: EpisodicTask, behaviour: BehaviourPolicy, rule: UpdateRule, learner: Learner
) -> bool:
    """The same by SARSA(n)."""
    q, visits, random, costs, _ = learner
    n, gamma = rule.n, task.gamma
    # The last n + 1 pairs and n costs, in rings.
    xs, us = np.zeros(n + 1, np.int64), np.zeros(n + 1, np.int64)
    paid = np.zeros(n)
    for k in range(len(costs)):
        x, t, updated, discount = initial_state(task, random), 0, 0, 1.0
        u = choose(behaviour, x, q, visits, random)
        xs[0], us[0] = x, u
        end = 0 if task.terminal[x] else task.horizon
        while updated < end:
            if t < end:
                paid[t % n] = task.cost[x, u]
                discount = record_step(task, learner, k, x, u, discount)
                next_x, next_u = transition(task, x, u, random), 0
                if task.terminal[next_x]:
                    end = t + 1
                else:
                    next_u = choose(behaviour, next_x, q, visits, random)
                visits[x, u] += 1
                x, u, t = next_x, next_u, t + 1
                xs[t % (n + 1)], us[t % (n + 1)] = x, u
            if t - updated == n or t == end:
                target = 0.0 if task.terminal[x] else q[x, u]
                for i in range(t - 1, updated - 1, -1):
                    target = paid[i % n] + gamma * target
                then_x, then_u = xs[updated % (n + 1)], us[updated % (n + 1)]
                alpha = step_size(rule, visits[then_x, then_u])
                q[then_x, then_u] += alpha * (target - q[then_x, then_u])
                updated += 1
                if not abs(q[then_x, then_u]) <= rule.limit:
                    return False
    return True
