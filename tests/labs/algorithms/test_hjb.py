"""The value function on a grid: beside a closed form and Pontryagin's costs, and its orders."""

from dataclasses import replace

import numpy as np
import pytest

from labs.algorithms import hjb
from labs.algorithms.hjb import StateGrid, ValueFunction
from labs.errors import LabError
from labs.optimal_control.families.systems import BLOCK_ON_A_LINE, PENDULUM
from labs.resumable import run_to_completion
from tests.labs.algorithms.test_indirect import COST, problem, riccati, solve_by_collocation

WINDOW = ((-1.5, -4.0), (1.5, 4.0))
SWING = ((-1.5, -11.0), (5.0, 11.0))


def mass(nodes: int, steps: int, u_max: float = 20.0) -> ValueFunction:
    of = problem(BLOCK_ON_A_LINE, (1.0, 0.0), 2.0, u_max)
    return run_to_completion(hjb.solve(of, StateGrid(*WINDOW, (nodes, nodes)), steps))


def pendulum(nodes: int, steps: int, u_max: float = 4.0) -> ValueFunction:
    of = problem(PENDULUM, (np.pi, 0.0), 1.0, u_max)
    return run_to_completion(hjb.solve(of, StateGrid(*SWING, (nodes, nodes)), steps))


def test_the_order_in_time_is_two() -> None:
    x, P = np.array([1.0, 0.0]), riccati(2.0)
    errors = [mass(41, steps).value(x, 0.0) - x @ P @ x for steps in (10, 20, 40)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.05)


def test_value_and_gradient_are_riccatis_everywhere_inside() -> None:
    V = mass(41, 80)
    for x in np.array([[0.0, 0.0], [0.5, 0.5], [-0.7, 1.0], [1.0, -1.0]]):
        for t in (0.0, 1.0):
            P = riccati(2.0 - t)
            assert V.value(x, t) == pytest.approx(x @ P @ x, abs=5e-4)
            np.testing.assert_allclose(V.gradient(x, t), 2.0 * P @ x, atol=2e-3)


def test_the_order_in_space_is_four() -> None:
    """Of the interpolation, off the nodes of a smooth function."""

    def error(nodes: int) -> float:
        grid = StateGrid((0.0, 0.0), (1.0, 1.0), (nodes, nodes))
        values = np.sin(3.0 * grid.nodes[:, 0] + 1.0) * np.exp(grid.nodes[:, 1])
        V = ValueFunction(1.0, grid, np.tile(values.reshape(1, nodes, nodes), (2, 1, 1)))
        places = np.linspace(0.31, 0.69, 40)
        found = [V.value(np.array([x, x]), 0.0) for x in places]
        return float(np.abs(found - np.sin(3.0 * places + 1.0) * np.exp(places)).max())

    errors = np.array([error(nodes) for nodes in (41, 81, 161)])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 4.0, atol=0.5)


def test_a_kink_does_not_oscillate() -> None:
    grid = StateGrid((-1.0, -1.0), (1.0, 1.0), (21, 21))
    values = np.where(grid.nodes[:, 0] > 0.03, 1.0, 0.0).reshape(1, 21, 21)
    V = ValueFunction(1.0, grid, np.tile(values, (2, 1, 1)))
    found = [V.value(np.array([x, 0.1]), 0.0) for x in np.linspace(-0.8, 0.8, 200)]
    assert min(found) > -1e-6
    assert max(found) < 1.0 + 1e-6


def test_a_limit_on_u_costs_what_pontryagin_says() -> None:
    best = solve_by_collocation(problem(BLOCK_ON_A_LINE, (1.0, 0.0), 2.0, 1.0))
    assert np.abs(best.U).max() == 1.0
    V = mass(121, 60, 1.0)
    assert V.value(np.array([1.0, 0.0]), 0.0) == pytest.approx(best.cost, rel=1e-3)
    np.testing.assert_allclose(V.gradient(best.X[0], 0.0), best.P[0], rtol=2e-2)


def test_the_gradient_along_the_optimal_motion_is_its_costate() -> None:
    """To the grid's error, which falls with it."""
    best = solve_by_collocation(problem(PENDULUM, (np.pi, 0.0), 1.0, 4.0))
    places = np.searchsorted(best.t, np.linspace(0.05, 0.95, 19))
    gaps, costs = [], []
    for nodes, steps in ((61, 20), (121, 40), (161, 60)):
        V = pendulum(nodes, steps)
        found = np.array([V.gradient(best.X[i], best.t[i]) for i in places])
        gap = np.abs(found - best.P[places]).max(axis=0) / np.abs(best.P).max(axis=0)
        gaps.append(gap.max())
        costs.append(abs(V.value(best.X[0], 0.0) / best.cost - 1.0))
    assert gaps[0] > gaps[1] > gaps[2]
    assert gaps[2] < 0.08
    assert costs[0] > costs[1] > costs[2]
    assert costs[2] < 2e-3


def test_values_are_positive_and_end_as_the_final_cost() -> None:
    V = pendulum(61, 30, 2.5)
    assert V.V.min() > -1e-3
    for x, v in zip(V.grid.nodes[::200], V.V[-1].ravel()[::200], strict=True):
        assert v == pytest.approx(COST.final(x))


def test_it_pauses_and_pausing_changes_nothing() -> None:
    of = problem(PENDULUM, (np.pi, 0.0), 1.0, 4.0)
    work, pauses = hjb.solve(of, StateGrid(*SWING, (101, 101)), 3), 0
    try:
        while True:
            next(work)
            pauses += 1
    except StopIteration as end:
        V = end.value.V
    assert pauses >= 3 * 101 * 101 // hjb.NODES_BETWEEN_PAUSES
    np.testing.assert_array_equal(V, pendulum(101, 3).V)


def test_what_it_does_not_solve_it_refuses() -> None:
    of, grid = problem(PENDULUM, (1.0, 0.0), 1.0, 4.0), StateGrid(*SWING, (11, 11))
    with pytest.raises(LabError, match="within finite limits"):
        run_to_completion(hjb.solve(problem(PENDULUM, (1.0, 0.0), 1.0), grid, 2))
    with pytest.raises(LabError, match="fixed T and a free end"):
        run_to_completion(hjb.solve(replace(of, x_final=np.zeros(2)), grid, 2))
    with pytest.raises(LabError, match="4 or more"):
        StateGrid(*SWING, (3, 11))
    with pytest.raises(LabError, match="empty"):
        StateGrid((0.0, 0.0), (1.0, 0.0), (11, 11))
