"""A bead that slides from rest down a polyline, exactly.

Coordinates are metres across and metres of depth from where it is let go. On a slope alpha gravity
and friction accelerate it by a = g (sin alpha - mu cos alpha), constant on a segment, so that

    v^2 / 2 = g (depth - mu X)

with X the way across so far, there and back added up. The time down a segment of length L is then
2 L / (v_0 + v_1). Friction is of what the weight presses on the path; what a bend adds, mu m v^2
over its radius, is left out, as is the blow at a corner. Smooth curves are polylines of many nodes.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

NEGLIGIBLE_HEAD = 1e-15
"""v^2 / 2g [m] of what does not move."""


class BeadMotion(NamedTuple):
    """At k instants."""

    point: np.ndarray
    """(k, 2) [m]"""
    direction: np.ndarray
    """(k, 2) of length 1."""
    speed: np.ndarray
    """(k,) [m/s]"""
    friction_work: np.ndarray
    """(k,) [J/kg] that friction has taken."""


@dataclass(frozen=True, eq=False)
class Descent:
    """The way of one bead: as far as it gets, node by node. It ends in B, or where its speed is
    used up, which may be where it starts: then there are two nodes at one place."""

    points: np.ndarray
    """(k, 2) [m] across and depth."""
    speed: np.ndarray
    """(k,) [m/s]"""
    clock: np.ndarray
    """(k,) [s] when it is there."""
    friction_work: np.ndarray
    """(k,) [J/kg] that friction has taken."""
    arrived: bool

    @property
    def time(self) -> float:
        """[s] to B, infinite if it does not get there."""
        return float(self.clock[-1]) if self.arrived else float("inf")

    def at(self, t: np.ndarray) -> BeadMotion:
        """At instants t (k,) >= 0 [s] after it was let go. At its end it stays, with
        the speed it came with."""
        i = np.clip(np.searchsorted(self.clock, t, side="right") - 1, 0, len(self.clock) - 2)
        since, duration = t - self.clock[i], self.clock[i + 1] - self.clock[i]
        done = np.divide(since, duration, out=np.ones(len(t)), where=duration > 0.0).clip(0.0, 1.0)
        v, w = self.speed[i], self.speed[i + 1]
        now, mean = v + done * (w - v), np.maximum(v + w, NEGLIGIBLE_HEAD)
        part = (done * (v + now) / mean)[:, None]
        chord = self.points[i + 1] - self.points[i]
        length = np.maximum(np.hypot(*chord.T), NEGLIGIBLE_HEAD)[:, None]
        work = self.friction_work
        return BeadMotion(
            self.points[i] + part * chord,
            chord / length,
            now,
            work[i] + part[:, 0] * (work[i + 1] - work[i]),
        )


def descend(points: np.ndarray, g: float, mu: float) -> Descent:
    """Down the polyline `points` (k, 2) [m] from rest at the first."""
    work = mu * np.concatenate([[0.0], np.cumsum(np.abs(np.diff(points[:, 0])))])
    head = points[:, 1] - points[0, 1] - work
    stuck = np.flatnonzero(head[1:] < NEGLIGIBLE_HEAD)
    if len(stuck):
        i = int(stuck[0]) + 1
        part = head[i - 1] / (head[i - 1] - head[i]) if i > 1 else 0.0
        points, work, head = (_truncate(rows, i, part) for rows in (points, work, head))
    speed = np.sqrt(2.0 * g * np.maximum(head, 0.0))
    length, pace = np.hypot(*np.diff(points, axis=0).T), speed[:-1] + speed[1:]
    duration = np.divide(2.0 * length, pace, out=np.zeros(len(pace)), where=pace > 0.0)
    clock = np.concatenate([[0.0], np.cumsum(duration)])
    return Descent(points, speed, clock, g * work, arrived=not len(stuck))


def _truncate(rows: np.ndarray, i: int, part: float) -> np.ndarray:
    """Up to this part of the way from row i - 1 to row i."""
    return np.concatenate([rows[:i], [rows[i - 1] + part * (rows[i] - rows[i - 1])]])
