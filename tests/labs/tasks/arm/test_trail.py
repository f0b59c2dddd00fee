"""Trails: the newest point last, drawn from two points on."""

import numpy as np

from labs.scene import Color, NullScene
from labs.tasks.arm.trail import TRAIL_POINTS, TRAIL_STRIDE, append_row, draw_trail


class Trails(NullScene):
    """Remembers the points drawn."""

    points = np.zeros((0, 3))

    def trail(
        self, name: str, points: np.ndarray, color: Color = "actual", strength: float = 1.0
    ) -> None:
        self.points = points


def test_rows_move_up_and_the_old_array_stays() -> None:
    rows = np.arange(6.0).reshape(3, 2)
    after = append_row(rows, np.array([8.0, 9.0]))
    np.testing.assert_array_equal(after, [[2, 3], [4, 5], [8, 9]])
    np.testing.assert_array_equal(rows, np.arange(6.0).reshape(3, 2))


def test_only_what_there_was_is_drawn() -> None:
    trail = np.arange(3.0 * TRAIL_POINTS).reshape(TRAIL_POINTS, 3)
    for steps, points in ((0, 0), (TRAIL_STRIDE - 1, 0), (TRAIL_STRIDE, 2), (10_000, TRAIL_POINTS)):
        scene = Trails()
        draw_trail(scene, "trail", trail, steps)
        assert len(scene.points) == points
        np.testing.assert_array_equal(scene.points, trail[len(trail) - points :])
