"""Dynamic programming against published tables, closed forms, a linear programme and brute
force."""

import math
from itertools import product

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.optimize import linprog

from labs.algorithms import (
    backward_recursion,
    policy_evaluation,
    policy_iteration,
    value_iteration,
)
from labs.algorithms.bellman import optimal_backup, q_values
from labs.algorithms.policy_iteration import optimum
from labs.errors import LabError
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.pendulum_table.table import pendulum_grid
from tests.labs.algorithms.random_mdps import mdps, random_mdp

seeds = st.integers(0, 2**32 - 1)


def linear_programme(mdp: FiniteMDP) -> np.ndarray:
    """V*: the largest V with V(x) <= C(x, u) + gamma P^u(x, .) V for all x, u."""
    rows = np.concatenate([np.eye(mdp.X) - mdp.gamma * P for P in mdp.probabilities])
    bounds = [(0.0, 0.0) if end else (None, None) for end in mdp.terminal]
    limits = mdp.C.T.ravel()
    found = linprog(-np.ones(mdp.X), A_ub=rows, b_ub=limits, bounds=bounds, method="highs")
    assert found.status == 0
    return np.asarray(found.x)


def zeros(mdp: FiniteMDP) -> np.ndarray:
    """The first control everywhere."""
    return np.zeros(mdp.X, np.int64)


# Published and exact values -------------------------------------------------------------------

# Sutton and Barto, Reinforcement Learning, 2nd edition, figure 4.1 (to the digits printed there);
# costs are minus the rewards.
PUBLISHED = {
    1: "0.0 1.0 1.0 1.0|1.0 1.0 1.0 1.0|1.0 1.0 1.0 1.0|1.0 1.0 1.0 0.0",
    2: "0.0 1.7 2.0 2.0|1.7 2.0 2.0 2.0|2.0 2.0 2.0 1.7|2.0 2.0 1.7 0.0",
    3: "0.0 2.4 2.9 3.0|2.4 2.9 3.0 2.9|2.9 3.0 2.9 2.4|3.0 2.9 2.4 0.0",
    10: "0.0 6.1 8.4 9.0|6.1 7.7 8.4 8.4|8.4 8.4 7.7 6.1|9.0 8.4 6.1 0.0",
}
LIMIT = [[0, 14, 20, 22], [14, 18, 20, 20], [20, 20, 18, 14], [22, 20, 14, 0]]


def test_the_four_by_four_world_under_the_random_policy() -> None:
    world = GridWorld.parse(MAPS["4x4"])
    mdp = world.mdp(1.0)
    *sweeps, last = policy_evaluation.iterate(mdp, np.zeros(16), random_policy(mdp), 1e-10)
    for k, text in PUBLISHED.items():
        wanted = [[float(word) for word in row.split()] for row in text.split("|")]
        # One digit is printed, and 1.75 is printed as 1.7.
        np.testing.assert_allclose(world.on_map(sweeps[k - 1].V), wanted, atol=0.0501)
        assert sweeps[k - 1].backups == k * 16 * 4
    np.testing.assert_allclose(world.on_map(last.V), LIMIT, atol=1e-7)
    exactly = policy_evaluation.exact_values(mdp, random_policy(mdp))
    np.testing.assert_allclose(world.on_map(exactly), LIMIT, atol=1e-11)
    # The figure's last column: greedy with respect to these values is already optimal.
    greedy = q_values(mdp, exactly).argmin(axis=1)
    np.testing.assert_allclose(policy_evaluation.exact_values(mdp, greedy), optimum(mdp, greedy)[0])


def gamblers_problem(p: float) -> FiniteMDP:
    """Example 4.3: a capital of 0 to 100, stakes of 1 to 50, cut to what is there and to what is
    missing. Winning costs -1."""
    P, C = np.zeros((50, 101, 101)), np.zeros((101, 50))
    for x, u in product(range(101), range(50)):
        stake = min(u + 1, x, 100 - x)
        P[u, x, x + stake] += p
        P[u, x, x - stake] += 1.0 - p
        C[x, u] = -p if 0 < x < 100 and x + stake == 100 else 0.0
    return FiniteMDP(C, 1.0, np.isin(np.arange(101), (0, 100)), P=P)


