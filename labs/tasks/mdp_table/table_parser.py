"""Reading tables of Markov decision processes as people write them: CSV (commas, semicolons or
tabs) or JSON, wide or long.

Wide, a row for each state, or for each state and control, and a column for each next state:

    state, cost, A,   B              state, control, cost, A,   B
    A,     1,    1/2, 1/2            A,     stay,    1,    1,   0
    B,     0,    0,   1              A,     go,      3,    0.2, 0.8
                                     B,     ,        0,    0,   1

Long, a row for each transition:

    from, action, to, probability, reward
    A,    stay,   A,  1,           -1
    A,    go,     A,  20 %,        -3
    A,    go,     B,  80 %,        -3

In JSON a list of such rows, {"state": "A", "control": "go", "cost": 3, "to": {"A": 0.2, "B": 0.8}}
or {"from": "A", "action": "go", "to": "B", "probability": 0.8, "reward": -3}, or the dictionary P
of Gymnasium's environments, {"0": {"1": [[probability, next state, reward, terminated], ...]}},
also as Python prints it.

The order of the rows is the order of the states; an episode starts in the first. Costs may be left
out (0), and so may probabilities that are 0, or in a long row 1. A reward is a negative cost. A
state that long rows lead to, and that has none, is terminal, and so is one whose wide row is empty.
A row without a control, among others that have one, is of all controls; a state need not have all.
Rows are counted from 1 below the heading; errors name them.
"""

import csv
import io
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from labs.errors import LabError
from labs.number_texts import parse_number, truncate

MAX_COST = 1e6
"""Of a cost, either sign."""
PROBABILITY_TOLERANCE = 1e-9
"""So far a probability may be from 0 and 1 and still be one of them: rounding."""
HEADINGS = {
    "state": ("state", "from", "s", "source", "current state"),
    "control": ("control", "action", "a", "u"),
    "to": ("to", "next", "next state", "next_state", "s'", "s_next", "successor", "target"),
    "p": ("probability", "prob", "p", "chance", "pr"),
    "cost": ("cost", "c", "l"),
    "reward": ("reward", "r"),
    "end": ("terminal", "terminated", "done", "end"),
}
"""What the columns of a long table may be called, ..."""
COLUMN_OF_HEADING = {word: name for name, words in HEADINGS.items() for word in words}
WIDE_HEADINGS = {"state": "state", "from": "state", "control": "control", "action": "control"}
WIDE_HEADINGS |= {"cost": "cost", "reward": "reward"}
"""... and of a wide one, whose other columns are states."""
TRUE_WORDS, FALSE_WORDS = ("1", "1.0", "true", "yes", "x"), ("", "0", "0.0", "false", "no")


@dataclass(frozen=True)
class TableRow:
    """A row."""

    number: int
    state: str
    control: str
    cost: float
    to: Mapping[str, float]
    """The probabilities of the next states."""
    long: bool
    """Whether it is one of several for the same state and control."""
    terminal_states: tuple[str, ...] = ()
    """States it says are terminal."""

    @property
    def name(self) -> str:
        return _row_name(self.number, self.state, self.control)


def read_rows(text: str) -> tuple[list[TableRow], tuple[str, ...]]:
    """The rows, and what was understood otherwise than written. Raises LabError."""
    text = text.replace("\ufeff", "")
    reader = _read_json if text.lstrip()[:1] in ("[", "{") else _read_csv
    rewarded: list[str] = []
    entries = list(reader(text, rewarded))
    notes = ("Rewards are read as costs of the other sign.",) if rewarded else ()
    return entries, notes


