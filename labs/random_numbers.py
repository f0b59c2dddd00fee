"""A generator of random numbers for compiled loops: xoshiro256++ of Blackman and Vigna (2021).

Its whole state is an array (4,) uint64 that the draws below advance in place; kept in a snapshot,
it lets a loop go on from there bit for bit, wherever it was interrupted."""

import numpy as np

from labs.compiled import compiled

_SCALE = 2.0**-53


def seeded(rng: np.random.Generator, many: int) -> np.ndarray:
    """(many, 4) uint64: independent states drawn from `rng`."""
    return rng.integers(1, 2**64, size=(many, 4), dtype=np.uint64)


@compiled
def _rotated(x: np.uint64, k: int) -> np.uint64:
    return np.uint64((x << np.uint64(k)) | (x >> np.uint64(64 - k)))


@compiled
def bits(state: np.ndarray) -> np.uint64:
    """64 random bits."""
    drawn = np.uint64(_rotated(state[0] + state[3], 23) + state[0])
    shifted = state[1] << np.uint64(17)
    state[2] ^= state[0]
    state[3] ^= state[1]
    state[1] ^= state[2]
    state[0] ^= state[3]
    state[2] ^= shifted
    state[3] = _rotated(state[3], 45)
    return drawn


@compiled
def uniform(state: np.ndarray) -> float:
    """A float in [0, 1), one of 2^53 equally likely."""
    return float(bits(state) >> np.uint64(11)) * _SCALE


@compiled
def below(state: np.ndarray, n: int) -> int:
    """An integer in 0..n-1. For the few hundred it is asked for, none is favoured by more than
    n / 2^53."""
    return int(uniform(state) * n)
