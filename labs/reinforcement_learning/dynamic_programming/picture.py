"""Drawing problems of dynamic programming: cost-to-go as a relief, the policy as arrows on it, and
who follows it."""

from dataclasses import dataclass

import numpy as np

from labs.colors import sequential
from labs.models.pendulums import hanging
from labs.reinforcement_learning.dynamic_programming.problems import MOVE, Problem, Walk, rollout
from labs.reinforcement_learning.dynamic_programming.side_by_side import RANDOM
from labs.scene import Scene, cell_centers
from labs.tasks.grid_world.map import GridWorld
from labs.tasks.pendulum_table.table import PendulumGrid

WALL, CLIFF, GOAL = (0.36, 0.38, 0.42), (0.62, 0.16, 0.16), (0.30, 0.62, 0.32)
NO_VALUE = (0.62, 0.63, 0.65)
"""Of cells and nodes without one."""
HEIGHT = 0.55
"""[m] of the relief at the largest value."""
ALONG, ACROSS = 2.6, 1.9
"""[m] of a pendulum's relief: once round the circle, and all velocities."""
PIVOT = (0.0, -1.85)
"""(x, y) [m] where the pendulum hangs."""
MESH, ARROWS = 35, 13
"""Points and arrows of a relief along one side, about."""
ARROW = 0.11
"""[m] Length of an arrow on a pendulum's relief."""
LIFT = np.array([0.0, 0.0, 0.012])
"""[m] Lines and arrows float this far above what they belong to."""


@dataclass(frozen=True, eq=False)
class Picture:
    """What to show of a problem."""

    found: Problem
    V: np.ndarray
    """(X,); NaN where there is no value."""
    top: float
    """The value that stands HEIGHT tall, > 0."""
    policy: np.ndarray | None
    """(X,), RANDOM for all controls alike; None where nothing is left to do."""


def board(world: GridWorld) -> tuple[tuple[float, float, float], float]:
    """Origin and side of the cells [m] of a grid world's board."""
    rows, columns = world.shape
    size = min(0.24, 2.1 / columns, 1.1 / rows)
    return (-size * columns / 2, -size * rows - 0.05, 0.02), size


