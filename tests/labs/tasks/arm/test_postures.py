"""Postures: inside the joints' ranges, above the floor, and straight where they say so."""

import numpy as np
import pinocchio as pin
import pytest

from labs.errors import LabError
from labs.models.arms import load_arm
from labs.models.plant import plant
from labs.tasks.arm.postures import POSED_ARMS, POSTURES, posture

EVERY = [(robot, name) for robot in POSED_ARMS for name in POSTURES]


@pytest.mark.parametrize(("robot", "name"), EVERY)
def test_it_is_within_reach_and_above_the_floor(robot: str, name: str) -> None:
    q, arm = posture(robot, name), load_arm(robot)
    assert q.shape == (arm.model.nq,)
    if robot != "double-pendulum":
        assert (q >= arm.model.lowerPositionLimit - 1e-3).all()
        assert (q <= arm.model.upperPositionLimit + 1e-3).all()
    world = plant(robot)
    assert world.tip(q)[2] > 0.08
    data = world.model.createData()
    pin.forwardKinematics(world.model, data, q)
    assert all(data.oMi[j].translation[2] > 0.08 for j in range(1, world.model.njoints))


@pytest.mark.parametrize("robot", POSED_ARMS)
def test_straight_arms_have_lost_a_direction(robot: str) -> None:
    """Or almost: the Panda's elbow cannot open all the way."""
    world = plant(robot)
    for name, singular in (("home", False), ("outstretched", True), ("upright", True)):
        sigma = np.linalg.svd(world.tip_jacobian(posture(robot, name)), compute_uv=False)
        smallest = sigma[: world.model.nv][-1]
        if singular:
            assert smallest < (0.08 if robot == "panda" else 1e-9)
        else:
            assert smallest > 0.1


def test_outstretched_means_along_x() -> None:
    for robot in ("ur5", "panda"):
        x, y, _ = plant(robot).tip(posture(robot, "outstretched"))
        assert x > 0.9
        assert y == pytest.approx(0.0, abs=1e-15)


def test_an_unknown_posture_is_refused() -> None:
    with pytest.raises(LabError, match="home, outstretched, upright"):
        posture("ur5", "lotus")
