"""The table's policy as arrows: to the right by the torque."""

import numpy as np

from labs.tasks.pendulum_table.policy_arrows import torque_arrows
from labs.tasks.pendulum_table.table import PendulumGrid


def test_arrows_point_by_the_torque_and_only_where_something_is_known() -> None:
    grid = PendulumGrid(q_nodes=11, v_nodes=11, levels=5)
    strongest = int(np.argmax(grid.torques[:, 0]))
    weakest = int(np.argmin(grid.torques[:, 0]))
    fast = grid.nodes[:, 1] > 0.0
    policy = np.where(fast, weakest, strongest)
    arrows = torque_arrows(grid, policy, np.full(grid.X, True))
    assert len(arrows) <= 81
    assert set(arrows[:, 0]) <= set(grid.angles)
    np.testing.assert_allclose(arrows[:, 2], np.where(arrows[:, 1] > 0.0, -1.0, 1.0))
    assert not arrows[:, 3].any()
    assert (torque_arrows(grid, policy, fast)[:, 1] > 0.0).all()
