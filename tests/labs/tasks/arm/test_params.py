"""Knobs of the joints: read in their order, as many as the arm has."""

import numpy as np

from labs.models.arms import load_arm
from labs.params import Choice, Group, Params
from labs.tasks.arm.params import joint_values, offset_knob, robot_choice
from labs.tasks.arm.postures import POSED_ARMS

JOINTS = Group("Joints")


class ArmParams(Params):
    """Two joints of some arm."""

    robot: str = robot_choice(JOINTS, POSED_ARMS, effect="restart")
    """The arm."""
    q1: float = offset_knob(JOINTS, 1)
    q2: float = offset_knob(JOINTS, 2)
    q7: float = offset_knob(JOINTS, 7)


def test_values_are_read_in_order() -> None:
    params = ArmParams(q1=0.5, q2=-0.25)
    np.testing.assert_array_equal(joint_values(params, "q", 2), [0.5, -0.25])
    np.testing.assert_array_equal(joint_values(params, "q", 1), [0.5])


def test_an_arm_is_chosen_by_its_title() -> None:
    robot = ArmParams.tunables["robot"]
    assert isinstance(robot, Choice)
    assert robot.options == {name: load_arm(name).title for name in POSED_ARMS}
    assert (ArmParams().robot, robot.effect) == ("ur5", "restart")


def test_a_joint_acts_where_the_arm_has_it() -> None:
    acting = [robot for robot in POSED_ARMS if ArmParams(robot=robot).acts("q7")]
    assert acting == ["panda"]
    assert all(ArmParams(robot=robot).acts("q2") for robot in POSED_ARMS)
