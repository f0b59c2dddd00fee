"""What is learned: its optimum, its teachers, and how it lies on a map."""

import numpy as np
import pytest

from labs.reinforcement_learning.td_control.params import TdParams
from labs.reinforcement_learning.td_control.tasks import (
    KD,
    KP,
    LARGEST_GAMMA,
    PENDULUM_GRID,
    ControlTask,
    grid_task,
    pendulum_task,
)
from labs.tasks.grid_world.map import MAPS, GridWorld


def residual(task: ControlTask) -> float:
    """How far Q* is from a fixed point of Bellman's optimality equation, where it is finite."""
    value = task.q_star.min(axis=1)
    known = np.isfinite(task.q_star).all(axis=1)
    ahead = np.einsum("uxy,y->xu", task.mdp.probabilities, np.where(np.isfinite(value), value, 0))
    off = task.q_star - task.mdp.C - task.mdp.gamma * ahead
    return float(np.abs(off[known]).max())


@pytest.mark.parametrize("name", list(MAPS))
@pytest.mark.parametrize("slip", [0.0, 0.3])
def test_the_optimum_of_a_grid_is_a_fixed_point(name: str, slip: float) -> None:
    task = grid_task(MAPS[name], False, slip, False, 1.0, 1.0, True)
    assert residual(task) < 1e-9
    assert (task.compared == ~task.mdp.terminal).all()


def test_the_published_optima() -> None:
    for name, best in (("cliff", 13.0), ("windy", 15.0)):
        task = grid_task(MAPS[name], False, 0.0, False, 1.0, 1.0, False)
        assert task.q_star[task.start].min() == best
    kings = grid_task(MAPS["windy"], True, 0.0, False, 1.0, 1.0, False)
    assert kings.q_star[kings.start].min() == 7.0


def test_the_cautious_controller_takes_seventeen_steps_past_the_cliff() -> None:
    task = grid_task(MAPS["cliff"], False, 0.0, False, 1.0, 1.0, False)
    x, cost = task.start, 0.0
    while not task.mdp.terminal[x]:
        u = task.reference_policy[x]
        cost += task.mdp.C[x, u]
        x = int(task.mdp.successors[x, u])
    assert cost == 17.0


def test_the_cautious_controller_gives_way_to_walls() -> None:
    task = grid_task("..G\n.#.\nS..", False, 0.0, False, 1.0, 1.0, False)
    assert task.reference_policy[GridWorld.parse("..G\n.#.\nS..").state((2, 1))] == 1, (
        "under the wall it goes aside"
    )
    assert task.reference_policy[task.start] == 0


def test_pd_control_takes_the_level_nearest_to_its_torque() -> None:
    task = pendulum_task(0.9, 0.05, False)
    for q, v in ((np.pi, 0.0), (np.pi - 0.1, 0.0), (np.pi, 2.0), (1.0, 0.0)):
        x = int(PENDULUM_GRID.state(np.array([q]), np.array([v])))
        node_q, node_v = PENDULUM_GRID.nodes[x]
        wanted = np.clip(KP * (np.pi - node_q) - KD * node_v, -2.5, 2.5)
        assert abs(PENDULUM_GRID.torques[task.reference_policy[x], 0] - wanted) <= 0.625 + 1e-9


def test_the_pendulum_lies_on_its_map_with_angles_along_the_rows() -> None:
    task = pendulum_task(0.9, 0.05, False)
    q, v = PENDULUM_GRID.nodes.T
    np.testing.assert_allclose(task.on_map(q), np.tile(np.pi + PENDULUM_GRID.angles, (31, 1)))
    np.testing.assert_allclose(task.on_map(v), np.tile(PENDULUM_GRID.velocities[:, None], (1, 41)))
    assert task.on_map(np.arange(task.mdp.X))[tuple(task.cells[7])] == 7


def test_a_grid_lies_on_its_map_as_it_is_written() -> None:
    world = GridWorld.parse(MAPS["room"])
    task = grid_task(MAPS["room"], False, 0.0, False, 1.0, 1.0, False)
    values = np.arange(1.0, task.mdp.X + 1)
    assert np.array_equal(task.on_map(values), world.on_map(values))
    assert np.array_equal(task.cells, world.cells)


def test_errors_are_zero_at_the_optimum_only() -> None:
    task = grid_task(MAPS["cliff"], False, 0.0, False, 1.0, 1.0, False)
    assert task.errors(task.q_star) == (0.0, 0.0)
    off = task.q_star.copy()
    off[task.start, 0] += 3.0
    mean, most = task.errors(off)
    assert most == 3.0
    assert mean == pytest.approx(3.0 / np.sqrt(37 * 4))
    endless = grid_task("S#G", False, 0.0, False, 1.0, 1.0, False)
    assert endless.errors(np.zeros((2, 4))) == (0.0, 0.0)


def test_the_pendulum_is_never_entirely_patient() -> None:
    assert TdParams(system="pendulum").task.mdp.gamma == LARGEST_GAMMA
    assert residual(pendulum_task(LARGEST_GAMMA, 0.05, True)) < 1e-9
    assert TdParams().task.mdp.gamma == 1.0
