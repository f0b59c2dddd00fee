"""Whoever looks, colours that mean different things look different, on light and on dark."""

import re
from pathlib import Path

import numpy as np
import pytest

from labs.appendix.integration.picture import COLORS as PENDULUMS
from labs.tasks.pendulum_table.picture import ROD_COLORS
from server.nodes import COLORS as SCENE
from server.nodes import DARK, LIGHT
from tests.color_vision import color_distances, contrast_ratio

STYLES = Path(__file__).parents[2] / "static" / "css"
Color = tuple[float, ...]


def themed(sheet: str, name: str) -> tuple[Color, Color]:
    """A colour of a style sheet, on light and on dark."""
    css = (STYLES / sheet).read_text(encoding="utf-8")
    found = re.search(rf"--{name}: light-dark\(#(\w{{6}}), #(\w{{6}})\)", css)
    assert found, name
    light, dark = (
        tuple(int(code[i : i + 2], 16) / 255 for i in (0, 2, 4)) for code in found.groups()
    )
    return light, dark


def of_scene(color: tuple[int, ...]) -> Color:
    return tuple(part / 255 for part in color)


@pytest.mark.parametrize("theme", [0, 1], ids=["light", "dark"])
def test_the_series_of_the_plots(theme: int) -> None:
    series = {f"series {k}": themed("plots.css", f"series-{k}")[theme] for k in range(1, 9)}
    nearest = min(color_distances(series))
    assert nearest[0] > 8.0, nearest
    surface = themed("base.css", "surface")[theme]
    assert min(contrast_ratio(color, surface) for color in series.values()) > 3.0


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize(
    "colors",
    [
        {name: of_scene(color) for name, color in SCENE.items()},
        {f"pendulum {k}": color for k, color in enumerate(PENDULUMS, 1)},
        {"first rod": ROD_COLORS[0], "second rod": ROD_COLORS[1]},
    ],
    ids=["scene", "eight pendulums", "two pendulums"],
)
def test_what_stands_together_in_a_scene(
    colors: dict[str, Color], theme: tuple[int, int, int]
) -> None:
    nearest = min(color_distances(colors))
    assert nearest[0] > 7.0, nearest
    assert min(contrast_ratio(color, of_scene(theme)) for color in colors.values()) > 1.9


def test_it_finds_two_colours_that_are_one_to_somebody() -> None:
    """Those that the second and the fifth pendulum had."""
    two = {"orange": np.array([0xCF, 0x53, 0]) / 255, "ochre": np.array([0xA5, 0x7C, 0]) / 255}
    nearest, of = min(color_distances({name: tuple(color) for name, color in two.items()}))
    assert nearest < 2.0
    assert of == "orange and ochre, deuteranopia"