def bold_play(x: int, p: float, digits: int = 60) -> float:
    """The probability of reaching 100 by staking all that is useful, for p < 1/2 the best there
    is (Dubins and Savage): along the binary digits of x / 100."""
    found, weight = 0.0, 1.0
    for _ in range(digits):
        if x >= 50:
            found += weight * p
            weight, x = weight * (1.0 - p), 2 * x - 100
        else:
            weight, x = weight * p, 2 * x
    return found


def test_the_gamblers_problem() -> None:
    mdp = gamblers_problem(0.4)
    *_, last = value_iteration.iterate(mdp, np.zeros(101), 1e-12)
    wanted = [-bold_play(x, 0.4) if x < 100 else 0.0 for x in range(101)]
    np.testing.assert_allclose(last.V, wanted, atol=1e-9)
    np.testing.assert_allclose(last.V[[25, 50, 75]], [-0.16, -0.4, -0.64], atol=1e-9)
    # The published policy takes the least of the best stakes.
    Q = q_values(mdp, last.V)
    least = np.isclose(Q, Q.min(axis=1, keepdims=True), rtol=0.0, atol=1e-8).argmax(axis=1) + 1
    for x, stake in ((1, 1), (12, 12), (13, 12), (24, 1), (25, 25), (26, 1), (50, 50), (51, 1)):
        assert least[x] == stake
    assert least[75] == 25
    *_, also = policy_iteration.iterate(mdp, np.zeros(101), None, math.inf, 1e-12)
    np.testing.assert_allclose(also.V, wanted, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "kings", "cost"),
    [("cliff", False, 13.0), ("windy", False, 15.0), ("windy", True, 7.0)],
)
def test_the_shortest_ways_are_the_published_ones(name: str, kings: bool, cost: float) -> None:
    world = GridWorld.parse(MAPS[name], kings)
    mdp = world.mdp(1.0)
    *_, last = value_iteration.iterate(mdp, np.zeros(mdp.X), 1e-9)
    assert last.V[world.start] == cost
    V, _, _ = optimum(mdp, random_policy(mdp))
    np.testing.assert_allclose(V, last.V, atol=1e-9)


# Independent solutions ------------------------------------------------------------------------


@given(mdps(highest=0.95))
@settings(max_examples=40, deadline=None)
def test_all_ways_lead_to_the_linear_programme(mdp: FiniteMDP) -> None:
    wanted = linear_programme(mdp)
    *_, by_values = value_iteration.iterate(mdp, np.zeros(mdp.X), 1e-10)
    np.testing.assert_allclose(by_values.V, wanted, atol=1e-7)
    for m in (1, 3, math.inf):
        *_, last = policy_iteration.iterate(mdp, np.zeros(mdp.X), zeros(mdp), m, 1e-10)
        np.testing.assert_allclose(last.V, wanted, atol=1e-7)
        np.testing.assert_allclose(
            policy_evaluation.exact_values(mdp, last.policy), wanted, atol=1e-6
        )
    exactly, policy, _ = optimum(mdp, random_policy(mdp))
    np.testing.assert_allclose(exactly, wanted, atol=1e-7)
    np.testing.assert_allclose(policy_evaluation.exact_values(mdp, policy), exactly, atol=1e-12)


@pytest.mark.parametrize("slip", [0.0, 0.2])
@pytest.mark.parametrize("gamma", [0.9, 1.0])
def test_a_grid_world_equals_its_linear_programme(slip: float, gamma: float) -> None:
    mdp = GridWorld.parse(MAPS["room"]).mdp(gamma, slip)
    exactly, _, _ = optimum(mdp, random_policy(mdp))
    np.testing.assert_allclose(exactly, linear_programme(mdp), atol=1e-7)


def test_the_pendulum_by_four_ways() -> None:
    grid = pendulum_grid(1, 21, 21, 3)
    mdp = grid.mdp(0.97)
    V, policy, improvements = optimum(mdp, zeros(mdp))
    assert 2 <= improvements <= 20
    np.testing.assert_allclose(optimal_backup(mdp, V, policy)[0], V, atol=1e-11)
    *_, last = value_iteration.iterate(mdp, np.zeros(mdp.X), 1e-9)
    np.testing.assert_allclose(last.V, V, atol=1e-7)
    np.testing.assert_allclose(linear_programme(mdp), V, atol=1e-6)


