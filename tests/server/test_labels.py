"""Labels stand beside what they name, and beside each other."""

import numpy as np

from server.labels import ABOVE, Label, arrange

NOTHING = np.empty((0, 2))


def test_a_label_alone_stands_above_its_point() -> None:
    assert arrange([Label("frame 3", np.zeros(2))], NOTHING) == [ABOVE]


def test_two_at_one_point_stand_on_different_sides() -> None:
    one, other = arrange([Label("1", np.zeros(2)), Label("2", np.zeros(2))], NOTHING)
    assert (one, other) == (ABOVE, "top-center")


def test_a_label_keeps_off_the_robot_and_stays_where_it_went() -> None:
    above = np.column_stack([np.linspace(-20.0, 20.0, 40), np.full(40, 9.0)])
    (moved,) = arrange([Label("frame 3", np.zeros(2))], above)
    assert moved != ABOVE
    assert arrange([Label("frame 3", np.zeros(2), moved)], NOTHING) == [moved]
