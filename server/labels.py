"""Where labels stand around what they name: beside the robot and beside each other."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import viser

from labs.number_texts import with_minus_signs
from server.camera import Cameras
from server.nodes import Node

ANCHORS: dict[str, tuple[float, float]] = {
    "bottom-center": (0.0, 1.0),
    "center-left": (1.0, 0.0),
    "center-right": (-1.0, 0.0),
    "top-center": (0.0, -1.0),
    "bottom-left": (1.0, 1.0),
    "bottom-right": (-1.0, 1.0),
    "top-left": (1.0, -1.0),
    "top-right": (-1.0, -1.0),
}
"""Which part of a text stands on its point, the best first, and where that puts its middle: in half
widths and heights, to the right and up."""
DEFAULT_ANCHOR = next(iter(ANCHORS))
BOX_CORNERS = np.array([[-1.0], [1.0]])
"""From the middle of a box to its lower left and its upper right corner, in half widths."""
CHARACTER_WIDTH, LINE_HEIGHT = 7.0, 18.0
"""[px] the width of a character, and the height of a line."""
MOVE_COST, RANK_COST = 3.0, 0.5
"""What it costs a label to change its place, and to take the next best one."""
CLEARANCE = 6.0
"""[px] A label goes back to a better place, at no cost, once nothing is so near."""
OVERLAP_COST = 200.0
"""What it costs to stand wholly on another label; a point of a robot costs 1."""
GAP = np.array([4.0, 0.0])
"""[px] kept between two labels side by side: two numbers are not to read as one."""


@dataclass(frozen=True)
class Label:
    """A text at a point of the screen (2,) [px, to the right and up], and how it stands now."""

    text: str
    point: np.ndarray
    anchor: str = DEFAULT_ANCHOR


class LabelNode(Node):
    """A text at a point."""

    def __init__(self, server: viser.ViserServer, path: str, text: str) -> None:
        super().__init__(server.scene.add_label(path, text, anchor="bottom-center"))
        self.text, self.point, self.anchor = text, np.zeros(3), DEFAULT_ANCHOR

    def set_text(self, text: str, point: np.ndarray) -> None:
        """What it says, and of which point (3,) [m]."""
        self.text, self.point = with_minus_signs(text), point
        self.set_property("text", self.text)
        self.set_position(point)


def place_labels(nodes: Iterable[Node], cameras: Cameras) -> None:
    """Places labels for whoever looks."""
    labels = [node for node in nodes if isinstance(node, LabelNode)]
    points = cameras.project(np.array([label.point for label in labels])) if labels else None
    obstacles = cameras.project(cameras.solid)
    if points is None or obstacles is None:
        return
    now = [Label(node.text, p, node.anchor) for node, p in zip(labels, points, strict=True)]
    for node, anchor in zip(labels, choose_anchors(now, obstacles), strict=True):
        node.anchor = anchor
        node.set_property("anchor", anchor)


def choose_anchors(labels: list[Label], obstacles: np.ndarray) -> list[str]:
    """Anchors that keep the labels, the first ones first, off each other and off the obstacles
    (k, 2) [px]."""
    taken: list[np.ndarray] = []
    chosen = []
    for label in labels:
        size = np.array([CHARACTER_WIDTH * len(label.text) + 8.0, LINE_HEIGHT])

        boxes = {
            anchor: label.point + 0.5 * size * (side + BOX_CORNERS)
            for anchor, side in ANCHORS.items()
        }
        now = list(ANCHORS).index(label.anchor)
        costs = {}
        for rank, (anchor, box) in enumerate(boxes.items()):
            returns = rank < now and not _placement_cost(
                box + CLEARANCE * BOX_CORNERS, obstacles, taken
            )
            moved = MOVE_COST * (rank != now and not returns)
            costs[anchor] = RANK_COST * rank + moved + _placement_cost(box, obstacles, taken)
        best = min(costs, key=costs.__getitem__)
        taken.append(boxes[best])
        chosen.append(best)
    return chosen


def _placement_cost(box: np.ndarray, obstacles: np.ndarray, taken: list[np.ndarray]) -> float:
    """What it costs to stand in a box, for what is there already."""
    return _count_inside(box, obstacles) + OVERLAP_COST * sum(
        _overlap_fraction(box + GAP * BOX_CORNERS, other) for other in taken
    )


def _count_inside(box: np.ndarray, points: np.ndarray) -> int:
    """How many points (k, 2) lie in a box, (2, 2): its lower left and its upper right corner."""
    return int(((points > box[0]) & (points < box[1])).all(axis=1).sum())


def _overlap_fraction(one: np.ndarray, other: np.ndarray) -> float:
    """The part of a box that another covers."""
    shared = np.minimum(one[1], other[1]) - np.maximum(one[0], other[0])
    return float(np.prod(np.maximum(shared, 0.0)) / np.prod(one[1] - one[0]))
