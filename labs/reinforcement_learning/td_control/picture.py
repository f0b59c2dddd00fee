"""What the lab of model-free control shows in the scene: a board with values, arrows, walks and
walkers; or pendulums beside the surface of what they expect to pay."""

from collections.abc import Sequence

import numpy as np

from labs.colors import sequential
from labs.models.pendulums import hanging
from labs.reinforcement_learning.td_control.tasks import PENDULUM, Task
from labs.reinforcement_learning.td_control.walks import Walk, pause
from labs.scene import Color, Scene, cell_centers
from labs.tasks.grid_world.map import GridWorld

CELL = 0.12
"""[m] Side of a cell on the board."""
WALL, CLIFF, GOAL = (0.36, 0.39, 0.44), (0.32, 0.07, 0.05), (0.1, 0.75, 0.35)
COLORS: tuple[Color, ...] = ("actual", "reference")
RODS = ((0.0, 0.41, 0.68), (0.81, 0.33, 0.0))
"""Of the first method and the second."""
SURFACE = ((-0.6, -0.1), (1.2, 1.2), 0.5)
"""[m] Where the surface begins, how far it reaches in x and y, and how high."""


def board(shape: tuple[int, int]) -> tuple[float, float, float]:
    """[m] The corner of a board that lies in the middle of the floor."""
    rows, columns = shape
    return (-0.5 * CELL * columns, -0.5 * CELL * rows, 0.01)


def draw_grid(
    scene: Scene,
    world: GridWorld,
    task: Task,
    tables: np.ndarray,
    tried: np.ndarray,
    shown: int,
    walk: Walk,
) -> None:
    """`tables` (M, X, U) holds Q of one learner of each method, `tried` (X,) the visits of the one
    `shown`: its values colour the cells, its greedy controls are the arrows."""
    rows, columns = world.shape
    origin = board(world.shape)
    centers = cell_centers(origin, CELL, rows, columns)
    size = CELL * max(columns, 1.6 * rows)
    scene.camera((0.0, -0.5 * size, 0.6 * size), (0.0, -0.04 * size, 0.0))
    value = tables[shown].min(axis=1)
    best = task.q_star[task.judged].min(axis=1).max(initial=1.0)
    dearest = float(np.clip(value.max(), best, 3.0 * best))
    colors = sequential(task.laid(dearest - value), 0.0, dearest)
    letters = np.array([list(row) for row in world.rows])
    for letter, color in (("#", WALL), ("C", CLIFF), ("G", GOAL)):
        colors[letters == letter] = color
    scene.cells("board", origin, CELL, colors)
    for column, wind in enumerate(world.wind):
        if wind:
            below = centers[-1, column] - (0.0, 0.8 * CELL, 0.0)
            scene.label(f"wind {column + 1}", "↑" * wind if wind < 4 else f"{wind}↑", below)
    at = centers[tuple(task.cells.T)] + (0.0, 0.0, 0.012)
    step = world.moves[tables[shown].argmin(axis=1)]
    ways = np.stack([step[:, 1], -step[:, 0], 0 * step[:, 0]], axis=1)
    known = (tried > 0) & ~task.mdp.terminal
    half = 0.3 * CELL * ways[known]
    scene.arrows("policy", at[known] - half, at[known] + half, "muted")
    for m, q in enumerate(tables):
        lift = np.array([0.02 * (m - 0.5), 0.02 * (m - 0.5), 0.02])
        path = _path(task, q)
        if len(path) > 1:
            scene.trail(f"way {m + 1}", at[path] + lift, COLORS[m])
        here = _between(centers, walk, m) + 2 * lift
        scene.sphere(f"walker {m + 1}", here, 0.25 * CELL, COLORS[m])


def draw_pendulum(
    scene: Scene,
    task: Task,
    tables: np.ndarray,
    names: Sequence[str],
    walk: Walk,
    shown: int,
) -> None:
    """The pendulums, and the surface of min_u Q over angle and velocity with a ball where each
    of them is."""
    aside = -0.25 * (len(names) - 1)
    scene.camera((1.6, aside - 0.3, 1.3), (0.0, aside + 0.05, 0.45))
    (x, y), (along, across), tall = SURFACE
    value = task.laid(tables[shown].min(axis=1))
    dearest = float(task.q_star.min(axis=1).max())
    height = tall * np.clip(value / dearest, 0.0, 1.5)
    v, q = np.meshgrid(
        np.linspace(0, 1, value.shape[0]), np.linspace(0, 1, value.shape[1]), indexing="ij"
    )
    points = np.stack([x + along * v, y + across * q, 0.05 + height], axis=-1)
    scene.surface("cost to go", points, sequential(dearest - value, 0.0, dearest))
    scene.label("angle", "angle ⟶", (x + along + 0.1, y + 0.5 * across, 0.02))
    scene.label("velocity", "⟵ velocity", (x + 0.5 * along, y + across + 0.2, 0.02))
    for m, name in enumerate(names):
        place = (0.0, -0.6 - 0.8 * m)
        scene.arm(f"pendulum {m + 1}", hanging(1, place, RODS[m]), walk.at[m, :1])
        scene.label(f"name {m + 1}", name, (*place, 1.4))
        state = int(PENDULUM.state(walk.at[m, :1], walk.at[m, 1:]))
        row, column = task.cells[state]
        scene.sphere(f"state {m + 1}", points[row, column] + (0, 0, 0.03), 0.03, COLORS[m])


def _path(task: Task, q: np.ndarray) -> list[int]:
    """The states of a greedy walk from the start while all goes as intended, to its end or to
    where it comes again."""
    policy, x, path = q.argmin(axis=1), task.start, []
    while x not in path:
        path.append(x)
        if task.mdp.deterministic:
            x = int(task.mdp.successors[x, policy[x]])
        else:
            x = int(task.mdp.probabilities[policy[x], x].argmax())
    return path


def _between(centers: np.ndarray, walk: Walk, m: int) -> np.ndarray:
    """(3,) [m] where a walker is on its way from cell to cell."""
    part = walk.clock / pause("grid")
    last = np.array(centers.shape[:2]) - 1
    begin, end = (
        centers[tuple(np.minimum(cell[m].astype(int), last))] for cell in (walk.at, walk.to)
    )
    between: np.ndarray = (1.0 - part) * begin + part * end
    return between
