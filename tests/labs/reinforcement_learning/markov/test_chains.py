"""The chains to look at, their edits, and their graph."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labs.algorithms.markov_chain import communicating_classes, is_irreducible
from labs.errors import LabError
from labs.reinforcement_learning.markov.chains import (
    CHAINS,
    TITLES,
    chain_table,
    format_rows,
    parse_rows,
    random_chain,
    replace_rows,
    set_probability,
    shift_probability,
)
from labs.reinforcement_learning.markov.graph import (
    bead_place,
    probability_at,
    ribbon,
    ribbon_points,
    ribbons,
    state_places,
    token_place,
)
from labs.reinforcement_learning.markov.reward_process import (
    ChainEdit,
    RewardProcess,
    reward_process,
)

NONE = ChainEdit({}, 0, 0, 0.0)


def process(name: str, first: float = 1.0, edit: ChainEdit = NONE) -> RewardProcess:
    return reward_process(chain_table(name, 1, "state, A\nA, 1"), first, edit)


def test_every_title_has_its_chain() -> None:
    assert set(TITLES) == {*CHAINS, "random", "table"}
    for name in TITLES:
        assert process(name).P.shape[0] <= 12


def test_the_chains_are_what_they_are_for() -> None:
    kinds = {
        name: [(len(c.states), c.closed, c.period) for c in process(name).classes]
        for name in CHAINS
    }
    assert kinds["student"] == [(6, True, 1)]
    assert kinds["term"] == [(5, False, 1), (1, True, 1)]
    assert kinds["lights"] == [(4, True, 4)]
    assert kinds["doors"] == [(1, False, 1), (2, True, 1), (2, True, 2)]
    assert [closed for _, closed, _ in kinds["gambler"]] == [False, True, True]
    assert process("machine").table.controls == ("run", "mend")


@pytest.mark.parametrize("number", [1, 2, 50])
@pytest.mark.parametrize("states", [2, 6, 12])
def test_random_chains_are_irreducible_and_differ(states: int, number: int) -> None:
    P = random_chain(states, number).P[0]
    np.testing.assert_allclose(P.sum(axis=1), 1.0, atol=1e-15)
    assert is_irreducible(communicating_classes(P))
    assert not np.array_equal(P, random_chain(states, number + 1).P[0])


# Edits


@given(
    st.lists(st.floats(0.01, 1.0), min_size=2, max_size=6),
    st.integers(0, 1),
    st.floats(0.0, 1.0),
)
def test_the_others_keep_their_proportions(weights: list[float], y: int, p: float) -> None:
    row = np.array(weights) / sum(weights)
    new = set_probability(row, y, p, row)
    assert new[y] == p
    assert new.sum() == pytest.approx(1.0)
    others = np.delete(row, y)
    np.testing.assert_allclose(np.delete(new, y), others * (1 - p) / others.sum(), atol=1e-15)


def test_one_that_had_all_gives_by_the_chains_own_proportions() -> None:
    own = np.array([0.2, 0.3, 0.5])
    all_ = set_probability(own, 0, 1.0, own)
    np.testing.assert_array_equal(all_, [1.0, 0.0, 0.0])
    np.testing.assert_allclose(set_probability(all_, 0, 0.2, own), own)
    # Where the chain itself knew no other way, all share alike.
    np.testing.assert_allclose(set_probability(all_, 0, 0.5, all_), [0.5, 0.25, 0.25])
    np.testing.assert_array_equal(set_probability(np.ones(1), 0, 0.3, np.ones(1)), [1.0])


def test_a_shift_reaches_never_and_always() -> None:
    assert [shift_probability(0.4, s) for s in (-1.0, 0.0, 1.0)] == [0.0, 0.4, 1.0]
    assert shift_probability(0.4, 0.5) == pytest.approx(0.7)
    assert shift_probability(0.4, -0.5) == pytest.approx(0.2)


def test_rows_survive_as_text() -> None:
    rows = {4: np.array([0.0, 0.25, 0.75]), 0: np.array([1 / 3, 1 / 3, 1 / 3])}
    text = format_rows(rows)
    assert text == "1: 0.3333 0.3333 0.3333\n5: 0 0.25 0.75"
    for x, row in parse_rows(text).items():
        np.testing.assert_allclose(row, rows[x], atol=1e-15)
    assert parse_rows(" \n") == {}
    np.testing.assert_allclose(parse_rows("2: 2 0 6")[1], [0.25, 0.0, 0.75])


@pytest.mark.parametrize(
    "line", ["1", "1:", "0: 1", "x: 1", "1: a", "1: -1 2", "1: 0 0", "1: nan", "1: 1e308 1e308"]
)
def test_a_row_that_says_nothing_is_refused(line: str) -> None:
    with pytest.raises(LabError, match="a changed row is"):
        parse_rows(f"3: 1 1\n{line}")


def test_a_row_said_twice_is_refused() -> None:
    with pytest.raises(LabError, match="an earlier row of state 1"):
        parse_rows("1: 1 0\n1: 0 1")


def test_rows_that_do_not_fit_change_nothing() -> None:
    P = np.eye(2)
    rows = {0: np.array([0.5, 0.5]), 1: np.ones(3) / 3, 7: np.array([0.5, 0.5])}
    np.testing.assert_array_equal(replace_rows(P, rows), [[0.5, 0.5], [0.0, 1.0]])
    np.testing.assert_array_equal(P, np.eye(2))


# The process under a policy


def test_a_policy_mixes_the_controls() -> None:
    mixed, table = process("machine", 0.25), process("machine").table
    np.testing.assert_allclose(mixed.P, 0.25 * table.P[0] + 0.75 * table.P[1])
    np.testing.assert_allclose(mixed.C, 0.25 * table.C[:, 0] + 0.75 * table.C[:, 1])
    V = mixed.cost_to_go(0.9).V
    Q = mixed.action_values(0.9, V)
    np.testing.assert_allclose((mixed.policy * Q).sum(axis=1), V)


def test_edits_act_where_they_fit_and_only_without_controls() -> None:
    rows = {0: np.array([0.0, 0.5, 0.5, 0.0])}
    lights = process("lights", edit=ChainEdit(rows, 1, 3, 0.5))
    np.testing.assert_array_equal(lights.P[0], rows[0])
    np.testing.assert_allclose(lights.P[1], [0.0, 0.0, 0.5, 0.5])
    np.testing.assert_array_equal(lights.unedited, process("lights").P)
    assert lights.bead_targets(1, 0) == [0, 2, 3]
    for edit in (ChainEdit(rows, 9, 1, 0.5), ChainEdit(rows, 1, 9, 0.5)):
        np.testing.assert_array_equal(process("student", edit=edit).P, process("student").P)
    edit = ChainEdit({0: np.array([0.0, 0.0, 1.0])}, 0, 1, 1.0)
    np.testing.assert_array_equal(process("machine", edit=edit).P, process("machine").P)
    assert process("machine").bead_targets(0, 1) == []
    assert process("student").bead_targets(9, 1) == []


def test_states_that_are_left_for_good() -> None:
    assert process("doors").transient.tolist() == [True, False, False, False, False]


# The graph


@pytest.mark.parametrize("n", [1, 2, 3, 12])
def test_states_lie_apart(n: int) -> None:
    where = state_places(n)
    assert np.isfinite(where).all()
    for a, b in itertools.combinations(where, 2):
        assert np.linalg.norm(a - b) > 0.35


@pytest.mark.parametrize(("x", "y"), [(0, 1), (1, 0), (2, 5), (3, 3)])
def test_a_bead_is_found_where_it_is_put(x: int, y: int) -> None:
    where = state_places(6)
    for p in (0.0, 0.01, 0.37, 0.5, 1.0):
        assert probability_at(where, x, y, bead_place(where, x, y, p)) == pytest.approx(p)


def test_there_and_back_are_two_ribbons() -> None:
    where, s = state_places(6), np.linspace(0.0, 1.0, 50)
    there, back = ribbon_points(where, 0, 2, s), ribbon_points(where, 2, 0, s)
    assert np.linalg.norm(there[25] - back[25]) > 0.2


def test_a_ribbon_is_as_wide_as_it_is_probable() -> None:
    where = state_places(4)

    def width(p: float) -> float:
        left, right = ribbon(where, 0, 2, p)
        return float(np.linalg.norm(left[5] - right[5]))

    assert 0.0 < width(0.0) < width(0.5) < width(1.0)
    assert width(0.5) == pytest.approx((width(0.0) + width(1.0)) / 2)


def test_ribbons_make_one_strip() -> None:
    P = np.array([[0.5, 0.5], [1.0, 0.0]])
    strip, source = ribbons(state_places(2), P, P > 0.0)
    assert strip.shape[0] == 2
    assert strip.shape[1] == len(source)
    assert np.isfinite(strip).all()
    assert np.unique(source, return_counts=True)[1].tolist() == [
        2 * len(source) // 3,
        len(source) // 3,
    ]


@pytest.mark.parametrize(("x", "y"), [(0, 1), (4, 2), (3, 3)])
def test_a_token_goes_from_state_to_state(x: int, y: int) -> None:
    where = state_places(6)
    start, middle, end = (token_place(where, x, y, s) for s in (0.0, 0.5, 1.0))
    np.testing.assert_allclose(start[:2], where[x, :2], atol=1e-12)
    np.testing.assert_allclose(end[:2], where[y, :2], atol=1e-12)
    assert middle[2] > start[2] == end[2]
