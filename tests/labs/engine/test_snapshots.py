"""What is kept of a solver's iterations (labs/engine/snapshots.py)."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labs.engine.snapshots import SNAPSHOT_OVERHEAD, Snapshots, flatten
from labs.lab import Snapshot


def filled(count: int, most: int, size: int = 100) -> Snapshots:
    kept = Snapshots(most)
    for k in range(1, count + 1):
        kept.add(Snapshot(k, {"x": np.zeros(size)}))
    return kept


def test_all_are_kept_while_there_is_room() -> None:
    assert filled(50, 10**6).iterations == list(range(1, 51))


def test_every_second_one_goes_when_it_is_full() -> None:
    each = SNAPSHOT_OVERHEAD + 800
    assert filled(8, 8 * each).iterations == [1, 2, 3, 4, 5, 6, 7, 8]
    assert filled(9, 8 * each).iterations == [1, 3, 5, 7, 9]
    assert filled(10, 8 * each).iterations == [1, 3, 5, 7, 9, 10]


@given(st.integers(1, 300), st.integers(1, 40))
def test_the_bound_holds_and_both_ends_stay(count: int, room: int) -> None:
    each = SNAPSHOT_OVERHEAD + 800
    kept = filled(count, room * each)
    iterations = kept.iterations
    assert len(kept) <= max(room, 2)
    assert iterations == sorted(set(iterations))
    assert (iterations[0], iterations[-1]) == (1, count)
    assert filled(count, room * each).iterations == iterations, "the same again"


def test_one_too_large_for_the_room_is_kept_all_the_same() -> None:
    assert filled(5, 10).iterations == [1, 5]


def test_the_nearest_one_not_after_is_found() -> None:
    kept = filled(9, 8 * (SNAPSHOT_OVERHEAD + 800))  # 1, 3, 5, 7, 9
    found = [kept.at(k) for k in (0, 1, 2, 6, 9, 100)]
    assert [one.iteration for one in found if one] == [1, 1, 1, 5, 9, 9]
    assert Snapshots().at(3) is None
    assert Snapshots().first is Snapshots().last is None


@dataclass
class Pair:
    a: float
    b: list[np.ndarray]


def test_leaves_are_named_by_the_way_to_them() -> None:
    data = {
        "x": np.ones(2),
        "pair": Pair(1.5, [np.zeros(3), np.zeros(1)]),
        "no": None,
        "n": {"k": "t"},
    }
    found = dict(flatten(data))
    assert list(found) == ["x", "pair.a", "pair.b.0", "pair.b.1", "n.k"]
    assert found["pair.a"] == 1.5
    assert found["n.k"] == "t"
    assert found["pair.b.0"] == pytest.approx(np.zeros(3))
