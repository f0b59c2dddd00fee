"""A task as a row of doors: what each costs, and what two players think of it.

Costs are heights, the cheaper the lower. Behind a door's frame a pale column spans two standard
deviations of its cost about the mean, a bar. A ball of each player stands at the estimate Q, on a
line that goes two standard errors, or to the lowest confidence bound, up and down, as far as the
door; who has never opened a door has no ball there. The frame of the door opened last is of the
player's colour, and so is a dot, what it cost; grey where that does not count."""

import numpy as np

from labs.reinforcement_learning.bandits.game import Game
from labs.reinforcement_learning.bandits.params import KINDS_WITH_TEST, BanditParams
from labs.scene import Color, Scene

DEPTH = 0.012
"""[m] between what lies on a door."""
SCALE = 0.2
"""[m] for a unit of cost."""
LOWEST, HIGHEST = -5.5, 5.5
"""Costs that fit on a door."""
COLORS: tuple[Color, Color] = ("actual", "reference")
BALL = 0.042
"""[m]"""
Span = tuple[float, float]


def draw_doors(scene: Scene, params: BanditParams, game: Game, opened: np.ndarray) -> None:
    """The one task of a game, with two players and the doors they opened last."""
    means = game["means"][0, 0]
    spread = 2.0 * params.deviation
    low, high = means.min() - spread, means.max() + spread
    width, spacing = (0.3, 0.42) if len(means) > 2 else (0.6, 1.0)
    across = spacing * (np.arange(len(means)) - 0.5 * (len(means) - 1))
    door = (_height(min(low, -3.0)) - 0.12, _height(max(high, 3.0)) + 0.12)
    turn, counts = _turn_label(params, game["regrets"].shape[1])
    for k, x in enumerate(across):
        sides = (x - 0.5 * width, x + 0.5 * width)
        _draw_panel(scene, f"door {k + 1}", sides, door, DEPTH, 0.12)
        costs = (_height(means[k] - spread), _height(means[k] + spread))
        if costs[1] - costs[0] > 1e-3:
            _draw_panel(scene, f"costs {k + 1}", sides, costs, 0.5 * DEPTH, 0.3)
        best = means[k] == means.min()
        mean = [(side, 0.0, _height(means[k])) for side in sides]
        scene.trail(f"mean {k + 1}", np.array(mean), "force" if best else "muted")
        for p, color in enumerate(COLORS):
            beside = x + (0.25 if p else -0.25) * width
            _draw_estimate(scene, params, game, (p, k), beside, door)
            if opened[p] == k:
                _draw_frame(scene, f"opened {p + 1}", sides, door, 0.02 * (1 + p), color)
                paid = (beside, -2.0 * DEPTH, _height(float(game["costs"][p])))
                scene.dots(f"paid {p + 1}", np.array([paid]), 0.05, color if counts else "muted")
        times = "/".join(str(n) for n in game["visits"][:2, 0, k])
        scene.label(f"choices {k + 1}", times, (x, 0.0, door[0] - 0.17))
    half, middle = 0.5 * spacing * len(means), 0.5 * (door[0] + door[1])
    if door[0] < _height(0.0) < door[1]:
        zero = np.array([(side * half, DEPTH, _height(0.0)) for side in (-1.0, 1.0)])
        scene.trail("cost 0", zero, "muted", 0.5)
        scene.label("0", "0", (-half - 0.06, 0.0, _height(0.0)))
    scene.label("turn", turn, (0.0, 0.0, door[1] + 0.14))
    away = max(2.2 * half, 1.6 * (door[1] - door[0]))
    core = np.array([[-half - 0.15, 0.0, door[0] - 0.22], [half, 0.0, door[1] + 0.18]])
    scene.camera((0.0, -away, middle + 0.06 * away), (0.0, 0.0, middle), core)


def _turn_label(params: BanditParams, turn: int) -> tuple[str, bool]:
    """What is said of a turn, and whether its cost counts."""
    test, many = turn - params.training_turns, params.training_turns
    if params.kind not in KINDS_WITH_TEST:
        return f"turn {turn} of {many}", True
    if test > 0:
        return f"test {test} of {many}: counts", True
    who = "free" if params.kind == "active" else "others open and pay"
    return f"lesson {turn} of {many}: {who}", False


def _draw_estimate(
    scene: Scene, params: BanditParams, game: Game, who: tuple[int, int], x: float, door: Span
) -> None:
    """What player p thinks of door k."""
    p, k = who
    n, Q = int(game["tried"][p, 0, k]), float(game["q"][p, 0, k])
    if n == 0:
        return
    width = 2.0 * params.deviation / np.sqrt(n)
    if params.strategies[p] == "bound":
        L = float(game["largest"][p, 0]) if params.measured else params.bound
        width = L * np.sqrt(2.0 * np.log(1.0 + game["tried"][p, 0].sum()) / n)
    ends = np.clip([_height(Q - width), _height(Q + width)], *door)
    if ends[1] - ends[0] > 1e-3:
        doubt = np.array([(x, -2.0 * DEPTH, z) for z in ends])
        scene.trail(f"doubt {p + 1} of {k + 1}", doubt, COLORS[p])
    scene.sphere(f"Q {p + 1} of {k + 1}", (x, -2.0 * DEPTH, _height(Q)), BALL, COLORS[p])


def _height(cost: float) -> float:
    """[m]"""
    return float(SCALE * (np.clip(cost, LOWEST, HIGHEST) - LOWEST))


def _draw_panel(
    scene: Scene, name: str, sides: Span, heights: Span, behind: float, opacity: float
) -> None:
    scene.polygon(name, _corners(sides, heights, behind)[:4], "muted", opacity)


def _draw_frame(
    scene: Scene, name: str, sides: Span, heights: Span, outside: float, color: Color
) -> None:
    wider = (sides[0] - outside, sides[1] + outside)
    higher = (heights[0] - outside, heights[1] + outside)
    scene.trail(name, _corners(wider, higher, 0.0), color)


def _corners(sides: Span, heights: Span, y: float) -> np.ndarray:
    """(5, 3) [m] of a rectangle, round to the first again."""
    (left, right), (bottom, top) = sides, heights
    round_it = [(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)]
    return np.array([(x, y, z) for x, z in round_it])