def _read_csv(text: str, rewarded: list[str]) -> Iterator[TableRow]:
    lines = [line for line in text.splitlines() if line.strip()]
    mark = ""
    if lines and lines[0].strip().strip('"').lower().startswith("sep="):
        mark = lines.pop(0).strip().strip('"')[4:5]
    mark = mark or next((mark for mark in "\t;" if lines and mark in lines[0]), ",")
    try:
        table = csv.reader(io.StringIO("\n".join(lines)), delimiter=mark, skipinitialspace=True)
        cells = [[cell.strip() for cell in line] for line in table]
    except (csv.Error, TypeError) as error:
        raise LabError(f"the table cannot be read: {error}") from None
    cells = [line for line in cells if any(line)]
    heading = _strip_trailing_empty(cells[0]) if cells else []
    columns, long = _parse_heading(heading, cells[1:])
    for number, line in enumerate(cells[1:], 1):
        if len(line) > len(columns):
            line = line[: len(columns)] + _strip_trailing_empty(line[len(columns) :])
        name = _row_name(number, line[0])
        if len(line) != len(columns):
            raise LabError(f"{name}: {len(line)} entries for {len(columns)} columns")
        row: dict[str, Any] = dict(zip(columns, line, strict=True))
        if mark != ",":  # numbers may then have a decimal comma
            words = ("state", "control", "to") if long else ("state", "control")
            row = {k: v if k in words else v.replace(",", ".") for k, v in row.items()}
        if not long:
            first = {k: row.pop(k) for k in ("state", "control", "cost", "reward") if k in row}
            row = first | {"to": row if any(row.values()) else {first["state"]: 1}}
        yield _parse_row(number, row, rewarded, "to" if long else "")


def _parse_heading(columns: Sequence[str], rows: Sequence[list[str]]) -> tuple[list[str], bool]:
    """The columns by the names used here, and whether the table is long."""
    lower = [column.lower() for column in columns]
    named = [COLUMN_OF_HEADING.get(column, "") for column in lower]
    _check_headings(columns, named, rows)
    long = "to" in named and all(named)
    if not long:
        named = [WIDE_HEADINGS.get(low, own) for low, own in zip(lower, columns, strict=True)]
    if not columns or named[0] != "state":
        raise LabError(
            "the heading of a table begins with state, then control and cost where there are any, "
            "then the name of each state: state, cost, A, B; or it is from, action, to, "
            "probability, reward"
        )
    if len(set(named)) < len(named) or "" in named:
        raise LabError(f"each column has a name of its own; the heading is {', '.join(columns)}")
    return named, long


def _check_headings(
    columns: Sequence[str], named: Sequence[str], rows: Sequence[list[str]]
) -> None:
    """Raises LabError where a column means nothing here and is no state with a row of its own, and
    the table is long all the same, or its cells are no probabilities."""
    have_rows = {row[0] for row in rows}
    strange = [
        k for k, own in enumerate(columns) if k and own and not named[k] and own not in have_rows
    ]
    cells = (row[k] for row in rows for k in strange if k < len(row))
    if strange and ("to" in named or any(re.match(r"[^\W\d]", cell) for cell in cells)):
        raise LabError(
            f"{', '.join(truncate(columns[k]) for k in strange[:5])}? The columns of a table are "
            "from, action, to, probability, cost or reward, terminal; or state, action, cost, and "
            "one for each state, which has a row"
        )


def _strip_trailing_empty(cells: Sequence[str]) -> list[str]:
    """Cells without the empty ones that delimiters at the end of a line make."""
    kept = list(cells)
    while kept and not kept[-1]:
        kept.pop()
    return kept


def _read_json(text: str, rewarded: list[str]) -> Iterator[TableRow]:
    try:
        rows = json.loads(_python_to_json(text), parse_int=float)
    except (ValueError, RecursionError) as error:
        raise LabError(f"the table is not sound JSON: {error}") from None
    if isinstance(rows, dict):
        rows = list(_gymnasium_rows(rows))
    for number, row in enumerate(rows, 1):
        named = _normalize_keys(row) if isinstance(row, dict) else {}
        if not isinstance(named.get("to"), dict | str | float):
            raise LabError(
                f'row {number}: a row is {{"state": "A", "cost": 1, "to": {{"A": 1}}}}, '
                'with a "control" where there are any; or {"from": "A", "to": "A", '
                '"probability": 1}'
            )
        strange = [truncate(key) for key in named if key not in HEADINGS]
        if strange:
            raise LabError(
                f"row {number}: {', '.join(sorted(strange)[:5])}? A row has state, control, cost, "
                "to, or from, action, to, probability, reward, terminal, each once"
            )
        yield _parse_row(number, named, rewarded, "" if isinstance(named["to"], dict) else "to")


