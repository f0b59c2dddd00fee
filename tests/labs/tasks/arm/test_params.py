"""Knobs of the joints: read in their order, as many as the arm has."""

import numpy as np

from labs.models.arms import load
from labs.params import Choice, Group, Params
from labs.tasks.arm.params import joint_values, offset_knob, robot_choice

JOINTS = Group("Joints")


class ArmParams(Params):
    """Two joints of some arm."""

    robot: str = robot_choice(JOINTS, ("panda", "scara"), effect="restart")
    """The arm."""
    q1: float = offset_knob(JOINTS, 1)
    q2: float = offset_knob(JOINTS, 2)


def test_values_are_read_in_order() -> None:
    params = ArmParams(q1=0.5, q2=-0.25)
    np.testing.assert_array_equal(joint_values(params, "q", 2), [0.5, -0.25])
    np.testing.assert_array_equal(joint_values(params, "q", 1), [0.5])


def test_an_arm_is_chosen_by_its_title() -> None:
    robot = ArmParams.tunables["robot"]
    assert isinstance(robot, Choice)
    assert robot.options == {name: load(name).title for name in ("panda", "scara")}
    assert (ArmParams().robot, robot.effect) == ("panda", "restart")