def draw_grid(
    scene: Scene, picture: Picture, world: GridWorld, walk: Walk, trails: dict[str, np.ndarray]
) -> None:
    """The board to click on, and behind it its values as a relief. `trails` are policies (X,) or
    (N, X) whose ways from the start are shown: "actual" and "reference"."""
    scene.camera((0.0, -1.4, 1.6), (0.0, 0.06, 0.06))
    origin, size = board(world)
    rows, columns = world.shape
    centers = cell_centers(origin, size, rows, columns)
    scene.cells("board", origin, size, _cell_colors(picture, world, goals=True))
    _policy_arrows(scene, "policy", picture, world, centers, size)
    if min(world.shape) >= 2:
        relief = centers + np.array([0.0, size * rows + 0.2, 0.0])
        relief[..., 2] += _laid(picture, world)
        scene.surface("relief", relief, _cell_colors(picture, world, goals=False))
        _policy_arrows(scene, "policy on the relief", picture, world, relief, size)
        scene.label("values", "cost-to-go V", relief[0, columns // 2] + [0.0, 0.15, 0.3])
    for state in range(picture.found.mdp.X):
        if world.kind(state) in "SG":
            row, column = world.cells[state]
            corner = centers[row, column] + [-0.3 * size, 0.3 * size, 0.02]
            scene.label(f"cell {state}", world.kind(state), corner)
    for name, policy in trails.items():
        cells = rollout(picture.found, policy)
        if len(cells) >= 2:
            shift = LIFT + ([0.0, 0.05 * size, 0.0] if name == "reference" else 0.0)
            color = "reference" if name == "reference" else "actual"
            scene.trail(f"way {name}", centers[tuple(cells.T)] + 2 * shift, color)  # type: ignore[arg-type]
    (r0, c0), (r1, c1) = walk.at.astype(int), walk.to.astype(int)
    part = walk.tick / MOVE
    place = (1.0 - part) * centers[r0, c0] + part * centers[r1, c1]
    scene.sphere("walker", place + np.array([0.0, 0.0, 0.3 * size]), 0.24 * size, "actual")


def draw_pendulum(scene: Scene, picture: Picture, grid: PendulumGrid, walk: Walk) -> None:
    """The pendulum, and the relief of its table with the present state on it."""
    scene.camera((2.4, -0.24, 2.1), (0.0, -0.24, 0.3))
    heights = _heights(picture).reshape(grid.shape)
    stride = max(1, -(-grid.q_nodes // MESH))
    some = (slice(None, None, stride), slice(None, None, stride))
    points = _place(grid, grid.nodes.reshape(*grid.shape, 2)[some])
    points[..., 2] += heights[some]
    colors = sequential(heights[some], 0.0, HEIGHT)
    colors[np.isnan(picture.V.reshape(grid.shape)[some])] = NO_VALUE
    scene.surface("relief", points, colors)
    _flow_arrows(scene, picture, grid, heights)
    turns = np.abs(np.diff(walk.path[:, 0] // (2 * np.pi), append=walk.path[-1, 0] // (2 * np.pi)))
    since = int(np.flatnonzero(turns)[-1]) + 1 if turns.any() else 0
    way = _on_relief(grid, heights, walk.path[since:])
    if len(way) >= 2:
        scene.trail("way", way, "force")
    scene.sphere("state", _on_relief(grid, heights, walk.at[None])[0], 0.035, "force")
    scene.arm("pendulum", hanging(1, PIVOT), walk.at[:1])
    if walk.u >= 0 and not walk.resting and picture.policy is not None:
        tau = float(grid.torques[walk.u, 0])
        if tau:
            scene.arc(
                "torque", (0.06, PIVOT[1], 0.75), (1.0, 0.0, 0.0), np.pi * 0.9 * tau / 6.0, 0.2
            )
    corner, fast = 1e-6, grid.v_max
    for name, text, q, v in (
        ("front", f"hanging, v = -{fast:g} rad/s", corner, -fast),
        ("back", f"v = {fast:g} rad/s", corner, fast),
        ("middle", "upright", np.pi, -fast),
    ):
        above = np.array([0.0, 0.0, 0.08]) + _on_relief(grid, heights, np.array([[q, v]]))[0]
        scene.label(name, text, above)


def _cell_colors(picture: Picture, world: GridWorld, *, goals: bool) -> np.ndarray:
    """(rows, columns, 3): by value; walls grey, the cliff red and, if `goals`, those green."""
    colors = sequential(_laid(picture, world), 0.0, HEIGHT)
    colors[tuple(world.cells[np.isnan(picture.V)].T)] = NO_VALUE
    signs = np.array([list(row) for row in world.rows])
    for sign, color in {"#": WALL, "C": CLIFF, **({"G": GOAL} if goals else {})}.items():
        colors[signs == sign] = color
    return colors


def _heights(picture: Picture) -> np.ndarray:
    """(X,) [m]: in proportion to the values; flat where there are none."""
    return np.asarray(np.clip(np.nan_to_num(picture.V) / picture.top, -0.2, 1.3) * HEIGHT)


def _laid(picture: Picture, world: GridWorld) -> np.ndarray:
    """(rows, columns) [m]: of the relief; walls stand out, and a cliff is a hole."""
    walls = np.array([[sign == "#" for sign in row] for row in world.rows])
    return np.where(walls, HEIGHT, world.on_map(_heights(picture)))


def _policy_arrows(
    scene: Scene,
    name: str,
    picture: Picture,
    world: GridWorld,
    places: np.ndarray,
    size: float,
) -> None:
    """One in each cell that is no goal, or one for each control where all are alike."""
    if picture.policy is None:
        return
    going = np.flatnonzero(~picture.found.mdp.terminal)
    controls = picture.policy[going]
    if (controls == RANDOM).all():
        going = np.repeat(going, len(world.moves))
        controls = np.tile(np.arange(len(world.moves)), len(going) // len(world.moves))
        back, ahead = 0.05, 0.3
    else:
        back, ahead = -0.28, 0.28
    down, right = world.moves[controls].T
    along = size * np.stack([right, -down, 0 * right], axis=1)
    along = along / np.maximum(np.hypot(down, right), 1.0)[:, None]
    middles = places[tuple(world.cells[going].T)] + LIFT
    scene.arrows(name, middles + back * along, middles + ahead * along, "force")


def _place(grid: PendulumGrid, x: np.ndarray) -> np.ndarray:
    """(..., 3) [m]: where (q, v) (..., 2) is on the floor under the relief; q wrapped about
    upright."""
    angle = (x[..., 0] - np.pi + np.pi) % (2 * np.pi) - np.pi
    y = ALONG * angle / (2 * np.pi) + 0.1
    return np.stack([-ACROSS / 2 * x[..., 1] / grid.v_max, y, np.full(y.shape, 0.05)], axis=-1)


def _on_relief(grid: PendulumGrid, heights: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(k, 3) [m]: states (k, 2) on the relief."""
    cut = np.stack([x[:, 0], np.clip(x[:, 1], -grid.v_max, grid.v_max)], axis=1)
    places: np.ndarray = _place(grid, cut) + LIFT
    places[:, 2] += heights.ravel()[grid.state(x[:, :1], x[:, 1:])]
    return places


def _flow_arrows(scene: Scene, picture: Picture, grid: PendulumGrid, heights: np.ndarray) -> None:
    """From some nodes towards where the policy leads."""
    if picture.policy is None:
        return
    every = max(1, grid.q_nodes // ARROWS)
    offset = (grid.q_nodes // 2) % every
    some = np.arange(grid.X).reshape(grid.shape)[offset::every, offset::every].ravel()
    ahead = grid.successor[some, picture.policy[some].astype(int)]
    starts, ends = (_on_relief(grid, heights, grid.nodes[x]) for x in (some, ahead))
    near = np.abs(ends[:, 1] - starts[:, 1]) < ALONG / 2  # not across the seam
    starts, ways = starts[near], (ends - starts)[near]
    lengths = np.linalg.norm(ways, axis=1, keepdims=True)
    ways = ARROW * ways / np.where(lengths > 0.0, lengths, 1.0)
    scene.arrows("policy", starts, starts + ways, "muted")
