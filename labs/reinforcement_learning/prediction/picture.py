"""Drawing what is learned: values over a walk, a grid or a pendulum's table, and who walks there;
or the four kinds of update as diagrams, from where the walker is."""

import numpy as np

from labs.reinforcement_learning.prediction.corners import UPDATE_KINDS
from labs.reinforcement_learning.prediction.live_learner import LiveLearner
from labs.reinforcement_learning.prediction.params import PREDICTION_METHODS
from labs.reinforcement_learning.prediction.worlds import PredictionWorld
from labs.scene import Scene
from labs.tasks.grid_world.map import GridWorld
from labs.tasks.grid_world.picture import BOARD, board, draw_board, draw_walkers
from labs.tasks.grid_world.walk import GridWalk
from labs.tasks.pendulum_table.picture import draw_table
from labs.tasks.pendulum_table.swing import Swing
from labs.tasks.pendulum_table.table import PendulumGrid
from labs.tasks.random_walk.picture import (
    INSIDE,
    ROW,
    draw_values,
    draw_walk,
    state_at,
    state_names,
)
from labs.tasks.random_walk.walks import WalkShape

SELECTED_COLOR = (0.62, 0.70, 0.86)
"""sRGB of its cell on a walk."""
MOVE = 1000
"""Parts that a step on the grid is drawn in."""
SQUARE = np.array(
    [[-1.0, -1.0, 0.1], [1.0, -1.0, 0.1], [1.0, 1.0, 0.1], [-1.0, 1.0, 0.1], [-1.0, -1.0, 0.1]]
)
ACROSS, APART = 0.15, (1.4, 0.85)
"""[m] between two states of a diagram; between two diagrams, along and up."""
DEEP, LEVELS, DOT = 0.5, 8, 0.04
"""[m] Height of a diagram, its levels (a longer path is drawn closer), and [m] width of a dot."""


TABLE = {
    "no sampling": (-1.5, 0.0, 0.85),
    "sampling": (-1.5, 0.0, 0.0),
    "no bootstrapping": (-0.5 * APART[0], 0.0, -0.32),
    "bootstrapping": (0.5 * APART[0], 0.0, -0.32),
}
"""[m] Where the sides of the table of updates are named."""


def draw_world(
    scene: Scene,
    world: PredictionWorld,
    live: LiveLearner,
    V: np.ndarray,
    spread: np.ndarray | None,
    method: str,
    looked_at: int,
) -> None:
    """Values V (2, X) of Monte Carlo and TD(0), on a grid and the pendulum's table those of one
    `method` ("mc" or "td"); on a walk their standard deviation (2, X), if given; and the walker.
    The cell of the state looked at is marked."""
    shown = list(PREDICTION_METHODS).index(method)
    part, (x, y) = min(live.phase, 1.0), live.states[-2:]
    match world.place:
        case WalkShape():
            colors = np.tile(INSIDE, (world.place.states, 1))
            colors[looked_at - 1] = SELECTED_COLOR
            draw_walk(
                scene, world.place, float((1.0 - part) * x + part * y), colors, clickable=True
            )
            spreads = [] if spread is None else list(spread)
            draw_values(scene, world.place, list(V), world.truth, spreads)
        case GridWorld():
            high = float(world.truth.max())
            draw_board(scene, world.place, V[shown], max(high, 1.0), None, relief=True)
            corner = board(world.place).centers[0, 1] + np.array([0.0, 0.25, 0.0])
            scene.label("method", PREDICTION_METHODS[method], corner)
            square = 0.46 * board(world.place).size * SQUARE
            scene.trail(
                "looked at",
                board(world.place).centers[tuple(world.place.cells[looked_at])] + square,
                "force",
            )
            at, to = world.place.cells[[x]], world.place.cells[[y]]
            clock = int(part * (MOVE - 1))
            draw_walkers(
                scene, world.place, GridWalk(at, to, np.zeros(1), at[None], MOVE, clock=clock)
            )
        case PendulumGrid():
            high = max(float(world.truth.max()), 1e-3)
            names = (PREDICTION_METHODS[method],)
            draw_table(
                scene,
                world.place,
                V[shown],
                high,
                None,
                _interpolate_swing(world, live, part),
                names,
            )


def clicked_state(
    world: PredictionWorld, handle: str, point: tuple[float, float, float]
) -> int | None:
    """The state whose cell was clicked on a walk or a grid at a point [m], if there is one that
    does not end an episode."""
    x: int | None = None
    if isinstance(world.place, WalkShape) and handle == ROW:
        x = state_at(world.place, point)
    elif isinstance(world.place, GridWorld) and handle == BOARD:
        cell = board(world.place).cell_at(point)
        x = None if cell is None else world.place.state(cell)
    return None if x is None or world.mdp.terminal[x] else x


