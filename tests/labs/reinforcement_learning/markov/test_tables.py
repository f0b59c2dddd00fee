"""Tables that are typed or pasted: what they mean, and that each mistake is named."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labs.errors import LabError
from labs.reinforcement_learning.markov.tables import Table, parse_table

CHAIN = "state, cost, A, B\nA, 1, 1/2, 0.5\nB, 0, 0, 1\n"
DECISION = """state, control, cost, A, B
A, stay, 1, 1, 0
A, go, 3, .2, .8
B, , 0, , 1
"""
ROWS = [
    {"state": "A", "control": "stay", "cost": 1, "to": {"A": 1}},
    {"state": "A", "control": "go", "cost": 3, "to": {"A": 0.2, "B": "4/5"}},
    {"state": "B", "to": {"B": 1}},
]


def same(a: Table, b: Table) -> bool:
    return (
        (a.states, a.controls) == (b.states, b.controls)
        and np.array_equal(a.P, b.P)
        and np.array_equal(a.C, b.C)
    )


def test_a_chain() -> None:
    table = parse_table(CHAIN)
    assert (table.states, table.controls) == (("A", "B"), ("",))
    np.testing.assert_array_equal(table.P, [[[0.5, 0.5], [0.0, 1.0]]])
    np.testing.assert_array_equal(table.C, [[1.0], [0.0]])
    np.testing.assert_array_equal(table.terminal, [False, True])


def test_a_decision_process_is_one_for_the_algorithms() -> None:
    table = parse_table(DECISION)
    assert table.controls == ("stay", "go")
    np.testing.assert_allclose(table.P, [[[1.0, 0.0], [0.0, 1.0]], [[0.2, 0.8], [0.0, 1.0]]])
    np.testing.assert_array_equal(table.C, [[1.0, 3.0], [0.0, 0.0]])
    mdp = table.mdp(0.9)
    assert (mdp.X, mdp.U, mdp.gamma) == (2, 2, 0.9)
    np.testing.assert_array_equal(mdp.terminal, [False, True])
    np.testing.assert_array_equal(mdp.probabilities, table.P)


@pytest.mark.parametrize(
    "text",
    [
        DECISION.replace(",", "\t"),
        DECISION.replace(".", ",").replace(", ", "; ").replace(",\n", ";\n"),
        DECISION.replace("A, stay", '"A", "stay"'),
        "\n" + DECISION.replace("\n", "\r\n") + "\n , , , ,\n",
        DECISION.replace("state", "State").replace("cost", "COST"),
        json.dumps(ROWS),
        json.dumps(ROWS, indent=2),
    ],
    ids=["tabs", "semicolons", "quoted", "blank lines", "capitals", "json", "json in lines"],
)
def test_other_ways_to_write_it(text: str) -> None:
    assert same(parse_table(text), parse_table(DECISION))


def test_columns_may_have_any_order_and_costs_may_be_missing() -> None:
    table = parse_table("state, B, A\nA, 1, 0\nB, 0.25, 0.75")
    np.testing.assert_array_equal(table.P, [[[0.0, 1.0], [0.75, 0.25]]])
    assert not table.C.any()


def test_rounded_rows_are_scaled_to_sum_to_one() -> None:
    table = parse_table("state, A, B, C\nA, 0.3333333, 0.3333333, 0.3333333\nB,,1,\nC,,,1")
    assert table.P[0, 0].sum() == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "begins with state"),
        ("   \n ", "begins with state"),
        ("name, A\nA, 1", "begins with state"),
        ("state, A\n", "no rows"),
        ("[]", "no rows"),
        ("state, A, A\nA, 1, 0", "a name of its own"),
        ("state, A,\nA, 1,", "a name of its own"),
        (CHAIN.replace("0.5", "0.4"), "row 1 (A): the probabilities sum to 0.9; they must sum"),
        (CHAIN.replace("0, 1\n", "-0.5, 1.5\n"), "row 2 (B): -0.5 for A: a probability is from 0"),
        (CHAIN.replace("0.5", "half"), "row 1 (A): 'half' for B is not a number"),
        (CHAIN.replace("1/2", "1/0"), "row 1 (A): '1/0' for A is not a number"),
        (CHAIN.replace("1/2", "nan"), "row 1 (A): 'nan' for A is not a number"),
        (CHAIN.replace("1, 1/2", "1e400, 1/2"), "row 1 (A): '1e400' for cost is not a number"),
        (CHAIN.replace("1, 1/2", "1e7, 1/2"), "row 1 (A): the cost 1e+07 is beyond 1e+06"),
        (CHAIN.replace("0.5", "0.5, 0"), "row 1 (A): 5 entries for 4 columns"),
        (CHAIN + "A, 0, 1, 0", "row 3 (A): there is an earlier row"),
        (CHAIN + ", 0, 1, 0", "row 3: it does not name its state"),
        ("state, A, B\nA, 1, 0", "row 1 (A): it leads to 'B', which has no row"),
        (DECISION + "A, , 0, 1, 0", "row 4 (A): there is an earlier row"),
        (DECISION.replace("A, go, 3", "B, go, 3"), "there is an earlier row"),
        ("state,control,A,B\nA,go,1,\nA,stay,1,\nB,go,,1", "no row for state B under control stay"),
        ("[1]", "row 1: a row is"),
        ('{"A": 1}', "a list of rows"),
        ('[{"state": "A", "to": {"A": 1}', "not sound JSON"),
        ("[" * 3000, "not sound JSON"),
        ('[{"state": "A", "to": [1]}]', "row 1: a row is"),
        ('[{"state": "A", "to": {"A": 1}, "goto": 2}]', "row 1: goto? A row has"),
        ('[{"to": {"A": 1}}]', "row 1: it does not name its state"),
        ('[{"state": "A", "to": {"A": null}}]', "row 1 (A): 'None' for A is not a number"),
        ('[{"state": "A", "to": {"A": NaN}}]', "row 1 (A): 'nan' for A is not a number"),
        ('[{"state": "A", "to": {"A": 0.5, "B": 0.5}}]', "row 1 (A): it leads to 'B'"),
    ],
)
def test_a_mistake_is_named(text: str, said: str) -> None:
    with pytest.raises(LabError) as refused:
        parse_table(text)
    assert said in str(refused.value)


def test_too_many_states() -> None:
    with pytest.raises(LabError, match="has 2 states: at most 1"):
        parse_table(CHAIN, most=1)


@given(st.text(st.sampled_from('state,cost;AB01./-"\n\t[]{}:'), max_size=60))
@settings(deadline=None, max_examples=300)
def test_whatever_is_pasted_is_a_sound_table_or_refused(text: str) -> None:
    for pasted in (text, "state,A\n" + text, '[{"state":"A","to":' + text):
        try:
            table = parse_table(pasted)
        except LabError:
            continue
        np.testing.assert_allclose(table.P.sum(axis=2), 1.0, atol=1e-12)
        table.mdp(0.5)
