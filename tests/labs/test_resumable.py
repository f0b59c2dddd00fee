"""Work in pieces: its result, its pauses and its time."""

import time

import pytest

from labs.resumable import Resumable, run_to_completion, timed


def count(pauses: int, seconds: float = 0.0) -> Resumable[int]:
    """Works `seconds` before each pause and once after the last."""
    for _ in range(pauses):
        time.sleep(seconds)
        yield
    time.sleep(seconds)
    return pauses


def test_the_result_comes_without_a_pause() -> None:
    assert run_to_completion(count(0)) == 0
    assert run_to_completion(count(5)) == 5


def test_pauses_are_passed_on_and_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr("labs.resumable.perf_counter", lambda: clock[0])
    monkeypatch.setattr(time, "sleep", lambda s: clock.__setitem__(0, clock[0] + s))
    seconds = {"work": 1.0, "other": 2.0}
    results = []

    def caller() -> Resumable[None]:
        results.append((yield from timed(count(3, 0.5), seconds, "work")))

    pauses = 0
    for _ in caller():
        pauses += 1
        clock[0] += 100.0
    assert results == [3]
    assert pauses == 3
    assert seconds == {"work": 3.0, "other": 2.0}


def test_what_goes_wrong_is_not_swallowed() -> None:
    def broken() -> Resumable[int]:
        yield
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run_to_completion(timed(broken(), {"work": 0.0}, "work"))
