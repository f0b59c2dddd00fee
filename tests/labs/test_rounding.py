"""A bound in a sentence is one."""

from decimal import Decimal

import hypothesis.strategies as st
import pytest
from hypothesis import given

from labs.rounding import round_up


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.000846, 1, "0.0009"),
        (0.000846, 2, "0.00085"),
        (142.3, 2, "150"),
        (142.3, 3, "143"),
        (0.1, 2, "0.11"),  # the float is a little more than a tenth
        (0.5, 2, "0.5"),
        (9.99, 2, "10"),
        (0.0, 2, "0"),
        (-1.25, 2, "-1.2"),
        (float("inf"), 2, "inf"),
    ],
)
def test_a_few_numbers(value: float, digits: int, text: str) -> None:
    assert round_up(value, digits) == text


@given(st.floats(1e-300, 1e300), st.integers(1, 6))
def test_never_below_and_less_than_a_unit_above(value: float, digits: int) -> None:
    said, exact = Decimal(round_up(value, digits)), Decimal(value)
    assert exact <= said < exact * (1 + 10 * Decimal(10) ** -digits)
