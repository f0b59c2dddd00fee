"""Arcs: one for each torque that shows, in its sense, about its joint's axis, red at the limit."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

from labs.models.plant import plant
from labs.scene import Color, NullScene
from labs.tasks.arm.torque_arcs import FULL_ARC, LONGEST_ARC, draw_torque_arcs


class Arcs(NullScene):
    """Remembers angle, axis and colour of every arc."""

    def __init__(self) -> None:
        super().__init__()
        self.arcs: dict[str, tuple[float, np.ndarray, Color]] = {}

    def arc(
        self,
        name: str,
        center: ArrayLike,
        axis: ArrayLike,
        angle: float,
        radius: float,
        color: Color = "force",
    ) -> None:
        self.arcs[name] = (angle, np.asarray(axis, float), color)


def test_an_arc_is_as_long_as_the_share_of_the_limit() -> None:
    world, scene = plant("double-pendulum"), Arcs()
    draw_torque_arcs(scene, world, np.array([0.3, 0.2]), np.array([-25.0, 10.0]))
    assert scene.arcs["torque 1"][0] == pytest.approx(-0.25 * FULL_ARC)
    assert scene.arcs["torque 2"][0] == pytest.approx(0.2 * FULL_ARC)
    for _, axis, color in scene.arcs.values():
        np.testing.assert_allclose(axis, [1.0, 0.0, 0.0], atol=1e-15)
        assert color == "force"


def test_beyond_the_limit_it_is_red_and_grows_no_further() -> None:
    world, scene = plant("double-pendulum"), Arcs()
    draw_torque_arcs(scene, world, np.zeros(2), np.array([0.0, -500.0]))
    assert set(scene.arcs) == {"torque 2"}, "no torque, no arc"
    angle, _, color = scene.arcs["torque 2"]
    assert (angle, color) == (-LONGEST_ARC, "warning")
