"""Numbers as people type and read them."""

import pytest

from labs.algorithms.butcher_tableau import parse_tableau
from labs.errors import LabError
from labs.number_texts import (
    MAX_NUMBER_LENGTH,
    count_text,
    parse_number,
    strip_comments,
    with_minus_signs,
)
from labs.reinforcement_learning.markov.chains import parse_rows
from labs.tasks.mdp_table.table import parse_table

HUGE_NUMBERS = ["1e9000000", "1e-9000000/1e9000000", "1/1e9000000", "9" * 300, "0." + "3" * 300]
"""What exact arithmetic would need minutes for, or what no number is that long."""


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.25", 0.25),
        (" 1e-3 ", 1e-3),
        ("1/3", 1 / 3),
        ("-2187/6784", -2187 / 6784),
        ("\u22122", -2.0),
        ("25 %", 0.25),
        ("1/4%", 0.0025),
        ("0." + "3" * (MAX_NUMBER_LENGTH - 2), 1 / 3),
    ],
)
def test_a_number_is_read(text: str, value: float) -> None:
    assert parse_number(text) == value


@pytest.mark.parametrize(
    "text",
    [
        *HUGE_NUMBERS,
        "",
        "x",
        "1/0",
        "1/2/3",
        "nan",
        "inf",
        "1/inf",
        "1_0",
        "%",
        "5%%",
        "1e400",
        "0x10",
    ],
)
def test_what_is_no_number_is_refused_at_once_and_shown_in_short(text: str) -> None:
    with pytest.raises(ValueError, match="is no number: write") as refused:
        parse_number(text)
    assert len(str(refused.value)) < 100


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("50 % | 50 \t%", "50% | 50%"),
        ("% plant\n1 0\n# rest\n2", "\n1 0\n\n2"),
        ("1 0; % 2 states\n10 %cheap\n5 %, 6 %;", "1 0;\n10 \n5%, 6%;"),
        ("\ufeff1 # one\r\n2\r3", "1 \n2\n3"),
    ],
)
def test_comments_are_left_out_and_per_cent_signs_kept(text: str, plain: str) -> None:
    assert strip_comments(text) == plain


@pytest.mark.parametrize("number", HUGE_NUMBERS)
def test_no_text_of_a_lab_is_read_at_unbounded_cost(number: str) -> None:
    """Each of these is refused in microseconds; exact arithmetic would run into the time limit."""
    with pytest.raises(LabError):
        parse_tableau(f"0 | ; | {number}")
    with pytest.raises(LabError):
        parse_table(f"state, cost, A\nA, {number}, 1")
    with pytest.raises(LabError):
        parse_table(f'[{{"state": "A", "cost": "{number}", "to": {{"A": 1}}}}]')
    with pytest.raises(LabError):
        parse_rows(f"1: {number} {number}")


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("v = -8 rad/s", "v = \u22128 rad/s"),
        ("-1", "\u22121"),
        ("(-.5, 2)", "(\u2212.5, 2)"),
        ("at most 1e-05", "at most 1e\u221205"),
        ("n-step, from 3-5 on", "n-step, from 3-5 on"),
        ("column-2", "column-2"),
    ],
)
def test_numbers_have_the_sign_of_mathematics(text: str, shown: str) -> None:
    assert with_minus_signs(text) == shown


def test_one_is_no_plural() -> None:
    counts = (0, 1, 2, 1024)
    assert [count_text(n, "sweep") for n in counts] == [
        "0 sweeps",
        "1 sweep",
        "2 sweeps",
        "1,024 sweeps",
    ]
