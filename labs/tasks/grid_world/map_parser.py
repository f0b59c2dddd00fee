"""Reading maps as people write them (the letters are in map.py): as plain rows, as a list of rows
or of lists of cells in quotes, as NumPy prints one, with blanks or commas between the cells, in
letters of other books.
"""

import contextlib
import math
import re
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass

from labs.errors import LabError
from labs.number_texts import parse_number

TRANSLATIONS = {"F": ".", "X": "#", " ": ".", "_": "."}
"""Letters of other maps: FrozenLake's frozen cells, mazes' walls and ways."""
KIND_NAMES = {".": "free", "#": "wall"}
MAX_COST = 1e4
"""Of a cell, either sign."""
_LEGEND = re.compile(r"\s*(\S)\s*[=:]\s*(\S.*)")
_QUOTED = re.compile(r"""["']([^"']*)["']""")
_VALUE = re.compile(r"(?:(cost|reward)\s+)?([-+−]?[\d./]{1,20})", re.IGNORECASE)


@dataclass(frozen=True)
class CellKind:
    """What the map says of a letter of its own."""

    cost: float
    """Of a step that leads there."""
    terminal: bool
    """Whether the episode ends there."""


@dataclass(frozen=True)
class ParsedMap:
    """A map, its rows still in all lengths."""

    rows: list[str]
    wind: tuple[int, ...]
    """A last row of digits; empty where there is none."""
    legend: dict[str, CellKind]
    notes: tuple[str, ...]
    """What was understood otherwise than written, in sentences."""


def parse_map(text: str, known: Mapping[str, str], ending: Container[str]) -> ParsedMap:
    """The rows of a map, in letters that are `known` or explained in lines below it, such as

        m = cost 3            a step there costs 3 more
        T = reward 5, end     and one there gains 5, and is the last

    where a letter in `ending` ends without saying so. Raises LabError, naming the line."""
    lines = text.replace("\ufeff", "").strip("\r\n").splitlines()
    said = [found for found in map(_LEGEND.fullmatch, lines) if found]
    legend = {
        found[1]: _parse_kind(found[0].strip(), found[2], found[1] in ending) for found in said
    }
    rows = _split_rows([line for line in lines if not _LEGEND.fullmatch(line)])
    if legend.get("C", CellKind(0.0, False)).terminal or "#" in legend:
        raise LabError("nobody gets into a wall #, and no fall off the cliff C is an end")
    wind = tuple(map(int, rows.pop())) if rows and rows[-1].isdecimal() else ()
    notes: dict[str, str] = {}
    understood = []
    for number, row in enumerate(rows, 1):
        cells = []
        for cell in row:
            meant = _map_letter(cell, known, legend)
            if not meant:
                raise LabError(
                    f"row {number} of the map has {cell!r}: there are "
                    f"{', '.join(f'{sign} {word}' for sign, word in known.items())}; or say below "
                    f"the map what it costs: {cell} = cost 3, or {cell} = reward 1, end"
                )
            if meant != cell:
                name = "a space" if cell == " " else cell
                word = f" ({KIND_NAMES[meant]})" if meant in KIND_NAMES else ""
                notes[cell] = f"{name} as {meant}{word}"
            cells.append(meant)
        understood.append("".join(cells))
    sentences = (f"Read {', '.join(notes.values())}.",) if notes else ()
    return ParsedMap(understood, wind, legend, sentences)


def _map_letter(cell: str, known: Container[str], legend: Container[str]) -> str:
    for meant in (cell, cell.upper(), TRANSLATIONS.get(cell.upper(), "")):
        if meant and (meant in known or meant in legend):
            return meant
    return ""


def _split_rows(lines: list[str]) -> list[str]:
    if quoted := _quoted_rows("\n".join(lines)):
        return quoted
    rows = [line.strip() for line in lines if line.strip()]
    for separated in (re.compile(r"\S(?:,\s*\S)+,?"), re.compile(r"\S(?:\s+\S)+")):
        if rows and all(map(separated.fullmatch, rows)):
            return [re.sub(r"[,\s]", "", row) for row in rows]
    uneven = set(map(len, rows)) != {max(map(len, rows), default=0)} - {1}
    if uneven and any(" " in line.rstrip() for line in lines):
        # Spaces are cells, and those at the end of a row were left out.
        lines = [line for line in lines if line.strip()]
        return [line.rstrip().ljust(max(len(one.rstrip()) for one in lines)) for line in lines]
    return rows


def _quoted_rows(text: str) -> list[str]:
    """The rows of strings in quotes: each is one, but where each is a cell, those of an inner list,
    [["S", "F"], ["H", "G"]], or of a line without lists, "S","F", are. Empty if there are none."""
    if not _QUOTED.search(text):
        return []
    text = re.sub(r",\s*dtype\s*=.*", "", text)
    if "..." in _QUOTED.sub("", text) and "[" in text:
        raise LabError(
            "the list is cut short by '...': in NumPy, set_printoptions(threshold=2000) prints "
            "all of it"
        )
    parts = text.splitlines()
    if "[" in text:
        parts = re.findall(r"\[([^\[\]]*)\]", text) if re.search(r"\[\s*\[", text) else []
    rows = [row for row in map(_QUOTED.findall, parts) if row]
    if rows and all(len(cell) == 1 for row in rows for cell in row):
        return ["".join(row) for row in rows]
    return _QUOTED.findall(text)


def _parse_kind(line: str, said: str, ends: bool) -> CellKind:
    cost = 0.0
    for word in _split_words(said):
        if word in ("end", "goal", "terminal"):
            ends = True
            continue
        found = _VALUE.fullmatch(word)
        value = math.inf
        with contextlib.suppress(ValueError):
            value = parse_number(found[2]) if found else value
        if not found or abs(value) > MAX_COST:
            raise LabError(
                f"{line!r}: a letter has a cost or a reward of at most {MAX_COST:g}, and may be "
                "an end: m = cost 3, or T = reward 5, end"
            )
        cost = -value if (found[1] or "").lower() == "reward" else value
    return CellKind(cost + 0.0, ends)


def _split_words(said: str) -> Iterator[str]:
    for word in said.split(","):
        if word.strip():
            yield " ".join(word.lower().split())
