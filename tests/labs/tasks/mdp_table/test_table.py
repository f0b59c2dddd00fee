"""Tables that are typed or pasted: what they mean, and that each mistake is named."""

import json
import re
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labs.errors import LabError
from labs.problems.finite_mdp import random_policy
from labs.reinforcement_learning.dynamic_programming.params import DynamicProgrammingParams
from labs.reinforcement_learning.td_control.params import TdParams
from labs.tasks.mdp_table.table import MdpTable, parse_table

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


def same_table(a: MdpTable, b: MdpTable) -> bool:
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
    assert same_table(parse_table(text), parse_table(DECISION))


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
        ("state, A,,B\nA, 1,,", "a name of its own"),
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
        ("[1]", "row 1: a row is"),
        ('{"A": 1}', "a list of rows"),
        ('[{"state": "A", "to": {"A": 1}', "not sound JSON"),
        ("[" * 3000, "not sound JSON"),
        ('[{"state": "A", "to": [1]}]', "row 1: a row is"),
        ('[{"state": "A", "to": {"A": 1}, "goto": 2}]', "row 1: goto? A row has"),
        ('[{"next": "A", "to": "A", "from": "A"}]', "row 1: to again? A row has"),
        ('[{"from": "A", "From": "B", "to": "A"}]', "row 1: From again? A row has"),
        ('[{"to": {"A": 1}}]', "row 1: it does not name its state"),
        ('[{"state": "A", "to": {"A": null}}]', "row 1 (A): 'None' for A is not a number"),
        ('[{"state": "A", "to": {"A": NaN}}]', "row 1 (A): 'nan' for A is not a number"),
        ('[{"state": "A", "to": {"A": 0.5, "B": 0.5}}]', "row 1 (A): it leads to 'B'"),
    ],
)
def test_a_mistake_is_named(text: str, said: str) -> None:
    with pytest.raises(LabError, match=re.escape(said)):
        parse_table(text)


def test_a_state_may_be_named_like_a_column() -> None:
    table = parse_table("state, cost, to, B\nto, 1, 0.5, 0.5\nB, 0, 0, 1")
    assert table.states == ("to", "B")


def test_messages_list_some_states_only() -> None:
    names = [f"a long name, and the {k} th" for k in range(100)]
    rows = [{"state": name, "to": {name: 1}} for name in names]
    rows[0]["to"] = {"elsewhere": 1}
    with pytest.raises(LabError, match=r"leads to 'elsewhere', which has no row") as refused:
        parse_table(json.dumps(rows))
    assert len(str(refused.value)) < 500


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


LONG = """from, action, to, probability, cost
A, stay, A, 1, 1
A, go, A, 20 %, 3
A, go, B, 80 %, 3
"""


@pytest.mark.parametrize(
    "text",
    [
        LONG,
        LONG + "\n",
        "\ufeffsep=;\n" + LONG.replace(",", ";").replace("\n", ";\n"),
        LONG.replace("cost", "reward").replace(", 1\n", ", -1\n").replace(", 3\n", ", -3\n"),
        "s,a,s',p,r\nA,stay,A,,-1\nA,go,A,1/5,-3\nA,go,B,0.8,-3",
        "state\taction\tnext state\tprob\tcost\treward\nA\tstay\tA\t1\t1\t0\n"
        "A\tgo\tA\t0,2\t1\t-2\nA\tgo\tB\t0,8\t0\t-3",
        json.dumps(
            [
                {"from": "A", "action": "stay", "to": "A", "cost": 1},
                {"from": "A", "action": "go", "to": "A", "probability": 0.2, "reward": -3},
                {"from": "A", "action": "go", "to": "B", "probability": 0.8, "reward": -3},
            ]
        ),
    ],
    ids=["plain", "blank line", "excel", "rewards", "letters", "both, decimal commas", "json"],
)
def test_a_row_for_each_transition(text: str) -> None:
    found, wanted = parse_table(text), parse_table(DECISION)
    assert (found.states, found.controls) == (wanted.states, wanted.controls)
    np.testing.assert_allclose(found.P, wanted.P, atol=1e-15)
    np.testing.assert_allclose(found.C, wanted.C, atol=1e-15)
    assert "B has no row: an episode ends in it, at no cost." in found.notes
    rewarded = "reward" in text or ",r\n" in text
    assert any("Rewards" in note for note in found.notes) == rewarded


def test_json_has_the_names_that_csv_has() -> None:
    keys = [("state", "action", "next_state", "prob", "cost"), ("From", "Action", "To", "P", "C"),
            ("s", "a", "s'", "Chance", "l")]  # fmt: skip
    rows = [["A", "stay", "A", 1, 1], ["A", "go", "A", "20 %", 3], ["A", "go", "B", 0.8, 3]]
    for names in keys:
        assert same_table(
            parse_table(json.dumps([dict(zip(names, row, strict=True)) for row in rows])),
            parse_table(LONG),
        )


