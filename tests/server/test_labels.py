"""Labels stand beside what they name, and beside each other."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from server.labels import ABOVE, ANCHORS, LINE, ROOM, Label, LabelNode, arrange

NOTHING = np.empty((0, 2))


def test_a_label_alone_stands_above_its_point() -> None:
    assert arrange([Label("frame 3", np.zeros(2))], NOTHING) == [ABOVE]


def test_two_at_one_point_stand_on_different_sides() -> None:
    one, other = arrange([Label("1", np.zeros(2)), Label("2", np.zeros(2))], NOTHING)
    assert (one, other) == (ABOVE, "top-center")


def a_bar_above(height: float) -> np.ndarray:
    """Points of a robot (40, 2), so far above the point of a label."""
    return np.column_stack([np.linspace(-20.0, 20.0, 40), np.full(40, height)])


def test_a_label_keeps_off_the_robot_and_stays_where_it_went_until_it_may_return() -> None:
    (moved,) = arrange([Label("frame 3", np.zeros(2))], a_bar_above(9.0))
    assert moved != ABOVE
    there = Label("frame 3", np.zeros(2), moved)
    just_off = a_bar_above(LINE + 0.5 * ROOM)
    assert arrange([Label("frame 3", np.zeros(2))], just_off) == [ABOVE]
    assert arrange([there], just_off) == [moved], "it would flicker"
    assert arrange([there], a_bar_above(LINE + 2.0 * ROOM)) == [ABOVE]


@pytest.mark.parametrize("pushed", list(ANCHORS))
def test_a_label_pushed_aside_returns_when_nothing_is_there(pushed: str) -> None:
    assert arrange([Label("D", np.zeros(2), pushed)], NOTHING) == [ABOVE]


def test_a_label_pushed_aside_by_another_returns_when_that_is_gone() -> None:
    one, other = Label("1", np.zeros(2)), Label("2", np.zeros(2))
    (_, pushed) = arrange([one, other], NOTHING)
    assert arrange([one, Label("2", np.zeros(2), pushed)], NOTHING) == [ABOVE, pushed]
    far = Label("1", np.array([200.0, 0.0]))
    assert arrange([far, Label("2", np.zeros(2), pushed)], NOTHING) == [ABOVE, ABOVE]


def test_a_number_in_a_label_has_the_sign_of_mathematics() -> None:
    handle = SimpleNamespace()
    server: Any = SimpleNamespace(scene=SimpleNamespace(add_label=lambda *_, **__: handle))
    LabelNode(server, "label", "").write("v = -8 rad/s", np.zeros(3))
    assert handle.text == "v = \u22128 rad/s"
