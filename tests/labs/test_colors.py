"""The colours of values: even steps for the eye, and finite whatever comes."""

import re
from pathlib import Path

import numpy as np
import pytest

from labs.colors import COLORMAP_SIZE, from_oklab, sequential, to_oklab


def test_oklab_knows_its_reference_colours() -> None:
    """The values its author publishes for sRGB's primaries."""
    primaries = np.array([[1, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]], float)
    expected = [
        [1.0, 0.0, 0.0],
        [0.6280, 0.2249, 0.1258],
        [0.8664, -0.2339, 0.1795],
        [0.4520, -0.0325, -0.3115],
        [0.0, 0.0, 0.0],
    ]
    np.testing.assert_allclose(to_oklab(primaries), expected, atol=1e-4)


def test_oklab_and_back_is_the_same_colour() -> None:
    colors = np.random.default_rng(0).uniform(0.0, 1.0, (200, 3))
    np.testing.assert_allclose(from_oklab(to_oklab(colors)), colors, atol=1e-7)


def test_equal_steps_of_the_value_are_equal_steps_of_colour() -> None:
    ramp = to_oklab(sequential(np.linspace(-3.0, 5.0, COLORMAP_SIZE)))
    steps = np.linalg.norm(np.diff(ramp, axis=0), axis=1)
    assert steps.max() < 1.06 * steps.min(), "a bend may cut a corner, no more"
    lightness = np.diff(ramp[:, 0])
    assert (lightness > 0.7 * lightness.max()).all(), "it reads in grey"
    assert ramp[-1, 0] - ramp[0, 0] > 0.6


def test_shapes_and_limits() -> None:
    field = np.arange(12.0).reshape(3, 4)
    colors = sequential(field)
    assert colors.shape == (3, 4, 3)
    assert (colors >= 0.0).all()
    assert (colors <= 1.0).all()
    assert sequential(2.0).shape == (3,)
    assert sequential(np.empty((0, 5))).shape == (0, 5, 3)
    beyond = sequential([-9.0, 0.0, 1.0, 9.0], 0.0, 1.0)
    np.testing.assert_array_equal(beyond[0], beyond[1])
    np.testing.assert_array_equal(beyond[3], beyond[2])


@pytest.mark.parametrize("value", [0.0, -7.0, 1e308])
def test_a_field_of_one_value_is_of_the_middle_colour(value: float) -> None:
    middle = sequential(0.5, 0.0, 1.0)
    np.testing.assert_array_equal(sequential(np.full(5, value)), np.tile(middle, (5, 1)))


def test_finite_values_give_finite_colours() -> None:
    assert np.isfinite(sequential([-1.7e308, 0.0, 1.7e308])).all()
    tiny = sequential([0.0, 5e-324])
    assert np.isfinite(tiny).all()


def test_heat_maps_on_the_page_wear_the_same_colours() -> None:
    script = Path(__file__).parents[2] / "static" / "js" / "plots" / "heatmap.js"
    (line,) = re.findall(r"const SEQUENTIAL = (.*)", script.read_text(encoding="utf-8"))
    tones = re.findall(r'"#([0-9a-f]{6})"', line)
    assert len(tones) == 9
    colors = np.round(255 * sequential(np.linspace(0.0, 1.0, len(tones)))).astype(int)
    assert tones == ["{:02x}{:02x}{:02x}".format(*color) for color in colors.tolist()]


def test_the_colours_cannot_be_spoilt() -> None:
    sequential([0.0, 1.0])[:] = 0.0
    assert sequential([0.0, 1.0]).any()
