"""Drawing a table's Markov decision process: its states as tiles with their names, coloured by
cost-to-go, ends gray, what a policy does in them, and where that most likely leads.
"""

import numpy as np

from labs.colors import NO_VALUE, sequential
from labs.scene import Scene
from labs.tasks.grid_world.picture import CAMERA, LIFT, WALL, board
from labs.tasks.mdp_table.world import TableWorld

MAX_LABELLED_STATES = 40
"""States at most that have their names beside them."""


def draw_states(
    scene: Scene,
    world: TableWorld,
    V: np.ndarray,
    span: tuple[float, float],
    policy: np.ndarray | None,
) -> None:
    """Values V (X,), which may be NaN, coloured over `span`, and a policy (X,), if any."""
    place, table = board(world), world.table
    scene.camera(*CAMERA, core=place.around)
    centers = place.centers[tuple(world.cells.T)]
    known = np.isfinite(V)
    colors = sequential(np.where(known, V, 0.0), *span)
    colors[~known], colors[world.terminal] = NO_VALUE, WALL
    for x in range(len(centers)):
        corner = centers[x] - 0.45 * place.size * np.array([1.0, 1.0, 0.0])
        tint = colors[x : x + 1, None]
        scene.cells(f"state {x + 1}", corner, 0.9 * place.size, tint, clickable=False)
        if len(centers) <= MAX_LABELLED_STATES:
            does = "" if policy is None or world.terminal[x] else table.control(x, int(policy[x]))
            text = f"{table.states[x]}: {does}" if does else table.states[x]
            scene.label(f"name {x + 1}", text, centers[x] - (0.0, 0.3 * place.size, 0.0))
    if policy is None:
        return
    ahead = world.nominal[np.arange(len(centers)), policy]
    way = centers[ahead] - centers
    far = np.linalg.norm(way, axis=1, keepdims=True)
    part = np.where(far > 0.0, 0.3 * place.size / np.maximum(far, 1e-9), 0.0)
    scene.arrows("policy", centers + part * way + LIFT, centers + (1.0 - part) * way + LIFT)
