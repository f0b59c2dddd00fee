"""Labels stand beside what they name, and beside each other."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from server.labels import (
    ANCHORS,
    CLEARANCE,
    DEFAULT_ANCHOR,
    LINE_HEIGHT,
    Label,
    LabelNode,
    choose_anchors,
)

NO_POINTS = np.empty((0, 2))


def test_a_label_alone_stands_above_its_point() -> None:
    assert choose_anchors([Label("frame 3", np.zeros(2))], NO_POINTS) == [DEFAULT_ANCHOR]


def test_two_at_one_point_stand_on_different_sides() -> None:
    one, other = choose_anchors([Label("1", np.zeros(2)), Label("2", np.zeros(2))], NO_POINTS)
    assert (one, other) == (DEFAULT_ANCHOR, "top-center")


def a_bar_above(height: float) -> np.ndarray:
    """Points of a robot (40, 2), so far above the point of a label."""
    return np.column_stack([np.linspace(-20.0, 20.0, 40), np.full(40, height)])


def test_a_label_keeps_off_the_robot_and_stays_where_it_went_until_it_may_return() -> None:
    (moved,) = choose_anchors([Label("frame 3", np.zeros(2))], a_bar_above(9.0))
    assert moved != DEFAULT_ANCHOR
    there = Label("frame 3", np.zeros(2), moved)
    just_off = a_bar_above(LINE_HEIGHT + 0.5 * CLEARANCE)
    assert choose_anchors([Label("frame 3", np.zeros(2))], just_off) == [DEFAULT_ANCHOR]
    assert choose_anchors([there], just_off) == [moved], "it would flicker"
    assert choose_anchors([there], a_bar_above(LINE_HEIGHT + 2.0 * CLEARANCE)) == [DEFAULT_ANCHOR]


@pytest.mark.parametrize("pushed", list(ANCHORS))
def test_a_label_pushed_aside_returns_when_nothing_is_there(pushed: str) -> None:
    assert choose_anchors([Label("D", np.zeros(2), pushed)], NO_POINTS) == [DEFAULT_ANCHOR]


def test_a_label_pushed_aside_by_another_returns_when_that_is_gone() -> None:
    one, other = Label("1", np.zeros(2)), Label("2", np.zeros(2))
    (_, pushed) = choose_anchors([one, other], NO_POINTS)
    assert choose_anchors([one, Label("2", np.zeros(2), pushed)], NO_POINTS) == [
        DEFAULT_ANCHOR,
        pushed,
    ]
    far = Label("1", np.array([200.0, 0.0]))
    assert choose_anchors([far, Label("2", np.zeros(2), pushed)], NO_POINTS) == [
        DEFAULT_ANCHOR,
        DEFAULT_ANCHOR,
    ]


def test_a_number_in_a_label_has_the_sign_of_mathematics() -> None:
    handle = SimpleNamespace()
    server: Any = SimpleNamespace(scene=SimpleNamespace(add_label=lambda *_, **__: handle))
    LabelNode(server, "label", "").set_text("v = -8 rad/s", np.zeros(3))
    assert handle.text == "v = \u22128 rad/s"
