"""Random walks as they are drawn: bars as tall as values, a walker where it is."""

import numpy as np
import pytest

from labs.tasks.random_walk.picture import (
    CLIP_MARGIN,
    FLOOR,
    FREE,
    GAIN,
    HEIGHT,
    LOSS,
    ROW,
    cell_places,
    cell_size,
    draw_values,
    draw_walk,
    state_at,
    state_names,
    value_heights,
)
from labs.tasks.random_walk.walks import (
    FIVE_STATE_WALK,
    NINETEEN_STATE_WALK,
    THOUSAND_STATE_WALK,
    walk_task,
)
from tests.labs.tasks.recording_scene import RecordingScene


def test_states_have_letters_while_there_are_enough() -> None:
    assert state_names(FIVE_STATE_WALK) == ("A", "B", "C", "D", "E")
    assert state_names(THOUSAND_STATE_WALK)[:2] == ("1", "2")
    assert len(state_names(THOUSAND_STATE_WALK)) == 1000


def test_the_ends_wear_their_costs_and_the_walker_is_between_its_cells() -> None:
    scene = RecordingScene()
    draw_walk(scene, NINETEEN_STATE_WALK, 2.5, np.full((19, 3), 0.5))
    assert scene.colors[ROW].shape == (1, 21, 3)
    assert tuple(scene.colors[ROW][0, 0]) == LOSS
    assert tuple(scene.colors[ROW][0, -1]) == GAIN
    assert (scene.colors[ROW][0, 1:-1] == 0.5).all()
    assert scene.labels["left end"] == "1"
    assert "".join(scene.labels[f"state {name}"] for name in "ADGJMPS") == "ADGJMPS"
    assert scene.labels["right end"] == "-1"
    between = cell_places(NINETEEN_STATE_WALK)[2:4, 0].mean()
    assert scene.points["walker"][0] == pytest.approx(between)
    scene = RecordingScene()
    draw_walk(scene, FIVE_STATE_WALK, None)
    assert tuple(scene.colors[ROW][0, 0]) == FREE
    assert "walker" not in scene.points


def test_bars_reach_from_zero_to_their_values_over_their_cells() -> None:
    scene, truth = RecordingScene(), walk_task(FIVE_STATE_WALK).truth
    draw_values(scene, FIVE_STATE_WALK, [truth, np.zeros(7)], truth, [np.full(7, 0.1)])
    zero = FLOOR + HEIGHT
    places, half = cell_places(FIVE_STATE_WALK)[1:-1, 0], 0.5 * cell_size(FIVE_STATE_WALK)
    for i, name in enumerate("ABCDE"):
        for m, value in ((1, truth[i + 1]), (2, 0.0)):
            corners = scene.points[f"value {m} of {name}"]
            np.testing.assert_allclose(corners[:2, 2], zero)
            np.testing.assert_allclose(corners[2:, 2], FLOOR + HEIGHT * (1.0 + value))
            assert (np.abs(corners[:, 0] - places[i]) < half).all()
    np.testing.assert_allclose(
        scene.points["truth"][:, 0, 2], value_heights(FIVE_STATE_WALK, truth[1:-1])
    )
    whiskers = scene.points["spread 1"]
    np.testing.assert_allclose(whiskers[:, 1, 2] - whiskers[:, 0, 2], 0.2 * HEIGHT)
    assert "spread 2" not in scene.points


def test_a_click_finds_its_state() -> None:
    for x, (a, b, c) in enumerate(cell_places(FIVE_STATE_WALK)):
        assert state_at(FIVE_STATE_WALK, (float(a), float(b), float(c))) == x
    assert state_at(FIVE_STATE_WALK, (0.0, 5.0, 0.0)) is None


def test_what_is_far_off_is_cut() -> None:
    top, bottom = value_heights(NINETEEN_STATE_WALK, np.array([1e9, -1e9]))
    assert top == pytest.approx(FLOOR + HEIGHT * (1.0 + CLIP_MARGIN))
    assert bottom == pytest.approx(FLOOR - HEIGHT * CLIP_MARGIN)
