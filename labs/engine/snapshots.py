"""The iterations of a solver that are kept to look back at, in bounded memory."""

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from labs.lab import Snapshot

MAX_BYTES = 64 * 2**20
"""Of arrays, all snapshots together."""
SNAPSHOT_OVERHEAD = 1024
"""[bytes] What a snapshot counts beside its arrays."""


class Snapshots:
    """In the order of their iterations. When they become too large, every second one is dropped;
    the first and the last always stay. What stays depends on nothing but what was added."""

    def __init__(self, most: int = MAX_BYTES) -> None:
        self._most = most
        self._kept: list[Snapshot] = []
        self._sizes: list[int] = []
        self._total = 0

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def iterations(self) -> list[int]:
        """Which are kept, ascending."""
        return [snapshot.iteration for snapshot in self._kept]

    @property
    def first(self) -> Snapshot | None:
        return self._kept[0] if self._kept else None

    @property
    def last(self) -> Snapshot | None:
        return self._kept[-1] if self._kept else None

    def add(self, snapshot: Snapshot) -> None:
        """Keeps one that is later than all before it."""
        self._kept.append(snapshot)
        self._sizes.append(
            SNAPSHOT_OVERHEAD + sum(array.nbytes for _, array in flatten(snapshot.data))
        )
        self._total += self._sizes[-1]
        while len(self._kept) > 2 and self._total > self._most:
            self._thin()

    def at(self, iteration: int) -> Snapshot | None:
        """The kept one nearest to this iteration and not after it; else the first."""
        place = bisect_right(self._kept, iteration, key=lambda snapshot: snapshot.iteration)
        return self._kept[max(place - 1, 0)] if self._kept else None

    def _thin(self) -> None:
        last = len(self._kept) - 1
        stay = [i for i in range(last + 1) if i % 2 == 0 or i == last]
        self._kept = [self._kept[i] for i in stay]
        self._sizes = [self._sizes[i] for i in stay]
        self._total = sum(self._sizes)


def flatten(data: Any, path: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Every number, text and array in plain data, as an array, by where it stands: keys, fields
    and places in lists, joined by dots."""
    if data is None:
        return
    if isinstance(data, Mapping):
        parts = [(str(key), value) for key, value in data.items()]
    elif is_dataclass(data) and not isinstance(data, type):
        parts = [(field.name, getattr(data, field.name)) for field in fields(data)]
    elif isinstance(data, list | tuple):
        parts = [(str(place), value) for place, value in enumerate(data)]
    else:
        yield path, np.asarray(data)
        return
    for name, value in parts:
        yield from flatten(value, f"{path}.{name}" if path else name)
