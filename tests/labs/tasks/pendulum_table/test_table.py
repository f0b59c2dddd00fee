"""Pendulums on a grid: dynamics against Pinocchio, the table against a tight integrator."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from labs.errors import LabError
from labs.models.pendulums import pendulum
from labs.tasks.pendulum_table.table import (
    PendulumGrid,
    acceleration,
    integrate_pendulum,
    pendulum_grid,
    table_size,
)


@pytest.mark.parametrize("rods", [1, 2])
def test_the_closed_form_is_pinocchios(rods: int) -> None:
    p = pendulum(rods)
    q, v, tau = np.random.default_rng(0).normal(scale=3.0, size=(3, 20, rods))
    found = acceleration(q, v, tau, 0.3)
    for i in range(20):
        wanted = pin.aba(p.model, p.data, q[i], v[i], tau[i] - 0.3 * v[i])
        np.testing.assert_allclose(found[i], wanted, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("rods", [1, 2])
def test_a_time_step_is_the_motion(rods: int) -> None:
    q, v = np.array([2.0, -0.4])[:rods], np.array([-3.0, 2.0])[:rods]
    tau = np.array([2.5, -1.0])[:rods]

    def f(t: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[rods:], acceleration(x[:rods], x[rods:], tau, 0.05)])

    exact = solve_ivp(f, (0.0, 0.1), np.concatenate([q, v]), rtol=1e-11, atol=1e-11).y[:, -1]
    np.testing.assert_allclose(
        np.concatenate(integrate_pendulum(q, v, tau, 0.05, 0.1)), exact, atol=2e-5
    )


@pytest.mark.parametrize("grid", [PendulumGrid(), PendulumGrid(2, 8, 7, 3)])
def test_a_node_is_nearest_to_itself_and_the_goal_is_one(grid: PendulumGrid) -> None:
    q, v = np.split(grid.nodes, 2, axis=1)
    np.testing.assert_array_equal(grid.state(q, v), np.arange(grid.X))
    goal = grid.state(grid.goal, np.zeros(grid.rods))
    np.testing.assert_allclose(grid.nodes[goal], [*grid.goal, *np.zeros(grid.rods)], atol=1e-12)
    assert grid.cost(1.0, 1.0, 1.0)[goal].min() == 0.0


def test_the_nearest_node_by_brute_force() -> None:
    grid = PendulumGrid(q_nodes=10, v_nodes=9)
    rng = np.random.default_rng(1)
    for q, v in zip(rng.uniform(-20, 20, 200), rng.uniform(-12, 12, 200), strict=True):
        around = (grid.nodes[:, 0] - q + np.pi) % (2 * np.pi) - np.pi
        along = grid.nodes[:, 1] - np.clip(v, -8.0, 8.0)
        i = int(np.argmin((around * 10) ** 2 + (along * 9) ** 2))
        assert grid.state(np.array([q]), np.array([v])) == i


def test_the_table_leads_where_the_motion_leads() -> None:
    grid = pendulum_grid(2, 6, 5, 3)
    assert grid is pendulum_grid(2, 6, 5, 3)
    assert grid.successor.shape == (900, 9)
    for x in (0, 137, 899):
        for u in (0, 5, 8):
            q, v = np.split(grid.nodes[x], 2)
            q, v = integrate_pendulum(q, v, grid.torques[u], grid.friction, grid.dt)
            assert grid.successor[x, u] == grid.state(q, v)
    pieces = np.concatenate([rows for _, rows in grid.successor_rows(chunk=100)])
    np.testing.assert_array_equal(pieces, grid.successor)


def test_its_costs_are_those_of_the_docstring() -> None:
    grid = PendulumGrid(q_nodes=4, v_nodes=3, levels=3)
    mdp = grid.mdp(0.9, 2.0, 3.0, 5.0)
    hanging_left = int(grid.state(np.array([0.0]), np.array([-8.0])))
    wanted = grid.dt * (2.0 * np.pi**2 + 3.0 * 64.0 + 5.0 * 6.25)
    assert mdp.C[hanging_left, 2] == pytest.approx(wanted)
    assert not mdp.terminal.any()
    assert mdp.deterministic


def test_the_curse_of_dimensionality() -> None:
    assert table_size(6, 10) == 10**12
    assert table_size(1, 51) == PendulumGrid().X
    assert table_size(2, 11) == PendulumGrid(2, 11, 11, 3).X


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"rods": 3}, "3 rods"),
        ({"v_nodes": 50}, "odd number of velocities"),
        ({"levels": 4}, "4 torque levels"),
        ({"dt": 0.0}, "above zero"),
        ({"rods": 2, "q_nodes": 101, "v_nodes": 101}, "more than 20000000 entries"),
    ],
)
def test_what_is_no_grid_is_refused(wrong: dict[str, Any], sentence: str) -> None:
    with pytest.raises(LabError, match=sentence):
        PendulumGrid(**wrong)
