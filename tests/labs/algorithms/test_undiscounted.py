"""The optimum with gamma = 1, where costs may be rewards, loops free and ends in doubt."""

import numpy as np
import pytest

from labs.algorithms import policy_evaluation
from labs.algorithms.policy_iteration import optimum
from labs.problems.finite_mdp import FiniteMDP, random_policy
from tests.labs.tasks.published import LAKES, frozen_lake

END = 2
"""The last of three states."""


def problem(*rows: tuple[tuple[float, tuple[float, float, float]], ...]) -> FiniteMDP:
    """Two states, each with two controls, a cost and the probabilities of (0, 1, END)."""
    P = np.zeros((2, 3, 3))
    C = np.zeros((3, 2))
    P[:, END, END] = 1.0
    for x, row in enumerate(rows):
        for u, (cost, p) in enumerate(row):
            C[x, u], P[u, x] = cost, p
    return FiniteMDP(C, 1.0, np.arange(3) == END, P=P)


def best(mdp: FiniteMDP) -> np.ndarray:
    V, policy, _ = optimum(mdp, random_policy(mdp))
    np.testing.assert_array_equal(policy_evaluation.exact_values(mdp, policy), V)
    return V


def test_waiting_for_nothing_is_not_taken_for_the_end() -> None:
    """Both controls promise the same: one waits for ever, the other ends."""
    waits = (0.0, (1.0, 0.0, 0.0))
    ends = (-1.0, (0.0, 0.0, 1.0))
    back = (0.0, (1.0, 0.0, 0.0))
    np.testing.assert_array_equal(best(problem((waits, ends), (back, back))), [-1.0, -1.0, 0.0])


def test_a_trap_is_walked_round() -> None:
    """From 0 straight on, half the time into the trap 1, or the long way."""
    risky, long = (1.0, (0.0, 0.5, 0.5)), (5.0, (0.5, 0.0, 0.5))
    trap = (1.0, (0.0, 1.0, 0.0))
    V = best(problem((risky, long), (trap, trap)))
    assert V[0] == pytest.approx(10.0)
    assert V[1] == np.inf


def test_a_reward_without_end_has_no_value() -> None:
    earns, ends = (-1.0, (1.0, 0.0, 0.0)), (0.0, (0.0, 0.0, 1.0))
    dear = (3.0, (0.0, 0.0, 1.0))
    V, _, _ = optimum(problem((earns, ends), (dear, dear)), np.full((3, 2), 0.5))
    assert V[0] == np.inf, "none, and no matter of how many sweeps"
    assert V[1] == 3.0


@pytest.mark.parametrize("name", LAKES)
def test_frozen_lakes_chance_to_arrive(name: str) -> None:
    """14/17 where 4 x 4; sure where 8 x 8, for there is a way that never risks a hole."""
    P, reward = frozen_lake(LAKES[name])
    terminal = np.array([cell in "GH" for row in LAKES[name] for cell in row])
    dense = FiniteMDP(-reward, 1.0, terminal, P=P)
    V, policy, _ = optimum(dense, random_policy(dense))
    assert -V[0] == pytest.approx({16: 14 / 17, 64: 1.0}[len(V)], abs=1e-12)
    outcomes = np.argsort(-P, axis=2, kind="stable")[..., :3].astype(np.int32)
    few = np.take_along_axis(P, outcomes, axis=2)
    sparse = FiniteMDP(-reward, 1.0, terminal, P=few, outcomes=outcomes)
    np.testing.assert_allclose(policy_evaluation.exact_values(sparse, policy), V, atol=1e-12)
    np.testing.assert_allclose(optimum(sparse, random_policy(sparse))[0], V, atol=1e-12)
    np.testing.assert_allclose(sparse.transition_matrix(policy), dense.transition_matrix(policy))
