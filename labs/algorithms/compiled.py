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
    machine_code = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
    return cast(F, machine_code(function))
