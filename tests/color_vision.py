"""How far apart colours look to people with any colour vision.

Dichromats: G. M. Machado, M. M. Oliveira and L. A. F. Fernandes, "A physiologically-based model
for simulation of color vision deficiency", 2009, at severity 1, on linear sRGB. Distance: OKLab's,
times 100; 2 is about what one just sees side by side."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from labs.colors import from_linear, to_linear, to_oklab

VISIONS: Mapping[str, np.ndarray] = {
    "usual": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "tritanopia": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}


def simulate_vision(srgb: np.ndarray, vision: str) -> np.ndarray:
    """sRGB colours (..., 3) as they look to this vision."""
    return from_linear(np.clip(to_linear(srgb) @ VISIONS[vision].T, 0.0, 1.0))


def color_distances(colors: Mapping[str, Sequence[float]]) -> Iterator[tuple[float, str]]:
    """Of every two named sRGB colours under every vision, with what it is of."""
    for vision in VISIONS:
        places = {
            n: 100 * to_oklab(simulate_vision(np.array(c), vision)) for n, c in colors.items()
        }
        for a, b in combinations(places, 2):
            yield float(np.linalg.norm(places[a] - places[b])), f"{a} and {b}, {vision}"


def contrast_ratio(a: Sequence[float], b: Sequence[float]) -> float:
    """The ratio of luminances of WCAG 2, from 1 to 21."""
    low, high = sorted(float(to_linear(np.array(c)) @ [0.2126, 0.7152, 0.0722]) for c in (a, b))
    return (high + 0.05) / (low + 0.05)
