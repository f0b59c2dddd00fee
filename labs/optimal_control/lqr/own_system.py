"""One's own A, B, Q, R and x0, as a system to regulate (notes, 2.4).

    A = 1 0.1; 0 1          a row a line, or after a semicolon; brackets and commas may stand
    B = 0.005; 0.1          between the numbers, as in NumPy or MATLAB, and JSON goes as well
    Q = diag(10, 1)
    R = 0.1                 one number stands for so many times the unit matrix
    x0 = 1 0

x_(t+1) = A x_t + B u_t, one step every T; or, where A and B are given in continuous time,
x' = A x + B u with u held for T (zero-order hold).
"""

import json
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from labs.algorithms.discretisation import zero_order_hold
from labs.errors import LabError
from labs.models.plant import Force
from labs.number_texts import parse_number, strip_comments, truncate
from labs.problems.linear_quadratic import LqrProblem

MATRIX_NAMES = ("A", "B", "Q", "R", "x0")
MAX_STATES, MAX_CONTROLS = 8, 4
MAX_ENTRY = 1e6
"""Of an entry; and of a state, relative to the largest of x0 or 1, before it is given up."""
MAX_GROWTH_RATE = 1e3
"""[1/s] Of what grows by itself in continuous time: exp(A T) is to be a number for every T."""
EXAMPLE_SYSTEM = "A = 1 0.1; 0 1\nB = 0.005; 0.1\nQ = diag(10, 1)\nR = 0.1\nx0 = 1 0"
"""A mass of 1 kg, pushed for 0.1 s a step."""


@dataclass(frozen=True, eq=False)
class OwnSystem:
    """Nothing moves it but its matrices; its rest is x = 0, u = 0."""

    a: np.ndarray
    """(n, n)."""
    b: np.ndarray
    """(n, m)."""
    q: np.ndarray
    """(n, n)."""
    r: np.ndarray
    """(m, m)."""
    x0: np.ndarray
    """(n,)."""
    continuous: bool
    """Whether A and B are of x' = A x + B u."""

    @property
    def nx(self) -> int:
        return len(self.a)

    @property
    def nq(self) -> int:
        """How many numbers of x are shown as places: all."""
        return self.nx

    @property
    def nu(self) -> int:
        return int(self.b.shape[1])

    @property
    def x_eq(self) -> np.ndarray:
        return np.zeros(self.nx)

    @property
    def u_eq(self) -> np.ndarray:
        return np.zeros(self.nu)

    def linear(self, period: float) -> tuple[np.ndarray, np.ndarray]:
        """A (n, n) and B (n, m) of one step of `period` [s]."""
        return zero_order_hold(self.a, self.b, period) if self.continuous else (self.a, self.b)

    def phase_point(self, x: np.ndarray) -> np.ndarray:
        """(2,) its first numbers."""
        return np.asarray(np.resize(x, 2))

    def out_of_range(self, x: np.ndarray) -> str:
        """Why it is followed no further, "it ..."; empty while it is."""
        most = MAX_ENTRY * max(1.0, float(np.abs(self.x0).max()))
        return "" if np.abs(x).max() <= most else f"its state passed {most:g}"


def step_own_system(
    problem: LqrProblem, x: np.ndarray, u: np.ndarray, force: Force | None = None
) -> np.ndarray:
    """x (n,) one step later under u (m,), to which a push adds its force [N]; A and B of the step
    are those of `problem`."""
    push = force(np.zeros(3))[1] if force else 0.0
    return np.asarray(problem.a @ x + problem.b @ (u + push))


@lru_cache(maxsize=32)
def parse_own_system(text: str, continuous: bool = False) -> OwnSystem:
    """The system a text describes. Raises LabError, naming the matrix and what it must be."""
    said = _read_json(text) if text.lstrip()[:1] == "{" else _read_assignments(text)
    missing = [name for name in MATRIX_NAMES if name not in said]
    if missing:
        raise LabError(f"{', '.join(missing)} missing: A = 1 0.1; 0 1 and so on, each on a line")
    a = said["A"]
    n = len(a)
    if a.shape != (n, n) or n > MAX_STATES:
        raise LabError(f"A is {_size_text(a)}: it is square, {MAX_STATES} x {MAX_STATES} at most")
    b = said["B"].T if said["B"].shape == (1, n) and n > 1 else said["B"]
    if len(b) != n or b.shape[1] > MAX_CONTROLS:
        raise LabError(
            f"B is {_size_text(b)}: it has {n} rows as A has, and a column for each of at most "
            f"{MAX_CONTROLS} controls"
        )
    q = _weight_matrix("Q", said["Q"], n, "A")
    r = _weight_matrix("R", said["R"], b.shape[1], "B's columns")
    x0 = said["x0"].ravel()
    if len(x0) != n:
        raise LabError(f"x0 has {len(x0)} numbers: A wants {n}")
    LqrProblem(1, a, b, q, r, q)
    if continuous and (fastest := float(np.linalg.eigvals(a).real.max())) > MAX_GROWTH_RATE:
        raise LabError(
            f"A grows as exp({fastest:g} t): in continuous time exp({MAX_GROWTH_RATE:g} t) "
            "goes at most"
        )
    return OwnSystem(a, b, q, r, x0, continuous)


