"""Policy evaluation (notes, 3.4.2): the cost-to-go V^pi of a given policy on a finite MDP.

    iteratively    V_(k+1) = T^pi V_k,    |V_k - V^pi| <= gamma^k |V_0 - V^pi|  (max norm)
    exactly        V^pi = (I - gamma P^pi)^-1 C^pi

Where both the policy and the dynamics are deterministic, the exact value takes no linear solver:
from every state one path leads into a cycle, of states x_1, ..., x_L say, with the value

    V^pi(x_1) = sum over k of gamma^k l_k / (1 - gamma^L),

and back along the path V^pi(x) = l + gamma V^pi(x'). With gamma = 1 a state from which the policy
never comes to rest at no cost has no finite cost-to-go: its value is infinite. Whether it comes to
rest is decided on the graph of the chain that remains under the policy, as in `markov_chain`.
Where the MDP knows which few outcomes there are, the system is solved as a sparse one.
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from labs.algorithms.bellman import Sweep, convergence_message, policy_backup, until_done
from labs.algorithms.markov_chain import communicating_classes, cost_to_go
from labs.compiled import compiled
from labs.problems.finite_mdp import FiniteMDP


def init(V: np.ndarray, policy: np.ndarray) -> Sweep:
    """Before the first sweep: V (X,), policy (X,) or (X, U)."""
    return Sweep(V, policy)


def step(mdp: FiniteMDP, at: Sweep, tolerance: float) -> Sweep:
    """One sweep of T^pi over all states."""
    V, change, backups = policy_backup(mdp, at.V, at.policy)
    done = convergence_message(mdp, V, change, tolerance)
    return Sweep(V, at.policy, at.count + 1, at.backups + backups, change, at.evaluations + 1, done)


def iterate(mdp: FiniteMDP, V: np.ndarray, policy: np.ndarray, tolerance: float) -> Iterator[Sweep]:
    """Sweep by sweep until none changes a value by more than `tolerance`."""
    return until_done(lambda at: step(mdp, at, tolerance), init(V, policy))


def exact_values(mdp: FiniteMDP, policy: np.ndarray) -> np.ndarray:
    """V^pi (X,). A random policy or random dynamics take a dense (X, X) matrix: for small MDPs."""
    if policy.ndim == 1 and mdp.successor is not None:
        V = np.empty(mdp.X)
        rows = np.arange(mdp.X)
        _deterministic_value(mdp.C[rows, policy], mdp.successor[rows, policy], mdp.gamma, V)
        return V
    if mdp.outcomes is not None:
        return _sparse_value(mdp.sparse_chain(policy), mdp.policy_cost(policy), mdp.gamma)
    matrix, cost = mdp.transition_matrix(policy), mdp.policy_cost(policy)
    if mdp.gamma < 1.0:
        return np.asarray(np.linalg.solve(np.eye(mdp.X) - mdp.gamma * matrix, cost))
    found = cost_to_go(matrix, cost, mdp.gamma, communicating_classes(matrix))
    return np.where(found.finite, found.V, np.inf)


def expected_visits(mdp: FiniteMDP, policy: np.ndarray, start: int) -> np.ndarray:
    """(X,) eta: the steps that an episode from `start` begins in each state, on average, with a
    policy that is sure to end it: eta = h + P'eta, h the start; 0 in terminal states."""
    inside = ~mdp.terminal
    P = mdp.transition_matrix(policy)[np.ix_(inside, inside)]
    begun = (np.arange(mdp.X) == start)[inside].astype(float)
    visits = np.zeros(mdp.X)
    visits[inside] = np.linalg.solve(np.eye(len(P)) - P.T, begun)
    return np.maximum(visits, 0.0)


def _sparse_value(P: csr_array, cost: np.ndarray, gamma: float) -> np.ndarray:
    """V (X,) of a chain with the transition matrix P (X, X) and costs (X,)."""
    endless, rest = np.zeros(len(cost), bool), np.zeros(len(cost), bool)
    if gamma == 1.0:
        count, label = connected_components(P, connection="strong")
        closed, costly = np.ones(count, bool), np.zeros(count, bool)
        start, end = (label[places] for places in P.nonzero())
        closed[start[start != end]] = False
        costly[label[cost != 0.0]] = True
        rest, endless, found = closed[label], (closed & costly)[label], np.zeros(0)
        while not np.array_equal(endless, found):
            found, endless = endless, endless | (P @ endless.astype(float) > 0.0)
    V, left = np.where(endless, np.inf, 0.0), ~endless & ~rest
    if left.any():
        system = eye_array(int(left.sum())) - gamma * P[left][:, left]
        V[left] = spsolve(system.tocsc(), cost[left])
    return V


@compiled
def _deterministic_value(cost: np.ndarray, ahead: np.ndarray, gamma: float, V: np.ndarray) -> None:
    """Writes V^pi for one next state `ahead` (X,) and one cost (X,) a state."""
    new, on_path, known = 0, 1, 2
    mark = np.zeros(len(V), np.int8)
    path = np.empty(len(V), np.int64)
    for start in range(len(V)):
        x, length = start, 0
        while mark[x] == new:
            mark[x] = on_path
            path[length] = x
            length += 1
            x = ahead[x]
        if mark[x] == on_path:  # a cycle that nobody has met before
            total, weight, idle, y = 0.0, 1.0, True, x
            while True:
                total += weight * cost[y]
                weight *= gamma
                idle = idle and cost[y] == 0.0
                y = ahead[y]
                if y == x:
                    break
            if idle:
                V[x] = 0.0
            elif gamma < 1.0:
                V[x] = total / (1.0 - weight)
            else:
                V[x] = -np.inf if total < 0.0 else np.inf
            mark[x] = known
        while length:
            length -= 1
            y = path[length]
            if mark[y] != known:
                V[y] = cost[y] + gamma * V[ahead[y]]
                mark[y] = known
