"""A generator of random numbers for compiled loops: xoshiro256++ of Blackman and Vigna (2021).

Its whole state is an array (4,) uint64 that the draws below advance in place; kept in a snapshot,
it lets a loop go on from there bit for bit, wherever it was interrupted."""

import numpy as np

from labs.compiled import compiled, inlined

_SCALE = 2.0**-53
_LAYERS = 256
_TAIL = 3.6541528853610088
"""Where the normal density's tail is cut off: 256 pieces of one area are left of it."""
_AREA = 0.00492867323399
"""Of each of them, the tail included."""


def _layers() -> np.ndarray:
    """(257,) right ends of the layers of the normal density, from the widest to 0."""
    ends = np.zeros(_LAYERS + 1)
    ends[:2] = _AREA * np.exp(0.5 * _TAIL**2), _TAIL
    for i in range(2, _LAYERS):
        height = _AREA / ends[i - 1] + np.exp(-0.5 * ends[i - 1] ** 2)
        ends[i] = np.sqrt(-2.0 * np.log(height))
    return ends


_ENDS = _layers()


def random_states(rng: np.random.Generator, many: int) -> np.ndarray:
    """(many, 4) uint64: independent states drawn from `rng`."""
    return rng.integers(1, 2**64, size=(many, 4), dtype=np.uint64)


@compiled
def _rotate_left(x: np.uint64, k: int) -> np.uint64:
    return np.uint64((x << np.uint64(k)) | (x >> np.uint64(64 - k)))


@compiled
def random_bits(state: np.ndarray) -> np.uint64:
    """64 random bits."""
    drawn = np.uint64(_rotate_left(state[0] + state[3], 23) + state[0])
    shifted = state[1] << np.uint64(17)
    state[2] ^= state[0]
    state[3] ^= state[1]
    state[1] ^= state[2]
    state[0] ^= state[3]
    state[2] ^= shifted
    state[3] = _rotate_left(state[3], 45)
    return drawn


@compiled
def uniform(state: np.ndarray) -> float:
    """A float in [0, 1), one of 2^53 equally likely."""
    return float(random_bits(state) >> np.uint64(11)) * _SCALE


@compiled
def random_integer(state: np.ndarray, n: int) -> int:
    """An integer in 0..n-1. For the few hundred it is asked for, none is favoured by more than
    n / 2^53."""
    return int(uniform(state) * n)


@inlined
def normal(state: np.ndarray) -> float:
    """A float of the standard normal distribution: the ziggurat of Marsaglia and Tsang (2000) as
    Doornik (2005) has it, a layer and a place in it from separate bits."""
    drawn = random_bits(state)
    layer = int(drawn & np.uint64(_LAYERS - 1))
    x = (2.0 * (float(drawn >> np.uint64(11)) * _SCALE) - 1.0) * _ENDS[layer]
    # Nearly always it is in the part of the layer that lies wholly under the density.
    return float(x) if abs(x) < _ENDS[layer + 1] else _sample_layer_edge(state, layer, x)


@compiled
def _sample_layer_edge(state: np.ndarray, layer: int, x: float) -> float:
    while abs(x) >= _ENDS[layer + 1]:
        if layer == 0:
            return float(np.copysign(_sample_tail(state), x))
        outer = np.exp(-0.5 * (_ENDS[layer] ** 2 - x * x))
        inner = np.exp(-0.5 * (_ENDS[layer + 1] ** 2 - x * x))
        if outer + uniform(state) * (inner - outer) < 1.0:
            break
        drawn = random_bits(state)
        layer = int(drawn & np.uint64(_LAYERS - 1))
        x = (2.0 * (float(drawn >> np.uint64(11)) * _SCALE) - 1.0) * _ENDS[layer]
    return float(x)


@compiled
def _sample_tail(state: np.ndarray) -> float:
    """Of the normal distribution beyond _TAIL."""
    while True:
        x = -np.log(1.0 - uniform(state)) / _TAIL
        if -2.0 * np.log(1.0 - uniform(state)) > x * x:
            return float(_TAIL + x)
