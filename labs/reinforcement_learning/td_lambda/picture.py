"""Drawing TD(lambda): the cells glow with their eligibility traces while somebody walks."""

from collections.abc import Sequence

import numpy as np

from labs.colors import sequential
from labs.reinforcement_learning.td_lambda.partial_episode import PartialEpisode
from labs.reinforcement_learning.td_lambda.tasks import PredictionPlace
from labs.scene import Scene
from labs.tasks.grid_world.picture import board, draw_board, draw_path
from labs.tasks.random_walk.picture import draw_values, draw_walk
from labs.tasks.random_walk.walks import NINETEEN_STATE_WALK

MAX_PATH_POINTS = 150
"""Steps of the way that are drawn."""


def draw_place(
    scene: Scene,
    place: PredictionPlace,
    steps: PartialEpisode,
    part: float,
    trace: np.ndarray,
    values: Sequence[np.ndarray],
    glow: bool,
) -> None:
    """The walk or the grid; `part` in [0, 1] of the last step done is over. `values` (X,) of one
    or two learners; `glow`: whether the cells of a grid show the trace (X,) instead of them."""
    last, here = max(steps.done - 1, 0), steps.done
    if place.world is None:
        at = float(np.interp(part, (0.0, 1.0), steps.states[[last, here]]))
        draw_walk(
            scene, NINETEEN_STATE_WALK, at, sequential(np.minimum(trace[1:-1], 1.0), 0.0, 1.0)
        )
        draw_values(scene, NINETEEN_STATE_WALK, values, place.task.truth)
        return
    world, high = place.world, 1.0 if glow else place.scale
    shown = np.minimum(trace, 1.0) if glow else values[0]
    draw_board(scene, world, shown, high, None)
    cells = world.cells[steps.states[: here + 1]]
    draw_path(scene, world, cells[-MAX_PATH_POINTS:], 0)
    centers = board(world).centers
    begin, end = (centers[tuple(world.cells[steps.states[t]])] for t in (last, here))
    size = board(world).size
    center = (1.0 - part) * begin + part * end + [0.0, 0.0, 0.3 * size]
    scene.sphere("walker", center, 0.24 * size, "force")