def _normalize_keys(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row by the names used here; what is strange, or there twice, by its own."""
    named: dict[str, Any] = {}
    for key, value in row.items():
        meant = COLUMN_OF_HEADING.get(key.strip().lower(), key)
        named[f"{key} again" if meant in named else meant] = value
    return named


def _python_to_json(text: str) -> str:
    """JSON of a dictionary P that was printed: {0: {1: [(1.0, np.int64(0), -1, False)]}}."""
    if not re.match(r"\s*\{\s*\d", text):
        return text
    text = re.sub(r"\b(?:np|numpy)\.\w+\(([^()]*)\)", r"\1", text)
    text = re.sub(r"\b(\d+)\s*:", r'"\1":', text).translate(str.maketrans("()", "[]"))
    return re.sub(r"\b(?:True|False)\b", lambda found: found[0].lower(), text)


def _gymnasium_rows(P: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The transitions of the dictionary P."""
    try:
        for state, controls in P.items():
            for control, outcomes in controls.items():
                for p, ahead, reward, terminated in outcomes:
                    yield {
                        "state": state, "control": control, "to": ahead, "p": p,
                        "reward": reward, "end": terminated,
                    }  # fmt: skip
    except (TypeError, ValueError, AttributeError):
        raise LabError(
            'a table in JSON is a list of rows, [{"state": "A", "to": {"A": 1}}], or has for each '
            'state and control its outcomes, {"0": {"1": [[probability, next state, reward, '
            "terminated]]}}"
        ) from None


def _parse_row(number: int, row: Mapping[str, Any], rewarded: list[str], long: str) -> TableRow:
    state, control = (_parse_name(row.get(key, "")) for key in ("state", "control"))
    name = _row_name(number, state, control)
    if not state:
        raise LabError(f"row {number}: it does not name its state")
    cost = _parse_number(row.get("cost", 0), name, "cost") - _parse_number(
        row.get("reward", 0), name, "reward"
    )
    if "reward" in row:
        rewarded.append(name)
    if abs(cost) > MAX_COST:
        raise LabError(f"{name}: the cost {cost:g} is beyond {MAX_COST:g}")
    if not long:
        to = {str(y).strip(): _parse_probability(p, name, str(y)) for y, p in row["to"].items()}
        return TableRow(number, state, control, cost + 0.0, to, False)
    ahead = _parse_name(row["to"])
    if not ahead:
        raise LabError(f"{name}: it does not say where it leads to")
    given = row.get("p", 1)
    p = _parse_probability(1 if given == "" else given, name, ahead)
    end = str(row.get("end", "")).strip().lower()
    if end not in TRUE_WORDS + FALSE_WORDS:
        raise LabError(f"{name}: {truncate(end)!r} for terminal is neither true nor false")
    return TableRow(
        number, state, control, cost + 0.0, {ahead: p}, True, (ahead,) * (end in TRUE_WORDS)
    )


def _parse_name(value: object) -> str:
    """The name of a state or a control; that of a number is the number."""
    return f"{value:g}" if isinstance(value, float) else str(value).strip()


def _parse_probability(entry: object, name: str, column: str) -> float:
    value = _parse_number(entry, name, column)
    if not -PROBABILITY_TOLERANCE <= value <= 1.0 + PROBABILITY_TOLERANCE:
        raise LabError(f"{name}: {value:.12g} for {column}: a probability is from 0 to 1")
    return min(max(value, 0.0), 1.0)


def _parse_number(entry: object, name: str, column: str) -> float:
    """A number, or a fraction; an empty entry is 0."""
    try:
        return parse_number(str(entry).strip() or "0")
    except ValueError:
        raise LabError(f"{name}: {truncate(str(entry))!r} for {column} is not a number") from None


def _row_name(number: int, state: str, control: str = "") -> str:
    """Of a row, in errors."""
    return f"row {number} ({', '.join(filter(None, (state, control)))})"
