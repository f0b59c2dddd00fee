"""SARSA and SARSA(n) (notes, 3.6.5 and 3.5.5): on-policy, the value of what is really done.

    delta = l + gamma Q(x', u') - Q(x, u),    Q(x, u) <- Q(x, u) + alpha_n delta

u' is the control that is applied next, exploration included. SARSA(n) waits for n costs:

    J_t = l_t + gamma l_(t+1) + ... + gamma^(n-1) l_(t+n-1) + gamma^n Q(x_(t+n), u_(t+n))
    Q(x_t, u_t) <- Q(x_t, u_t) + alpha_n (J_t - Q(x_t, u_t))

with Q = 0 in terminal states; near the end of an episode J_t takes the costs that are left. Where
an episode is cut short, the value of the pair it was cut at stands for the rest."""

import numpy as np

from labs.algorithms.exploration import Behavior, choose
from labs.compiled import compiled
from labs.problems.episodes import Problem, Rule, begin, step_size, transition


@compiled
def sarsa(
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
    for k in range(len(costs)):
        x, discount = begin(problem, state), 1.0
        u = choose(behavior, x, q, visits, state)
        while lengths[k] < problem.horizon and not problem.terminal[x]:
            following = transition(problem, x, u, state)
            target, next_u = problem.cost[x, u], 0
            if not problem.terminal[following]:
                next_u = choose(behavior, following, q, visits, state)
                target += problem.gamma * q[following, next_u]
            visits[x, u] += 1
            q[x, u] += step_size(rule, visits[x, u]) * (target - q[x, u])
            costs[k] += discount * problem.cost[x, u]
            lengths[k] += 1
            discount *= problem.gamma
            if not abs(q[x, u]) <= rule.limit:
                return False
            x, u = following, next_u
    return True


@compiled
def sarsa_n(
    problem: Problem,
    behavior: Behavior,
    rule: Rule,
    q: np.ndarray,
    visits: np.ndarray,
    state: np.ndarray,
    costs: np.ndarray,
    lengths: np.ndarray,
) -> bool:
    """The same by SARSA(n)."""
    n, gamma = rule.n, problem.gamma
    # The last n + 1 pairs and n costs, in rings.
    xs, us = np.zeros(n + 1, np.int64), np.zeros(n + 1, np.int64)
    paid = np.zeros(n)
    for k in range(len(costs)):
        x, t, updated, discount = begin(problem, state), 0, 0, 1.0
        u = choose(behavior, x, q, visits, state)
        xs[0], us[0] = x, u
        end = 0 if problem.terminal[x] else problem.horizon
        while updated < end:
            if t < end:
                paid[t % n] = problem.cost[x, u]
                costs[k] += discount * problem.cost[x, u]
                discount *= gamma
                following, next_u = transition(problem, x, u, state), 0
                if problem.terminal[following]:
                    end = t + 1
                else:
                    next_u = choose(behavior, following, q, visits, state)
                visits[x, u] += 1
                x, u, t = following, next_u, t + 1
                xs[t % (n + 1)], us[t % (n + 1)] = x, u
            if t - updated == n or t == end:
                target = 0.0 if problem.terminal[x] else q[x, u]
                for i in range(t - 1, updated - 1, -1):
                    target = paid[i % n] + gamma * target
                then_x, then_u = xs[updated % (n + 1)], us[updated % (n + 1)]
                alpha = step_size(rule, visits[then_x, then_u])
                q[then_x, then_u] += alpha * (target - q[then_x, then_u])
                updated += 1
                if not abs(q[then_x, then_u]) <= rule.limit:
                    return False
        lengths[k] = t
    return True