def _weight_matrix(name: str, given: np.ndarray, n: int, like: str) -> np.ndarray:
    if given.shape == (1, 1):
        given = given * np.eye(n)
    if given.shape == (1, n):
        given = np.diag(given[0])
    if given.shape != (n, n):
        raise LabError(f"{name} is {_size_text(given)}: it is {n} x {n}, for {like}")
    return given


def _read_json(text: str) -> dict[str, np.ndarray]:
    try:
        said = json.loads(text, parse_int=float)
    except (ValueError, RecursionError) as error:
        raise LabError(f"the matrices are not sound JSON: {error}") from None
    return {
        _matrix_name(name): _parse_matrix(name, _json_rows(name, entry))
        for name, entry in said.items()
    }


def _json_rows(name: str, entry: Any) -> list[list[str]]:
    rows = entry if isinstance(entry, list) else [entry]
    rows = rows if any(isinstance(row, list) for row in rows) else [rows]
    if not all(isinstance(row, list) for row in rows):
        raise LabError(f"{name}: a list of rows goes, each a list of numbers")
    return [[str(number) for number in row] for row in rows]


def _read_assignments(text: str) -> dict[str, np.ndarray]:
    text = re.sub(r",\s*dtype\s*=\s*[\w.]+", "", strip_comments(text))
    parts = re.split(r"(?:^|[\n;,])\s*([A-Za-z]\w*)\s*[=:]", text)
    if parts[0].strip() or len(parts) < 2:
        raise LabError(
            f"{truncate(parts[0].strip())!r}: each matrix begins with its name, A = 1 0.1; 0 1"
        )
    said: dict[str, np.ndarray] = {}
    for name, entry in zip(parts[1::2], parts[2::2], strict=True):
        said[_matrix_name(name)] = _parse_matrix(name, *_text_rows(name, entry))
    return said


def _text_rows(name: str, entry: str) -> tuple[list[list[str]], bool]:
    """The numbers row by row, and whether they are a diagonal."""
    entry = re.sub(r"\b(?:np|numpy)\.|\b(?:array|matrix|mat)\b", "", entry)
    diagonal = "diag" in entry
    entry = re.sub(r"\b(?:block_)?diag\b", "", entry)
    if call := re.search(r"[^\W\d]\w*\s*\(", entry):
        raise LabError(
            f"{name}: {truncate(call[0])}...) is not worked out: write the numbers row by row, or "
            "diag(1, 2); a single number of Q or R stands for so many times the unit matrix"
        )
    entry = re.sub(r"\]\s*,?\s*\[", ";", entry)
    rows = re.sub(r"[\[\](){}]", " ", entry)
    split = [re.split(r"[,\s]+", row.strip(" ,\t")) for row in re.split(r"[;\n]", rows)]
    return [row for row in split if any(row)], diagonal


def _parse_matrix(name: str, rows: list[list[str]], diagonal: bool = False) -> np.ndarray:
    widths = {len(row) for row in rows}
    if len(widths) != 1 or not any(rows):
        sizes = ", ".join(str(len(row)) for row in rows if row) or "no"
        raise LabError(f"{name}: its rows have {sizes} numbers; all are of one length")
    try:
        found = np.array([[parse_number(number) for number in row] for row in rows])
    except ValueError as error:
        raise LabError(f"{name}: {error}") from None
    if np.abs(found).max() > MAX_ENTRY:
        raise LabError(f"{name} holds {np.abs(found).max():g}: numbers up to {MAX_ENTRY:g} go")
    return np.diag(found.ravel()) if diagonal else found


def _matrix_name(name: str) -> str:
    meant = {known.lower(): known for known in MATRIX_NAMES} | {"x_0": "x0", "x": "x0"}
    if name.lower() not in meant:
        raise LabError(f"{name}? There are {', '.join(MATRIX_NAMES)}")
    return meant[name.lower()]


def _size_text(matrix: np.ndarray) -> str:
    return " x ".join(map(str, matrix.shape))