def _interpolate_swing(world: PredictionWorld, live: LiveLearner, part: float) -> Swing:
    """The pendulum on its way from node to node, the short way round."""
    grid = world.place
    assert isinstance(grid, PendulumGrid)
    nodes = grid.nodes[live.states[-40:]]
    way = np.unwrap(nodes[:, 0])
    path = np.stack([way, nodes[:, 1]], axis=1)
    now = (1.0 - part) * path[-2] + part * path[-1]
    torque = grid.torques[live.controls[-1]]
    return Swing(now[None], now[None], torque, np.zeros(1), np.vstack([path[:-1], now])[:, None])


def draw_batch(scene: Scene, place: WalkShape, V: np.ndarray, truth: np.ndarray | None) -> None:
    """Values V (2, X) learned from a batch, and the truth (X,), where it is known."""
    draw_walk(scene, place, None)
    draw_values(scene, place, list(V), truth)


def draw_backup_diagrams(
    scene: Scene, world: PredictionWorld, live: LiveLearner, V: np.ndarray
) -> None:
    """The four updates, bootstrapping to the right, sampling below: on the left of the state where
    the walker's episode began, on the right of the one where it has just been, with what V (4, X)
    says of it. Time runs downwards. Lines are the transitions looked at, magenta dots ends of an
    episode, orange dots states whose estimate is used."""
    place = world.place
    assert isinstance(place, WalkShape)
    end = place.states + 1
    done = len(live.states) if live.over else len(live.states) - 1
    path = live.states[: max(done, 2)]
    x, y = (path[0], path[1]) if len(path) == 2 else path[-2:]
    root = int(path[0])
    tree = _path_edges(root, end)
    either = np.array([[[x, 0], [x - 1, 1]], [[x, 0], [x + 1, 1]]])
    walked = np.stack([path, np.arange(len(path))], axis=1)
    edges = (
        tree,
        either,
        np.stack([walked[:-1], walked[1:]], axis=1),
        np.array([[[x, 0], [y, 1]]]),
    )
    for c, (name, seen) in enumerate(zip(UPDATE_KINDS, edges, strict=True)):
        corner = np.array([(c % 2 - 0.5) * APART[0], 0.0, (0.5 - c // 2) * APART[1] + 0.7])
        _draw_backup_diagram(scene, name, corner, seen.astype(float), end, bootstraps=c % 2 == 1)
        of = int(x) if c % 2 else root
        text = f"{name}: V({state_names(place)[of - 1]}) = {V[c, of]:.2f}"
        scene.label(name, text, corner + np.array([0.0, 0.0, 0.1]))
    for text, where in TABLE.items():
        scene.label(text, text, where)
    scene.camera((0.0, -3.0, 0.7), (0.0, 0.0, 0.6))


def _path_edges(x: int, end: int) -> np.ndarray:
    """(m, 2, 2): from (state, level) to (state, level), all steps that paths from x may take."""
    edges, here = [], {x}
    for level in range(LEVELS):
        edges += [((s, level), (s + way, level + 1)) for s in sorted(here) for way in (-1, 1)]
        here = {s + way for s in here for way in (-1, 1)} - {0, end}
    return np.array(edges)


def _draw_backup_diagram(
    scene: Scene, name: str, corner: np.ndarray, edges: np.ndarray, end: int, *, bootstraps: bool
) -> None:
    """Edges (m, 2, 2) under a name; `corner` is the middle of the top."""
    down = DEEP / max(LEVELS, edges[..., 1].max())
    x = ACROSS * (edges[..., 0] - 0.5 * end)
    points = np.stack([x, 0.0 * x, -down * edges[..., 1]], axis=-1) + corner
    for s in (0, end):
        side = corner + np.array([ACROSS * (s - 0.5 * end), 0.004, 0.0])
        scene.trail(
            f"{name}, end {s}", np.array([side, side - np.array([0.0, 0.0, DEEP])]), "muted", 0.5
        )
    scene.trail(f"{name}, steps", points, "actual")
    states = edges[:, 1, 0]
    ended = (states == 0) | (states == end)
    last = edges[:, 1, 1] == edges[:, 1, 1].max()
    scene.dots(f"{name}, root", points[:1, 0], DOT, "actual")
    scene.dots(f"{name}, ends", points[ended, 1], DOT, "force")
    if bootstraps:
        scene.dots(f"{name}, estimates", points[~ended & last, 1], DOT, "reference")
