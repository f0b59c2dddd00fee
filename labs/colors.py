"""Colours for values: a sequential map whose steps look equally large.

A few anchor colours are joined by straight lines in OKLab, where distance is close to what an
eye sees, and the map runs along them at constant speed: equal steps of the value are equal steps
of colour. Lightness rises all the way, so that it reads in grey as well.

OKLab: B. Ottosson, "A perceptual color space for image processing", 2020."""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

COLORMAP_ANCHORS = (
    (0.17, 0.14, 0.35),
    (0.24, 0.33, 0.62),
    (0.16, 0.55, 0.63),
    (0.42, 0.74, 0.51),
    (0.95, 0.91, 0.45),
)
"""sRGB, from the least value (dark indigo) over blue, teal and green to the largest (pale
yellow)."""
LINEAR_RGB_TO_LMS = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
LMS_TO_OKLAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
NO_VALUE = (0.62, 0.63, 0.65)
"""sRGB, grey: of what has no value."""
COLORMAP_SIZE = 256
CONSTANT_FIELD_POSITION = 0.5
"""Where a field of one value stands."""


def sequential(
    values: ArrayLike, low: float | None = None, high: float | None = None
) -> np.ndarray:
    """Colours (..., 3), sRGB in [0, 1], of finite values (...): from `low` to `high` (by default
    the least and the largest of them), what lies beyond in the colours of the ends. Where low
    and high agree, all is of the middle colour."""
    values = np.asarray(values, float)
    if values.size == 0:
        return np.empty((*values.shape, 3))
    low = float(values.min()) if low is None else low
    high = float(values.max()) if high is None else high
    # Halved, so that the span of finite values is finite too.
    span = 0.5 * high - 0.5 * low
    if span > 0.0:
        places = np.clip((0.5 * values - 0.5 * low) / span, 0.0, 1.0)
    else:
        places = np.full(values.shape, CONSTANT_FIELD_POSITION)
    return np.asarray(_colormap()[np.round(places * (COLORMAP_SIZE - 1)).astype(int)])


def to_oklab(srgb: np.ndarray) -> np.ndarray:
    """Lightness and two opponent colours (..., 3) of sRGB colours (..., 3) in [0, 1]."""
    return np.asarray(np.cbrt(to_linear(srgb) @ LINEAR_RGB_TO_LMS.T) @ LMS_TO_OKLAB.T)


def from_oklab(lab: np.ndarray) -> np.ndarray:
    """sRGB colours (..., 3) of OKLab (..., 3); what no screen shows is cut off to [0, 1]."""
    cones = (lab @ np.linalg.inv(LMS_TO_OKLAB).T) ** 3
    return from_linear(np.clip(cones @ np.linalg.inv(LINEAR_RGB_TO_LMS).T, 0.0, 1.0))


def to_linear(srgb: np.ndarray) -> np.ndarray:
    """Intensities (...) of light of sRGB channels (...) in [0, 1]."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def from_linear(linear: np.ndarray) -> np.ndarray:
    """sRGB channels (...) of intensities (...) in [0, 1]."""
    curved = 1.055 * linear ** (1.0 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, curved)


@cache
def _colormap() -> np.ndarray:
    """The map at COLORMAP_SIZE places, equally far apart along the way."""
    anchors = to_oklab(np.array(COLORMAP_ANCHORS))
    reached = np.cumsum([0.0, *np.linalg.norm(np.diff(anchors, axis=0), axis=1)])
    places = np.linspace(0.0, reached[-1], COLORMAP_SIZE)
    table = from_oklab(np.stack([np.interp(places, reached, axis) for axis in anchors.T], axis=-1))
    table.flags.writeable = False
    return table
