"""Q-learning (notes, 3.6.4; Watkins 1989): off-policy, towards the greedy policy's value.

    delta = l + gamma min_u' Q(x', u') - Q(x, u),    Q(x, u) <- Q(x, u) + alpha_n delta

with Q = 0 in terminal states. Whoever chose u, the target is that of the best control in x'."""

import numpy as np

from labs.algorithms.exploration import Behavior, choose
from labs.compiled import compiled
from labs.problems.episodes import Problem, Rule, begin, least, step_size, transition


@compiled
def q_learning(
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
        x, steps, total, discount = begin(problem, state), 0, 0.0, 1.0
        sound = True
        while sound and steps < problem.horizon and not problem.terminal[x]:
            u = choose(behavior, x, q, visits, state)
            following = transition(problem, x, u, state)
            target = problem.cost[x, u]
            if not problem.terminal[following]:
                target += problem.gamma * least(q, following)
            visits[x, u] += 1
            q[x, u] += step_size(rule, visits[x, u]) * (target - q[x, u])
            sound = abs(q[x, u]) <= rule.limit
            total += discount * problem.cost[x, u]
            discount *= problem.gamma
            steps += 1
            x = following
        costs[k], lengths[k] = total, steps
        if not sound:
            return False
    return True