@given(mdps(), seeds)
@settings(max_examples=60, deadline=None)
def test_exact_evaluation_is_the_linear_system(mdp: FiniteMDP, seed: int) -> None:
    """Also where paths into cycles are followed instead."""
    policy = np.random.default_rng(seed).integers(mdp.U, size=mdp.X)
    for given_one in (policy, random_policy(mdp)):
        V = policy_evaluation.exact_values(mdp, given_one)
        matrix, cost = mdp.transition_matrix(given_one), mdp.policy_cost(given_one)
        np.testing.assert_allclose(cost + mdp.gamma * matrix @ V, V, atol=1e-10)


def test_without_discount_what_never_ends_is_infinite() -> None:
    """0 and 1 circle or end, 2 circles, 3 ends, 4 rests at no cost."""
    successor = np.array([[1, 3], [0, 3], [2, 2], [3, 3], [4, 4]], np.int32)
    C = np.array([[1.0, 9.0], [2.0, 4.0], [1.0, 1.0], [0.0, 0.0], [0.0, 7.0]])
    mdp = FiniteMDP(C, 1.0, np.arange(5) == 3, successor=successor)
    circling = policy_evaluation.exact_values(mdp, zeros(mdp))
    np.testing.assert_array_equal(circling, [np.inf, np.inf, np.inf, 0.0, 0.0])
    V, policy, _ = optimum(mdp, zeros(mdp))
    np.testing.assert_array_equal(V, [5.0, 4.0, np.inf, 0.0, 0.0])
    np.testing.assert_array_equal(policy[:2], [0, 1])
    random = policy_evaluation.exact_values(mdp, random_policy(mdp))
    np.testing.assert_allclose(random, [8.0 + 2 / 3, 7.0 + 1 / 3, np.inf, 0.0, np.inf])
    chance = FiniteMDP(C, 1.0, mdp.terminal, P=mdp.probabilities)
    np.testing.assert_allclose(optimum(chance, random_policy(chance))[0][:4], V[:4])


def best_sequence(mdp: FiniteMDP, final: np.ndarray, x: int, steps: int) -> float:
    """Over all sequences of controls."""
    found = math.inf
    for controls in product(range(mdp.U), repeat=steps):
        y, cost = x, 0.0
        for i, u in enumerate(controls):
            cost += mdp.gamma**i * mdp.C[y, u]
            y = int(mdp.successors[y, u])
        found = min(found, cost + mdp.gamma**steps * float(final[y]))
    return found


@pytest.mark.parametrize("seed", range(4))
def test_backward_recursion_is_the_best_of_all_sequences(seed: int) -> None:
    mdp = random_mdp(seed, X=5, U=3, gamma=0.9, deterministic=True, ends=seed % 2 == 0)
    final = np.random.default_rng(seed).normal(size=5)
    V, policy = backward_recursion.value_and_policy_tables(mdp, final, 5)
    for x in range(5):
        for k in range(6):
            assert V[k, x] == pytest.approx(best_sequence(mdp, final, x, k), abs=1e-12)
        y, cost = x, 0.0  # acting on the policies costs what the values promise
        for k in range(5, 0, -1):
            u = policy[k - 1, y]
            cost += mdp.gamma ** (5 - k) * mdp.C[y, u]
            y = int(mdp.successors[y, u])
        assert cost + mdp.gamma**5 * final[y] == pytest.approx(V[5, x], abs=1e-12)


def test_backward_recursion_is_the_best_of_all_policies_under_chance() -> None:
    mdp = random_mdp(3, X=3, U=2, gamma=0.95, deterministic=False, ends=False)
    final = np.array([0.3, -0.4, 0.1])
    V, _ = backward_recursion.value_and_policy_tables(mdp, final, 2)
    best = np.full(3, math.inf)
    for first, second in product(product(range(2), repeat=3), repeat=2):
        ahead = final
        for policy in (np.array(second), np.array(first)):
            ahead = mdp.policy_cost(policy) + mdp.gamma * mdp.transition_matrix(policy) @ ahead
        best = np.minimum(best, ahead)
    np.testing.assert_allclose(V[2], best, atol=1e-14)


