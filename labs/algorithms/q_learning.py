"""Q-learning (notes, 3.6.4; Watkins 1989): off-policy, towards the greedy policy's value.

    delta = l + gamma min_u' Q(x', u') - Q(x, u),    Q(x, u) <- Q(x, u) + alpha_n delta

with Q = 0 in terminal states. Whoever chose u, the target is that of the best control in x'."""

from labs.algorithms.exploration import BehaviourPolicy, choose
from labs.compiled import compiled
from labs.problems.episodes import (
    EpisodicTask,
    Learner,
    UpdateRule,
    initial_state,
    min_q,
    record_step,
    step_size,
    transition,
)


@compiled
def q_learning(
    task: EpisodicTask, behaviour: BehaviourPolicy, rule: UpdateRule, learner: Learner
) -> bool:
    """Episodes of one learner, which changes in place: as many as its costs and lengths hold.
    False where an estimate left the rule's limit, and with it the last episode begun."""
    q, visits, random, costs, lengths = learner
    for k in range(len(costs)):
        x, discount = initial_state(task, random), 1.0
        while lengths[k] < task.horizon and not task.terminal[x]:
            u = choose(behaviour, x, q, visits, random)
            next_x = transition(task, x, u, random)
            target = task.cost[x, u]
            if not task.terminal[next_x]:
                target += task.gamma * min_q(q, next_x)
            visits[x, u] += 1
            q[x, u] += step_size(rule, visits[x, u]) * (target - q[x, u])
            discount = record_step(task, learner, k, x, u, discount)
            if not abs(q[x, u]) <= rule.limit:
                return False
            x = next_x
    return True
