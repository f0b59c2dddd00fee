"""Numbers in sentences, rounded so that the sentence stays true."""

import math
from decimal import ROUND_CEILING, Context, Decimal


def round_up(value: float, digits: int = 2) -> str:
    """`value` in so many significant digits, 6 at most, never below it: for what is said to be a
    bound."""
    if not math.isfinite(value):
        return f"{value:g}"
    up = Context(prec=digits, rounding=ROUND_CEILING).plus(Decimal(float(value)))
    return f"{float(up):g}"