# What the notes say of the iterations ---------------------------------------------------------


@given(mdps(highest=0.9), seeds)
@settings(max_examples=30, deadline=None)
def test_errors_shrink_with_the_powers_of_gamma(mdp: FiniteMDP, seed: int) -> None:
    V = np.random.default_rng(seed).normal(scale=5.0, size=mdp.X)
    policy = np.random.default_rng(seed).integers(mdp.U, size=mdp.X)
    for limit, sweeps in (
        (optimum(mdp, policy)[0], value_iteration.iterate(mdp, V, 1e-8)),
        (
            policy_evaluation.exact_values(mdp, policy),
            policy_evaluation.iterate(mdp, V, policy, 1e-8),
        ),
    ):
        begun = np.abs(V - limit).max()
        for sweep in sweeps:
            bound = mdp.gamma**sweep.count * begun
            assert np.abs(sweep.V - limit).max() <= bound + 1e-10


@given(mdps(highest=0.9), seeds)
@settings(max_examples=30, deadline=None)
def test_policy_iteration_gets_better_each_time(mdp: FiniteMDP, seed: int) -> None:
    policy = np.random.default_rng(seed).integers(mdp.U, size=mdp.X)
    worse = np.full(mdp.X, np.inf)
    sweeps = policy_iteration.iterate(mdp, np.zeros(mdp.X), policy, math.inf, 1e-9)
    for sweep in sweeps:
        if sweep.evaluations == 0:
            V = policy_evaluation.exact_values(mdp, sweep.policy)
            assert np.max(V - worse) <= 1e-7
            worse = V


@given(mdps(highest=0.9))
@settings(max_examples=30, deadline=None)
def test_one_evaluation_is_value_iteration_sweep_for_sweep(mdp: FiniteMDP) -> None:
    V = np.linspace(0.0, 1.0, mdp.X)
    ours = policy_iteration.iterate(mdp, V, None, 1, 1e-8)
    theirs = value_iteration.iterate(mdp, V, 1e-8)
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(a.V, b.V)
        np.testing.assert_array_equal(a.policy, b.policy)
        assert (a.count, a.backups, a.change, a.done) == (b.count, b.backups, b.change, b.done)


def test_an_iteration_goes_on_from_any_sweep() -> None:
    mdp = random_mdp(1, X=6, U=3, gamma=0.8, deterministic=False, ends=True)
    sweeps = list(policy_iteration.iterate(mdp, np.zeros(6), zeros(mdp), 4, 1e-8))
    again = policy_iteration.step(mdp, sweeps[5], 4, 1e-8)
    np.testing.assert_array_equal(again.V, sweeps[6].V)
    assert (again.count, again.backups, again.evaluations) == (
        7,
        sweeps[6].backups,
        sweeps[6].evaluations,
    )
    assert all(not sweep.done for sweep in sweeps[:-1])
    assert sweeps[-1].done.startswith("No value changed by more than 1e-08")


def test_few_sweeps_to_go_are_the_first_of_value_iteration() -> None:
    mdp = random_mdp(2, X=6, U=3, gamma=0.9, deterministic=True, ends=False)
    final = np.arange(6.0)
    V, _ = backward_recursion.value_and_policy_tables(mdp, final, 8)
    np.testing.assert_array_equal(V[0], final)
    for k, sweep in zip(range(1, 9), value_iteration.iterate(mdp, final, 0.0), strict=False):
        np.testing.assert_array_equal(V[k], sweep.V)
    assert backward_recursion.value_and_policy_tables(mdp, final, 0)[1].shape == (0, 6)


def test_an_endless_optimum_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(policy_iteration, "MAX_IMPROVEMENTS", 1)
    mdp = GridWorld.parse(MAPS["room"]).mdp(0.9)
    with pytest.raises(LabError, match="after 1 improvements"):
        optimum(mdp, random_policy(mdp))