@pytest.mark.parametrize(
    ("name", "settings", "states"),
    [
        ("FrozenLake-v1", {}, 16),
        ("FrozenLake-v1", {"map_name": "8x8"}, 64),
        ("CliffWalking-v1", {}, 48),
    ],
)
@pytest.mark.parametrize(
    "write", [lambda P: json.dumps(P, default=int), str], ids=["json", "print"]
)
def test_dictionaries_of_gymnasium_fit(
    name: str, settings: dict[str, Any], states: int, write: Callable[[object], str]
) -> None:
    P = gymnasium.make(name, **settings).unwrapped.P  # type: ignore[attr-defined]
    text = write(P)
    for params in (DynamicProgrammingParams(table=text), TdParams(table=text)):
        table = parse_table(params.table)
    assert table.states == tuple(map(str, range(states)))
    for x, controls in P.items():
        for u, outcomes in controls.items():
            expected, cost = np.zeros(states), 0.0
            for p, y, reward, _ in outcomes:
                expected[y] += p
                cost -= p * reward
            if not table.terminal[x]:
                np.testing.assert_allclose(table.P[u, x], expected, atol=1e-12)
                assert table.C[x, u] == pytest.approx(cost, abs=1e-12)
    ends = {y for controls in P.values() for o in controls.values() for _, y, _, end in o if end}
    assert set(np.flatnonzero(table.terminal)) == ends


def test_a_hundred_states_fit_in_wide_form() -> None:
    names = [f"s{k}" for k in range(100)]
    rows = [
        ", ".join([name, "1", *("1" if k == (x + 1) % 100 else "0" for k in range(100))])
        for x, name in enumerate(names)
    ]
    text = "\n".join([", ".join(["state", "cost", *names]), *rows])
    assert len(text) > 20_000
    assert len(parse_table(DynamicProgrammingParams(table=text).table).states) == 100


def test_costs_of_transitions_are_expected_ones() -> None:
    table = parse_table("from,to,probability,reward\nA,A,1/4,8\nA,B,3/4,-4\nB,A,,")
    np.testing.assert_allclose(table.C, [[1.0], [0.0]])
    assert table.controls == ("",)


def test_not_every_state_has_every_control() -> None:
    text = "state,action,A,B\nA,x,1,\nA,y,,1\nB,y,1,\nB,z,0.5,0.5"
    table = parse_table(text)
    np.testing.assert_array_equal(table.available, [[True, True, False], [False, True, True]])
    mdp = table.mdp(0.9)
    np.testing.assert_allclose(random_policy(mdp), [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5]])
    assert [table.control(0, u) for u in range(3)] == ["x", "y", "x"]
    assert [table.control(1, u) for u in range(3)] == ["y", "y", "z"]
    np.testing.assert_array_equal(mdp.probabilities[2, 0], mdp.probabilities[0, 0])


def test_ends() -> None:
    empty = parse_table("state,cost,A,B\nA,1,0,1\nB,,,")
    np.testing.assert_array_equal(empty.terminal, [False, True])
    said = parse_table("from,to,reward,done\nA,B,1,true\nB,A,5,")
    np.testing.assert_array_equal(said.terminal, [False, True])
    gym = {
        "0": {"0": [[0.5, 0, 0.0, False], [0.5, 1, 1.0, True]], "1": [[1.0, 0, 0, False]]},
        "1": {"0": [[1.0, 1, 0, True]], "1": [[1.0, 1, 0, True]]},
    }
    table = parse_table(json.dumps(gym))
    np.testing.assert_array_equal(table.terminal, [False, True])
    np.testing.assert_allclose(table.P[0], [[0.5, 0.5], [0.0, 1.0]])
    np.testing.assert_allclose(table.C, [[-0.5, 0.0], [0.0, 0.0]])


def test_rounding_is_forgiven() -> None:
    table = parse_table("state,A,B\nA,1.0000000001,-1e-10\nB,33.3333333 %,66.6666667 %")
    np.testing.assert_array_equal(table.P[0, 0], [1.0, 0.0])
    assert table.P.sum(axis=2) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("from,to,p\nA,A,0.5\nA,B,0.4999", "from A: the probabilities sum to 0.9999; they must"),
        ("from,action,to,p\nA,go,A,1\nA,go,A,1", "from A under go: the probabilities sum to 2"),
        ("from,to,p\nA,,1", "row 1 (A): it does not say where it leads to"),
        ("from,to,p\nA,A,1.001", "row 1 (A): 1.001 for A: a probability is from 0 to 1"),
        ("from,to,done\nA,A,perhaps", "'perhaps' for terminal is neither true nor false"),
        ("from,to,p,to\nA,A,1,A", "a name of its own"),
        ("from,action,to\n" + "\n".join(f"A,u{k},A" for k in range(21)), "21 controls: at most 20"),
        (LONG.replace("probability", "probability [%]"), "probability [%]? The columns of a table"),
        (LONG.replace(" to,", " destination,"), "destination? The columns of a table are from,"),
        (LONG.replace("cost", "euros"), "euros? The columns of a table are from, action, to"),
        ('{"0": {"0": [[1, 0]]}}', "has for each state and control its outcomes"),
    ],
)
def test_mistakes_of_long_tables_are_named(text: str, said: str) -> None:
    with pytest.raises(LabError, match=re.escape(said)):
        parse_table(text)
