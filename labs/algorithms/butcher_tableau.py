"""Butcher's tableau, and reading it as people write it (notes, A.1.3):

c_1 | a_11 ... a_1q
... | ...
c_q | a_q1 ... a_qq
    | b_1  ... b_q
"""

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from labs.errors import LabError
from labs.number_texts import parse_number, strip_comments

MAX_STAGES = 7
LARGEST_COEFFICIENT = 100.0
"""Of the numbers in a tableau that is typed in."""
SUM_TOLERANCE = 1e-8
"""How far sums may be off: room for numbers typed with nine digits."""


@dataclass(frozen=True, eq=False)
class Tableau:
    """Butcher's tableau: a (q, q), b (q,), c (q,)."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray

    @property
    def stages(self) -> int:
        return len(self.b)

    @cached_property
    def explicit(self) -> bool:
        """Whether a_ij = 0 for all j >= i."""
        return not bool(np.triu(self.a).any())

    @property
    def text(self) -> str:
        """As `parse_tableau` reads it, to the last bit."""
        rows = [(repr(float(c)), row) for c, row in zip(self.c, self.a, strict=True)]
        return "\n".join(
            f"{c} | {' '.join(repr(float(weight)) for weight in row)}"
            for c, row in [*rows, ("", self.b)]
        )


def parse_tableau(text: str, pick: int = 0) -> Tableau:
    """A tableau as it is typed: one row a line (or after a semicolon), "c | a_i1 a_i2 ...", the
    last one "| b_1 b_2 ...". Numbers are decimals or fractions, between blanks or commas; zeros at
    a row's end may be left out. An embedded pair has two rows of weights: number `pick`, 0 or 1,
    is taken. LaTeX goes, too, with & between the cells, and what a spreadsheet saves, with c in the
    first column. Raises LabError, its message a sentence that names the row."""
    lines = _lines(text)
    weights = 1
    while weights < len(lines) and lines[-weights - 1].startswith("|"):
        weights += 1
    q = len(lines) - weights
    if q < 1:
        raise LabError(
            "a tableau has at least two rows: 'c | a ...' for each stage and '| b ...' at the end"
        )
    if q > MAX_STAGES:
        raise LabError(f"there are {q} rows of stages; at most {MAX_STAGES} are taken")
    if weights > 2:
        raise LabError(f"there are {weights} rows of weights b at the end: one, or two of a pair")
    a, c = np.zeros((q, q)), np.zeros(q)
    for i, line in enumerate(lines[:q]):
        left, row = _row(line, f"row {i + 1}", q)
        if len(left) != 1:
            raise LabError(f"row {i + 1} ({line!r}) needs one number, c, before its bar '|'")
        c[i] = left[0]
        a[i, : len(row)] = row
        off = float(a[i].sum() - c[i])
        if abs(off) > SUM_TOLERANCE:
            raise LabError(
                f"row {i + 1}: c = {c[i]:.10g} but its a add up to {a[i].sum():.10g}, {off:+.2g} "
                "off; c_i is the sum of the a_ij"
            )
    b = [_weights(line, q, f"row {k} of b" if weights > 1 else "the last row")
         for k, line in enumerate(lines[q:], 1)]  # fmt: skip
    return Tableau(a, b[min(pick, weights - 1)], c)


def _weights(line: str, q: int, name: str) -> np.ndarray:
    left, given = _row(line, name, q)
    if left:
        raise LabError(f"{name} ({line!r}) holds the weights b: nothing goes before its bar '|'")
    # Where they add up to 1, those left out are 0.
    if len(given) != q and not (given and abs(sum(given) - 1.0) <= SUM_TOLERANCE):
        raise LabError(f"{name} has {len(given)} weights b; there are {q} stages")
    return np.array(given + [0.0] * (q - len(given)))


def _lines(text: str) -> list[str]:
    """The rows, each with one bar, without what is only for the eye."""
    text = strip_comments(text).replace("│", "|")
    text = re.sub(r"\\[dt]?frac\s*\{([^{}]*)\}\s*\{([^{}]*)\}", r"\1/\2", text)
    text = re.sub(r"\\(hline|begin\{[^}]*\}(\{[^}]*\})?|end\{[^}]*\})|\$", " ", text)
    text = re.sub(r"\\\\|;", "\n", _from_spreadsheet(text))
    separated = re.search(r",\s|\d\.\d|\d/\d", text)
    text = text.replace(",", " " if separated else ".")
    lines = [line.strip() for line in text.splitlines() if re.search(r"[^\s|+_=─-]", line)]
    return [
        (line if "|" in line else line.replace("&", "|", 1)).replace("&", " ").strip()
        for line in lines
    ]


def _from_spreadsheet(text: str) -> str:
    """Rows with bars where it is CSV: c, then the a, between tabs, semicolons or commas."""
    lines = [line for line in text.splitlines() if line.strip()]
    mark = ""
    if lines and (said := re.match(r"\W*sep=(.)", lines[0], re.IGNORECASE)):
        mark = said[1]
        lines.pop(0)
    body = "\n".join(lines)
    mark = mark or next((mark for mark in "\t;," if mark in body), "")
    if "|" in body or "&" in body or not mark or len(lines) < 2:
        return body
    rows = []
    for line in lines:
        c, *a = (cell.strip(' \t"').replace(",", ".") for cell in line.split(mark))
        while a and not a[-1]:
            a.pop()
        rows.append(f"{c} | {' '.join(cell or '0' for cell in a)}")
    return "\n".join(rows)


def _row(line: str, name: str, q: int) -> tuple[list[float], list[float]]:
    """The numbers on both sides of a row's bar."""
    left, bar, right = line.partition("|")
    if not bar:
        raise LabError(f"{name} ({line!r}) has no bar '|' between c and its weights")
    numbers = [_number(word, name) for word in right.split()]
    while len(numbers) > q and numbers[-1] == 0.0:
        numbers.pop()
    if len(numbers) > q:
        raise LabError(f"{name} has {len(numbers)} weights; there are {q} stages")
    return [_number(word, name) for word in left.split()], numbers


def _number(word: str, name: str) -> float:
    try:
        value = parse_number(word)
    except ValueError as error:
        raise LabError(f"{name}: {error}") from None
    if abs(value) > LARGEST_COEFFICIENT:
        raise LabError(f"{name}: {word} is beyond ±{LARGEST_COEFFICIENT:g}")
    return value
