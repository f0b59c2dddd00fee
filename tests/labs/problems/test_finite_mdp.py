"""Finite MDPs: what they refuse, and what they say of themselves."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from labs.errors import LabError
from labs.problems.finite_mdp import FiniteMDP, random_policy


def three() -> FiniteMDP:
    """0 goes to 1 or stays; 1 goes back or ends in 2; nothing leads to 3, which ends too."""
    successor = np.array([[1, 0], [0, 2], [2, 2], [2, 2]], np.int32)
    C = np.array([[1.0, 2.0], [3.0, 4.0], [0.0, 0.0], [5.0, 6.0]])
    return FiniteMDP(C, 0.9, np.array([False, False, True, False]), successor=successor)


def chance(mdp: FiniteMDP) -> FiniteMDP:
    """The same with its table as probabilities."""
    return replace(mdp, successor=None, P=mdp.probabilities)


def test_a_table_and_its_probabilities_are_one_mdp() -> None:
    table = three()
    random = chance(table)
    assert (table.X, table.U, table.deterministic) == (4, 2, True)
    assert not random.deterministic
    for x in range(4):
        for u in range(2):
            assert random.probabilities[u, x].argmax() == table.successors[x, u]
    np.testing.assert_array_equal(random.probabilities.sum(axis=2), 1.0)
    with pytest.raises(LabError, match="leaves the next state to chance"):
        _ = random.successors
    for mdp in (table, random):
        np.testing.assert_array_equal(mdp.can_end, True)
        np.testing.assert_array_equal(mdp.reachable([0]), [True, True, True, False])
        assert mdp.describe([0]) == (
            "4 states and 2 controls, 1 of the states terminal, 1 never reached from the start."
        )


def test_states_without_a_way_out_are_found() -> None:
    successor = np.array([[0, 0], [0, 2], [2, 2]], np.int32)
    C = np.array([[1.0, 1.0], [1.0, 1.0], [0.0, 0.0]])
    mdp = FiniteMDP(C, 1.0, np.array([False, False, True]), successor=successor)
    for kind in (mdp, chance(mdp)):
        np.testing.assert_array_equal(kind.can_end, [False, True, True])


def test_a_policy_leaves_a_chain() -> None:
    mdp = three()
    policy = np.array([0, 1, 0, 0])
    wanted = [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 0], [0, 0, 1, 0]]
    np.testing.assert_array_equal(mdp.transition_matrix(policy), wanted)
    np.testing.assert_array_equal(mdp.policy_cost(policy), [1.0, 4.0, 0.0, 5.0])
    evenly = random_policy(mdp)
    np.testing.assert_array_equal(mdp.transition_matrix(evenly)[0], [0.5, 0.5, 0.0, 0.0])
    np.testing.assert_array_equal(mdp.policy_cost(evenly), [1.5, 3.5, 0.0, 5.5])
    with pytest.raises(LabError, match="4 rows of 2 probabilities"):
        mdp.policy_cost(evenly / 2)


def test_sampling_follows_the_probabilities() -> None:
    P = np.array([[[0.2, 0.5, 0.3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]])
    mdp = FiniteMDP(np.ones((3, 1)), 0.5, np.zeros(3, bool), P=P)
    drawn = (np.random.default_rng(0).random((20_000, 1)) >= mdp.cumulative[0, 0]).sum(axis=1)
    np.testing.assert_allclose(np.bincount(drawn) / 20_000, P[0, 0], atol=0.015)
    np.testing.assert_array_equal(mdp.cumulative[..., -1], 1.0)


def test_what_rounding_leaves_of_a_row_leads_to_no_impossible_state() -> None:
    P = np.full((1, 11, 11), 0.1)
    P[..., -1] = 0.0
    assert P[0, 0].cumsum()[-1] < 1.0
    mdp = FiniteMDP(np.ones((11, 1)), 0.5, np.zeros(11, bool), P=P)
    np.testing.assert_array_equal(mdp.cumulative[0, :, -2:], 1.0)
    assert mdp.cumulative[0, 0, -3] == pytest.approx(0.9)


CHANGES: list[tuple[dict[str, Any], str]] = [
    ({"C": np.ones(4)}, "shape"),
    ({"C": np.where(np.eye(4)[:, :2] == 1.0, np.nan, 0.0)}, "control 0 in state 0 is nan"),
    ({"gamma": 1.5}, "gamma = 1.5: a discount is a number from 0 to 1"),
    ({"gamma": np.nan}, "gamma = nan"),
    ({"terminal": np.zeros(3, bool)}, "one true or false for each of 4 states"),
    ({"C": np.ones((4, 2))}, "state 2 is terminal, yet control 0 costs 1 there"),
    ({"successor": np.array([[1, 0], [0, 4], [2, 2], [2, 2]], np.int32)}, "from state 1 to 4"),
    ({"successor": np.array([[1, 0], [0, 2], [2, 0], [2, 2]], np.int32)}, "control 1 leads out"),
    ({"successor": np.zeros((4, 2))}, "int32"),
    ({"successor": None}, "not both"),
    ({"P": np.ones((2, 4, 4)) / 4}, "not both"),
]


@pytest.mark.parametrize(("changes", "sentence"), CHANGES)
def test_what_does_not_fit_is_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(LabError, match=sentence):
        replace(three(), **changes)


def test_wrong_probabilities_are_named() -> None:
    good = three().probabilities
    for (u, x, y), value, sentence in (
        ((1, 0, 2), 0.25, "from state 0 under control 1 the probabilities sum to 1.25"),
        ((1, 3, 0), -0.5, "from state 3 to state 0 under control 1 the probability is -0.5"),
        ((0, 1, 0), np.nan, "from state 1 to state 0 under control 0 the probability is nan"),
    ):
        P = good.copy()
        P[u, x, y] = value
        with pytest.raises(LabError, match=sentence):
            replace(three(), successor=None, P=P)
    P = good.copy()
    P[1, 2] = [1.0, 0.0, 0.0, 0.0]
    with pytest.raises(LabError, match="state 2 is terminal, yet control 1 leads out"):
        replace(three(), successor=None, P=P)
    few = np.array([[[0.5, 0.5]] * 4] * 2)
    few[1, 0] = 1.5, -0.5
    to = np.array([[[2, 3]] * 4] * 2, np.int32)
    with pytest.raises(LabError, match=r"to state 3 under control 1 the probability is -0\.5"):
        replace(three(), successor=None, P=few, outcomes=to)
    P[1, 2] = [1e-12, 0.0, 1.0 - 1e-12, 0.0]
    with pytest.raises(LabError, match="state 2 is terminal, yet control 1 leads out"):
        replace(three(), successor=None, P=P)
    with pytest.raises(LabError, match="P has shape"):
        replace(three(), successor=None, P=good[0])
