"""Pendulums move by their equation of motion, under torques that are looked up."""

import numpy as np

from labs.tasks.pendulum_table.swing import (
    PATH_LENGTH,
    Swing,
    advance_swing,
    advance_unpowered,
    change_velocity,
    look_up_torques,
    start_swing,
)
from labs.tasks.pendulum_table.table import PendulumGrid, integrate_pendulum

GRID = PendulumGrid(q_nodes=21, v_nodes=21, levels=3)
MDP = GRID.mdp(0.9)
PERIOD = 0.01


def swing_for(policies: np.ndarray, swing: Swing, periods: int) -> Swing:
    """So many periods later."""
    for _ in range(periods):
        if swing.clock == 0:
            swing = look_up_torques(GRID, MDP, policies, swing)
        swing = advance_swing(GRID, swing, PERIOD)
    return swing


def test_a_torque_is_held_for_a_time_step_of_the_equation_of_motion() -> None:
    full = np.full((1, GRID.X), 2)
    swing = swing_for(full, start_swing(), 10)
    assert (swing.steps, swing.clock, swing.torque[0]) == (1, 0, GRID.torque)
    q = v = np.zeros(1)
    for _ in range(10):
        q, v = integrate_pendulum(q, v, np.array([GRID.torque]), GRID.friction, PERIOD)
    np.testing.assert_allclose(swing.at[0], [*q, *v], rtol=1e-12)
    assert swing.path.shape == (11, 1, 2)


def test_costs_are_those_of_the_nodes_that_were_looked_up() -> None:
    policies = np.full((1, GRID.X), 2)
    swing, total = start_swing(), 0.0
    for k in range(5):
        x = int(GRID.state(swing.at[0, :1], swing.at[0, 1:]))
        total += 0.9**k * MDP.C[x, 2]
        swing = swing_for(policies, swing, 10)
    np.testing.assert_allclose(swing.cost[0], total, rtol=1e-12)


def test_under_way_it_knows_the_node_the_table_promises() -> None:
    policies = np.full((1, GRID.X), 2)
    swing = swing_for(policies, start_swing(), 3)
    x = int(GRID.state(np.zeros(1), np.zeros(1)))
    np.testing.assert_array_equal(swing.to[0], GRID.nodes[GRID.successor[x, 2]])
    there = swing_for(policies, swing, 7)
    np.testing.assert_array_equal(there.to, there.at)
    pushed = change_velocity(swing, 4.0)
    np.testing.assert_allclose(pushed.at[0] - swing.at[0], [0.0, 4.0])
    np.testing.assert_array_equal(pushed.to, pushed.at)


def test_pendulums_side_by_side_are_those_alone() -> None:
    policies = np.stack([np.full(GRID.X, u) for u in (0, 2)])
    both = swing_for(policies, start_swing(2), 35)
    for m in range(2):
        alone = swing_for(policies[m : m + 1], start_swing(), 35)
        np.testing.assert_allclose(both.at[m], alone.at[0], rtol=1e-12)
        assert both.cost[m] == alone.cost[0]


def test_a_coasting_pendulum_has_no_torque_and_is_due_for_a_decision() -> None:
    swing = advance_unpowered(GRID, swing_for(np.full((1, GRID.X), 2), start_swing(), 14), PERIOD)
    assert (swing.torque[0], swing.clock) == (0.0, 0)
    for _ in range(PATH_LENGTH):
        swing = advance_unpowered(GRID, swing, PERIOD)
    assert len(swing.path) == PATH_LENGTH
