"""The recording of a run: every step's measurements in bounded memory, and how to write it."""

import csv
import io
import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from labs.lab import Measurement

LIVE_ROWS = 20_000
"""Rows a live recording keeps: 200 s at 100 Hz."""


class Recorder:
    """Rows of [t, channels...]; the oldest make room once `capacity` rows are kept."""

    def __init__(self, first: Measurement, optional: Sequence[str], capacity: int) -> None:
        """`first` fixes the channels and their sizes; `optional` scalars may come later."""
        later = {name: 0.0 for name in optional if name not in first}
        self._layout: dict[str, slice | int] = {}
        self.columns = ["t"]
        for name, value in {**first, **later}.items():
            start = len(self.columns)
            if np.ndim(value) == 0:
                self._layout[name] = start
                self.columns.append(name)
            else:
                size = np.shape(value)[0]
                self._layout[name] = slice(start, start + size)
                self.columns += [f"{name}[{i}]" for i in range(size)]
        self._rows = np.full((min(capacity, 256), len(self.columns)), np.nan)
        self._capacity = capacity
        self.count = 0
        """Rows ever added; the last `kept` of them are kept."""

    @property
    def kept(self) -> int:
        return min(self.count, self._capacity)

    def add(self, t: float, measurement: Measurement) -> None:
        """Appends one row. A scalar that is missing becomes NaN."""
        place = self.count % self._capacity
        if place >= len(self._rows):
            grown = np.full((min(2 * len(self._rows), self._capacity), len(self.columns)), np.nan)
            grown[: len(self._rows)] = self._rows
            self._rows = grown
        self._rows[place] = self.row(t, measurement)
        self.count += 1

    def row(self, t: float, measurement: Measurement) -> np.ndarray:
        """What `add` appends."""
        row = np.full(len(self.columns), np.nan)
        row[0] = t
        for name, value in measurement.items():
            row[self._layout[name]] = value
        return row

    def since(self, count: int) -> np.ndarray:
        """The rows added after the first `count`, oldest first, as far as they are kept."""
        first = max(count, self.count - self.kept)
        index = np.arange(first, self.count) % self._capacity
        return self._rows[index]

    def channels(self) -> dict[str, np.ndarray]:
        """All kept rows by channel: "t" and scalars (k,), vectors (k, n)."""
        rows = self.since(0)
        return {"t": rows[:, 0]} | {name: rows[:, at] for name, at in self._layout.items()}


@dataclass(frozen=True)
class Recording:
    """A finished or running recording with all that is needed to read and reproduce it."""

    about: Mapping[str, Any]
    """Lab, seed, parameters at t = 0, changes since, versions, what the rows cover."""
    columns: Sequence[str]
    rows: np.ndarray
    channels: Mapping[str, np.ndarray]
    solution: Mapping[str, Any] | None = None
    """What was loaded into the solver at t = 0, as its JSON file has it; only `json` holds it."""

    def json(self) -> bytes:
        """{...about, "solution"?, "channels": {name: values}}; a value that is not defined is
        null."""
        import orjson  # on demand: a headless run without output needs no writer

        channels = {name: np.ascontiguousarray(a) for name, a in self.channels.items()}
        loaded = {"solution": self.solution} if self.solution else {}
        document = {**self.about, **loaded, "channels": channels}
        return orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY)

    def csv(self) -> bytes:
        """A header, a line a sample, and nothing else: what reads tables reads it without options.
        The other forms hold `about`, and a file beside it may (`description`)."""
        return csv_table(self.columns, (row.tolist() for row in self.rows))

    def description(self) -> bytes:
        """`about`, for those that have the table alone."""
        return json.dumps(self.about, indent=1).encode()

    def npz(self) -> bytes:
        """An array a channel, and `about` as a JSON string."""
        data = io.BytesIO()
        np.savez_compressed(data, about=np.array(json.dumps(self.about)), **self.channels)  # type: ignore[arg-type]
        return data.getvalue()

    def write(self, form: str) -> bytes:
        """`form` is "json", "csv" or "npz"."""
        return {"json": self.json, "csv": self.csv, "npz": self.npz}[form]()


def csv_table(header: Sequence[str], rows: Iterable[Iterable[Any]]) -> bytes:
    """Numbers with all their digits, and words; nothing where there is neither."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue().encode()


def _cell(value: Any) -> Any:
    plain = value.item() if isinstance(value, np.generic) else value  # a float32 with all it has
    return plain if plain == plain else None


def versions() -> dict[str, str]:
    """What computed a recording: the versions that could change its digits."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for package in ("orclab", "pin", "numpy"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found
