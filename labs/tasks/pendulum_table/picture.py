"""Drawing the pendulum's table: its values as a relief over angle and velocity, the policy as
arrows on it, and the pendulums that swing by it with their states on the relief.

Dark is cheap and pale is dear, as in a heat map of the page; what has no value is grey and flat.
"""

from collections.abc import Sequence

import numpy as np

from labs.colors import NO_VALUE, sequential
from labs.models.pendulums import pendulum_arm
from labs.scene import Color, Scene
from labs.shapes import Vector3
from labs.tasks.pendulum_table.swing import Swing
from labs.tasks.pendulum_table.table import PendulumGrid

BALL_COLORS: tuple[Color, ...] = ("actual", "reference")
ROD_COLORS: tuple[Vector3, ...] = ((0.0, 0.41, 0.68), (0.81, 0.33, 0.0))
"""Of the first and the second of those side by side."""
HEIGHT = 0.55
"""[m] of the relief at the largest value."""
ALONG, ACROSS = 2.6, 1.9
"""[m] of the relief: once round the circle, and all velocities."""
PIVOT, ASIDE = -1.85, 0.8
"""[m] y where the first pendulum hangs, and from each to the next."""
MESH, ARROWS = 41, 13
"""Points and arrows of a relief along one side, about."""
ARROW = 0.11
"""[m] Length of an arrow."""
ABOVE = np.array([0.0, 0.0, 0.012])
"""[m] Lines and arrows float this far above the relief."""
FULL_TORQUE = 6.0
"""[N m] shown as an arc of 162 degrees."""


def draw_table(
    scene: Scene,
    grid: PendulumGrid,
    V: np.ndarray,
    high: float,
    policy: np.ndarray | None,
    swing: Swing,
    names: Sequence[str] = (),
    *,
    known: np.ndarray | None = None,
) -> None:
    """Values V (X,), which may be NaN, coloured from 0 to `high` > 0, and a policy (X,), if any, of
    the states in `known` (X,) bool only, if given; and the pendulums, with names where there are
    several."""
    middle = -0.24 - 0.5 * ASIDE * (len(swing.at) - 1)
    scene.camera((2.4 - middle - 0.24, middle, 2.1), (0.0, middle, 0.3))
    heights = np.clip(np.where(np.isfinite(V), V, 0.0) / high, -0.2, 1.3) * HEIGHT
    heights = heights.reshape(grid.shape)
    _draw_relief(scene, grid, heights, np.isfinite(V).reshape(grid.shape))
    if policy is not None:
        _draw_policy(scene, grid, heights, policy, known)
    for m in range(len(swing.at)):
        _draw_pendulum(scene, grid, heights, swing, m)
    for m, name in enumerate(names):
        scene.label(f"name {m + 1}", name, (0.0, PIVOT - ASIDE * m, 1.4))


def draw_wireframe(scene: Scene, grid: PendulumGrid, V: np.ndarray, high: float) -> None:
    """Other values V (X,), finite, as lines over the same floor, to compare with a relief."""
    points = _floor_position(grid, grid.nodes.reshape(*grid.shape, 2))
    points[..., 2] += np.clip(V.reshape(grid.shape) / high, -0.2, 1.3) * HEIGHT
    scene.trail("wires", points.transpose(1, 0, 2)[::3] + ABOVE, "reference", 0.7)


def _draw_relief(scene: Scene, grid: PendulumGrid, heights: np.ndarray, known: np.ndarray) -> None:
    stride = max(1, -(-grid.q_nodes // MESH))
    some = (slice(None, None, stride), slice(None, None, stride))
    points = _floor_position(grid, grid.nodes.reshape(*grid.shape, 2)[some])
    points[..., 2] += heights[some]
    colors = sequential(heights[some], 0.0, HEIGHT)
    colors[~known[some]] = NO_VALUE
    scene.surface("relief", points, colors)
    corner, fast = 1e-6, grid.v_max
    for name, text, q, v in (
        ("front", f"hanging, v = -{fast:g} rad/s", corner, -fast),
        ("back", f"v = {fast:g} rad/s", corner, fast),
        ("middle", "upright", np.pi, -fast),
    ):
        above = np.array([0.0, 0.0, 0.08]) + _relief_position(grid, heights, np.array([[q, v]]))[0]
        scene.label(name, text, above)


def _draw_policy(
    scene: Scene,
    grid: PendulumGrid,
    heights: np.ndarray,
    policy: np.ndarray,
    known: np.ndarray | None,
) -> None:
    """Arrows from some nodes towards where the policy leads."""
    every = max(1, grid.q_nodes // ARROWS)
    angle, velocity = (n // 2 % every for n in grid.shape)
    some = np.arange(grid.X).reshape(grid.shape)[angle::every, velocity::every].ravel()
    if known is not None:
        some = some[known[some]]
    ahead = grid.successor[some, policy[some].astype(int)]
    starts, ends = (_relief_position(grid, heights, grid.nodes[x]) for x in (some, ahead))
    near = np.abs(ends[:, 1] - starts[:, 1]) < ALONG / 2  # not across the seam
    starts, ways = starts[near], (ends - starts)[near]
    lengths = np.linalg.norm(ways, axis=1, keepdims=True)
    ways = ARROW * ways / np.where(lengths > 0.0, lengths, 1.0)
    scene.arrows("policy", starts, starts + ways, "muted")


def _draw_pendulum(
    scene: Scene, grid: PendulumGrid, heights: np.ndarray, swing: Swing, m: int
) -> None:
    """A pendulum with its torque, its state, and the way that came to since it last passed the
    seam of the relief."""
    pivot = PIVOT - ASIDE * m
    scene.arm(f"pendulum {m + 1}", pendulum_arm(1, (0.0, pivot), ROD_COLORS[m]), swing.at[m, :1])
    tau = float(swing.torque[m])
    if tau:
        angle = 0.9 * np.pi * np.clip(tau / FULL_TORQUE, -1.0, 1.0)
        scene.arc(f"torque {m + 1}", (0.06, pivot, 0.75), (1.0, 0.0, 0.0), angle, 0.2)
    turns = swing.path[:, m, 0] // (2 * np.pi)
    passed = np.flatnonzero(np.diff(turns))
    since = int(passed[-1]) + 1 if len(passed) else 0
    way = _relief_position(grid, heights, swing.path[since:, m])
    if len(way) >= 2:
        scene.trail(f"way {m + 1}", way, BALL_COLORS[m])
    scene.sphere(
        f"state {m + 1}",
        _relief_position(grid, heights, swing.at[m : m + 1])[0],
        0.035,
        BALL_COLORS[m],
    )


def _floor_position(grid: PendulumGrid, x: np.ndarray) -> np.ndarray:
    """(..., 3) [m]: where (q, v) (..., 2) is on the floor under the relief; q wrapped about
    upright."""
    angle = x[..., 0] % (2 * np.pi) - np.pi
    y = ALONG * angle / (2 * np.pi) + 0.1
    return np.stack([-ACROSS / 2 * x[..., 1] / grid.v_max, y, np.full(y.shape, 0.05)], axis=-1)


def _relief_position(grid: PendulumGrid, heights: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(k, 3) [m]: states (k, 2) on the relief."""
    clipped = np.stack([x[:, 0], np.clip(x[:, 1], -grid.v_max, grid.v_max)], axis=1)
    places: np.ndarray = _floor_position(grid, clipped) + ABOVE
    places[:, 2] += heights.ravel()[grid.state(x[:, :1], x[:, 1:])]
    return places
