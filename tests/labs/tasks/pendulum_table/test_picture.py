"""The pendulum's table as it is drawn."""

import numpy as np
import pytest

from labs.colors import NO_VALUE
from labs.tasks.pendulum_table.picture import HEIGHT, draw_table
from labs.tasks.pendulum_table.swing import change_velocity, start_swing
from labs.tasks.pendulum_table.table import PendulumGrid
from tests.labs.tasks.recording_scene import RecordingScene, all_finite

GRID = PendulumGrid(q_nodes=21, v_nodes=15, levels=3)


def test_values_are_heights_and_what_has_none_is_grey() -> None:
    scene = RecordingScene()
    V = np.linspace(0.0, 2.0, GRID.X)
    V[5], V[7] = np.nan, np.inf
    draw_table(scene, GRID, V, 2.0, None, start_swing())
    colors = scene.colors["relief"].reshape(-1, 3)
    np.testing.assert_array_equal(colors[[5, 7]], [NO_VALUE] * 2)
    heights = scene.points["relief"][..., 2].ravel() - 0.05
    assert (heights[5], heights[7]) == (0.0, 0.0)
    assert heights[-1] == pytest.approx(HEIGHT)
    assert all_finite(scene)
    assert "policy" not in scene.names


@pytest.mark.parametrize("many", [1, 2])
def test_every_pendulum_has_its_state_on_the_relief(many: int) -> None:
    scene, names = RecordingScene(), ["one", "other"][:many]
    swing = change_velocity(start_swing(many), 30.0)
    draw_table(scene, GRID, np.ones(GRID.X), 1.0, np.zeros(GRID.X, int), swing, names)
    for kind in ("pendulum", "state", "name"):
        found = {name for name in scene.names if name.startswith(f"{kind} ")}
        assert found == {f"{kind} {m + 1}" for m in range(many)}
    assert all_finite(scene)
    assert scene.points["state 1"][2] == pytest.approx(0.05 + HEIGHT + 0.012)


def test_arrows_show_known_states_only_and_none_across_the_seam() -> None:
    scene, known = RecordingScene(), np.zeros(GRID.X, bool)
    policy = np.ones(GRID.X, int)
    draw_table(scene, GRID, np.zeros(GRID.X), 1.0, policy, start_swing(), known=known)
    assert scene.points["policy"].shape == (2, 0, 3)
    draw_table(scene, GRID, np.zeros(GRID.X), 1.0, policy, start_swing())
    starts, ends = scene.points["policy"]
    lengths = np.linalg.norm(ends - starts, axis=1)
    assert len(starts) > 100
    assert (lengths < 0.12).all()
