"""Numbers as people type them into tables, tableaus and matrices, read at a bounded cost; and the
sign of those they read.

Exact arithmetic would turn the nine letters of 1e9000000 into a number of nine million digits
first; here a number is a float from the beginning, and its text is short."""

import contextlib
import math
import re

MAX_NUMBER_LENGTH = 64
"""Characters: 17 digits tell any float, and a fraction has two."""
MAX_QUOTED_LENGTH = 24
"""Characters of what is refused that its refusal repeats."""


def parse_number(text: str) -> float:
    """A finite number: a decimal (0.25, -1e-3), a fraction of two (1/4), or per cent of either
    (25 %); a minus may be the sign of mathematics. Raises ValueError, its message a sentence."""
    written = text.strip().replace("\u2212", "-")
    top, per_cent, after = written.partition("%")
    numerator, slash, denominator = top.partition("/")
    value = math.nan
    if len(written) <= MAX_NUMBER_LENGTH and not after and "_" not in written:
        with contextlib.suppress(ValueError, ZeroDivisionError):
            divisor = float(denominator) if slash else 1.0
            # Of 1/inf nothing may be left either.
            value = float(numerator) / divisor if math.isfinite(divisor) else math.nan
    value /= 100.0 if per_cent else 1.0
    if not math.isfinite(value):
        raise ValueError(f"{truncate(text)!r} is no number: write 0.25, 1e-3, 1/4 or 25 %")
    return value


def strip_comments(text: str) -> str:
    """Rows of numbers without byte order mark and comments (# or, as in MATLAB and LaTeX, a % that
    follows no number, or that a letter follows), and with per cent signs beside their numbers."""
    text = "\n".join(text.replace("\ufeff", "").splitlines())
    text = re.sub(r"#.*", "", text)
    text = re.sub(r"(?m)(?:^|(?<=[^\w.\s]))[ \t]*%.*|%[ \t]*[^\W\d].*", "", text)
    return re.sub(r"[ \t]+%", "%", text)


def with_minus_signs(text: str) -> str:
    """A text with the sign of mathematics before its numbers: -8 rad/s is \u22128 rad/s. Hyphens in
    words (n-step, H-1) and ranges (3-5) remain."""
    return re.sub(r"(?<![\w)])-(?=\.?\d)|(?<=\de)-(?=\d)", "\u2212", text)


def truncate(text: str) -> str:
    """What a refusal repeats of a text."""
    return text if len(text) <= MAX_QUOTED_LENGTH else f"{text[: MAX_QUOTED_LENGTH - 1]}\u2026"


def count_text(count: int, noun: str) -> str:
    """1 sweep, 1,024 sweeps."""
    return f"{count:,} {noun}" if count == 1 else f"{count:,} {noun}s"
