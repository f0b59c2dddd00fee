"""A grid world's policy as arrows on a map."""

import numpy as np

from labs.tasks.grid_world.map import grid_world
from labs.tasks.grid_world.policy_arrows import policy_arrows


def test_an_arrow_a_cell_or_one_for_each_control_of_a_random_policy() -> None:
    world = grid_world("S.\n#G", False)
    everywhere = np.full(len(world.cells), True)
    right, down = 1, 2
    arrows = policy_arrows(world, np.array([right, down, down]), everywhere)
    np.testing.assert_allclose(arrows, [[1, 2, 1, 0], [2, 2, 0, -1]])
    even = np.full((len(world.cells), 4), 0.25)
    assert len(policy_arrows(world, even, everywhere)) == 8
    assert len(policy_arrows(world, even, ~everywhere)) == 0
