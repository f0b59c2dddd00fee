"""Work that pauses now and then, so that something else can be done in between.

A long computation is written as a generator that yields where it may pause and returns its
result; one calls another by `yield from`."""

from collections.abc import Generator, Iterator
from time import perf_counter
from typing import TypeVar

T = TypeVar("T")

Resumable = Generator[None, None, T]
"""Pauses at every `yield`; its result is what it returns."""
OPERATIONS_BETWEEN_PAUSES = 5e6
"""Operations between two pauses."""


def run_to_completion(work: Resumable[T]) -> T:
    """The result, without a pause."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: T = end.value
            return result


def split_work(many: int, work: float) -> Iterator[int]:
    """How many to do before each pause, of so many equal things of `work` operations each: about
    OPERATIONS_BETWEEN_PAUSES of these, some milliseconds where one takes a nanosecond."""
    share = max(1, int(OPERATIONS_BETWEEN_PAUSES / work))
    for begun in range(0, many, share):
        yield min(share, many - begun)


def timed(work: Resumable[T], seconds: dict[str, float], phase: str) -> Resumable[T]:
    """The same work; adds up in seconds[phase] the wall-clock time it takes [s], without that of
    the pauses."""
    while True:
        begun = perf_counter()
        try:
            next(work)
        except StopIteration as end:
            result: T = end.value
            return result
        finally:
            seconds[phase] += perf_counter() - begun
        yield
