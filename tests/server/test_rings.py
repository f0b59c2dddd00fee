"""Rings at joints near their limit: about a joint's axis, whether it turns or slides."""

from unittest.mock import MagicMock

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from labs.models.arms import load_arm
from server.messages import View
from server.nodes import ArmNode


@pytest.mark.parametrize(
    ("robot", "axes"),
    [("ur5", "zyyyzy"), ("double-pendulum", "xx"), ("scara", "zzzz")],
)
def test_a_ring_stands_across_its_joints_axis(robot: str, axes: str) -> None:
    server = MagicMock()
    arm = load_arm(robot)
    node = ArmNode(server, "robot", arm, False, View(graphics="low"))
    node.mark_torque_limits(np.ones(arm.model.nv))
    calls = server.scene.add_mesh_simple.call_args_list
    rings = [call for call in calls if call.args[0].endswith("/ring")]
    assert len(rings) == len(axes)
    for call, axis in zip(rings, axes, strict=True):
        w, x, y, z = call.kwargs["wxyz"]
        turned = Rotation.from_quat([x, y, z, w]).apply([0.0, 0.0, 1.0])
        np.testing.assert_allclose(turned, np.eye(3)["xyz".index(axis)], atol=1e-12)
