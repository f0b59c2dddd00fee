"""What the cells of a board are: labs and the scene agree on it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labs.scene import NullScene, arc_point, cell_at, cell_centers

ORIGIN, SIZE, ROWS, COLUMNS = (1.0, -2.0, 0.3), 0.25, 3, 5


def test_row_0_lies_farthest_and_column_0_first() -> None:
    centers = cell_centers(ORIGIN, SIZE, ROWS, COLUMNS)
    assert centers.shape == (ROWS, COLUMNS, 3)
    np.testing.assert_allclose(centers[0, 0], [1.125, -1.375, 0.3])
    np.testing.assert_allclose(centers[2, 4], [2.125, -1.875, 0.3])


@given(
    st.integers(0, ROWS - 1),
    st.integers(0, COLUMNS - 1),
    st.floats(-0.49, 0.49),
    st.floats(-0.49, 0.49),
    st.floats(-9.0, 9.0),
)
def test_a_point_in_a_cell_is_of_that_cell(
    row: int, column: int, dx: float, dy: float, z: float
) -> None:
    x, y, _ = cell_centers(ORIGIN, SIZE, ROWS, COLUMNS)[row, column]
    point = (x + dx * SIZE, y + dy * SIZE, z)
    assert cell_at(point, ORIGIN, SIZE, ROWS, COLUMNS) == (row, column)


@pytest.mark.parametrize(
    "point", [(0.99, -1.9, 0), (2.26, -1.9, 0), (1.1, -2.01, 0), (1.1, -1.2, 0)]
)
def test_beside_the_board_there_is_no_cell(point: tuple[float, float, float]) -> None:
    assert cell_at(point, ORIGIN, SIZE, ROWS, COLUMNS) is None


def test_a_scene_nobody_sees_keeps_the_names() -> None:
    scene = NullScene()
    scene.cells("board", ORIGIN, SIZE, np.zeros((2, 3, 3)))
    scene.surface("value", np.zeros((2, 3, 3)), np.zeros((2, 3, 3)))
    scene.arrows("policy", np.zeros((0, 3)), np.zeros((0, 3)))
    assert scene.names == ["board", "value", "policy"]


def test_an_arc_turns_about_its_axis_in_the_right_handed_sense() -> None:
    center, axis = np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 2.0])
    first, quarter = (arc_point(center, axis, angle, 0.5) - center for angle in (0.0, np.pi / 2))
    np.testing.assert_allclose(np.cross(first, quarter), [0.0, 0.0, 0.25], atol=1e-15)
    angles = np.linspace(-6.0, 6.0, 7)
    many = arc_point(center, [0.3, -0.2, 0.5], angles, 0.5)
    np.testing.assert_allclose(np.linalg.norm(many - center, axis=1), 0.5)
    np.testing.assert_allclose((many - center) @ [0.3, -0.2, 0.5], 0.0, atol=1e-15)
