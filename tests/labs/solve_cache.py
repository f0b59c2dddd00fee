"""Runs of solvers that the tests of a lab share: what one has solved is there for the next.

A solver is a function of the parameters and of the state it starts from; that it is, the tests of
the contract find by solving `anew`."""

import copy
import functools
import itertools
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from labs.lab import Lab, Snapshot, State
from labs.params import Params
from tests.labs.contract import comparable

Solve = Callable[[Any, Any], Iterator[Snapshot | None]]
MAX_CACHED = 300
"""Runs that are kept, of one lab; those asked for least recently are forgotten."""

_runs: OrderedDict[Any, Iterator[Snapshot | None]] = OrderedDict()
_sharing = ContextVar("sharing", default=True)


def share_solves(kind: type[Lab[Any, Any]]) -> None:
    """From now on, labs of this kind solve nothing twice that is still kept."""
    solve = kind.solve

    @functools.wraps(solve)
    def shared(lab: Lab[Any, Any], params: Params, state: State) -> Iterator[Snapshot | None]:
        return _solve(kind, functools.partial(solve, lab), params, state)

    setattr(kind, "solve", shared)  # noqa: B010 - a method, for mypy


@contextmanager
def sharing_disabled() -> Iterator[None]:
    """Within, whatever begins to be solved is solved indeed."""
    token = _sharing.set(False)
    try:
        yield
    finally:
        _sharing.reset(token)


def _solve(
    kind: type[Lab[Any, Any]], solve: Solve, params: Params, state: State
) -> Iterator[Snapshot | None]:
    if not _sharing.get():
        return solve(params, state)
    if any(other is not kind for other, *_ in _runs):
        _runs.clear()
    key = (kind, params, comparable(state))
    if key not in _runs:
        (_runs[key],) = itertools.tee(solve(params, state), 1)
    _runs.move_to_end(key)
    if len(_runs) > MAX_CACHED:
        _runs.popitem(last=False)
    return copy.copy(_runs[key])  # from its beginning, solved as far as anybody ever asked
