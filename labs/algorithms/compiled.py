"""Hot loops, compiled by Numba on their first call and kept beside their source for the next.

A lab calls what it needs once in `Lab.prepare`, before anybody waits for it."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """The function as machine code. Products may be fused with sums; sums keep their order and
    nothing is assumed of NaN and infinity, so that results are reproducible and trouble is seen.
    It runs without holding Python's lock."""
    return _compiled(function, inline=False)


def copied(function: F) -> F:
    """The same, copied into each compiled function that calls it instead of called: for what is
    asked for at every turn of a hot loop."""
    return _compiled(function, inline=True)


def _compiled(function: F, inline: bool) -> F:
    machine_code = numba.njit(
        cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, forceinline=inline
    )
    return cast(F, machine_code(function))
