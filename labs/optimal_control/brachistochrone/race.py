"""The race: six beads let go at once, on six curves from A to B, or on one curve that starts at six
places.

What a bead does is a function of the time since: nothing is integrated while it is watched."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from labs.optimal_control.brachistochrone import curves
from labs.optimal_control.brachistochrone.cycloid import FastestDescent, fastest_descent
from labs.optimal_control.brachistochrone.descent import BeadMotion, Descent, descend
from labs.optimal_control.brachistochrone.params import BrachistochroneParams

CURVE_NAMES = ("line", "knee", "circle", "cycloid", "yours", "optimised")
START_NAMES = ("at the top", "2", "3", "4", "5", "yours")
LINE, KNEE, CIRCLE, CYCLOID, YOURS, OPTIMISED = range(6)
BEAD_COUNT = len(CURVE_NAMES)
START_FRACTIONS = (1.0, 0.8, 0.6, 0.4, 0.2)
"""Where the first five start, as parts of the way from the lowest point to A."""
TIE_TOLERANCE, MAX_DURATION = 1e-5, 30.0
"""[s] Within which beads arrive together; and what a race takes at most."""
SAMPLES = 80
"""Instants at which a motion is plotted, evenly spaced in time."""


@dataclass(frozen=True, eq=False)
class BeadRace:
    """Six beads on their ways; coordinates are metres across and of depth from A."""

    paths: tuple[np.ndarray, ...]
    """(k, 2) each, whole."""
    descents: tuple[Descent, ...]
    starts: np.ndarray
    """(6, 2) where each is let go."""
    end: np.ndarray
    """(2,) where they are to arrive."""
    fastest: FastestDescent | None
    """From A to B on any curve; None where none arrives."""
    one_curve: bool
    """Whether they start at six places of one curve."""

    @cached_property
    def times(self) -> np.ndarray:
        """(6,) [s], infinite for a bead that does not arrive."""
        return np.array([descent.time for descent in self.descents])

    @property
    def shortest_time(self) -> float:
        """[s] the fastest there is from A to B; of six starts, the first to arrive."""
        if self.one_curve:
            return float(self.times.min())
        return self.fastest.time if self.fastest else float("inf")

    @cached_property
    def duration(self) -> float:
        """[s] until the last has arrived, or has stopped for good; no more than MAX_DURATION."""
        return min(MAX_DURATION, max(float(descent.clock[-1]) for descent in self.descents))

    @cached_property
    def finishing_order(self) -> list[int]:
        """The beads that arrive, the first first."""
        return [int(i) for i in np.argsort(self.times, kind="stable") if np.isfinite(self.times[i])]

    def rank(self, i: int) -> int:
        """Of a bead that arrives, from 1; those within TIE_TOLERANCE share one."""
        return 1 + int((self.times < self.times[i] - TIE_TOLERANCE).sum())

    def at(self, t: float) -> BeadMotion:
        """All six, t seconds after they were let go."""
        now = [descent.at(np.array([t])) for descent in self.descents]
        return BeadMotion(*(np.concatenate(rows) for rows in zip(*now, strict=True)))

    @cached_property
    def sampled_motions(self) -> tuple[BeadMotion, ...]:
        """Each at SAMPLES instants of its own descent."""
        middle = (np.arange(SAMPLES) + 0.5) / SAMPLES
        return tuple(descent.at(middle * descent.clock[-1]) for descent in self.descents)


def simulate_race(params: BrachistochroneParams, nodes: np.ndarray) -> BeadRace:
    """With the optimiser's polyline `nodes` (N + 1, 2)."""
    return _simulate_race(params, nodes.tobytes())


@lru_cache(maxsize=8)
def _simulate_race(params: BrachistochroneParams, nodes: bytes) -> BeadRace:
    across, depth = params.across, params.depth
    fastest = None
    if params.in_reach:
        fastest = fastest_descent(across, depth, params.g, params.mu)
    if params.race == "curves":
        paths: tuple[np.ndarray, ...] = (
            curves.straight_line(across, depth),
            curves.knee_polyline(params.knee, across, depth),
            curves.circle_arc(across, depth),
            curves.cycloid(across, depth),
            curves.bezier(params.control_points),
            np.frombuffer(nodes).reshape(-1, 2),
        )
    else:
        paths = tuple(_curve_to_bottom(params, part) for part in (*START_FRACTIONS, params.release))
    descents = tuple(descend(path, params.g, params.mu) for path in paths)
    starts = np.array([path[0] for path in paths])
    return BeadRace(paths, descents, starts, paths[0][-1], fastest, params.race == "starts")


def _curve_to_bottom(params: BrachistochroneParams, part: float) -> np.ndarray:
    """From this part of the way from the lowest point up to A, down to the lowest point."""
    radius = params.generating_circle.radius
    if params.shape == "cycloid":  # 4 r cos(theta / 2) from the bottom
        return curves.cycloid_to_bottom(radius, 2.0 * np.arccos(part))
    return curves.circle_to_bottom(2.0 * radius, (1.0 - part) * np.pi / 2)


def nearest_release(params: BrachistochroneParams, across: float, depth: float) -> float:
    """The part of the way up from the lowest point at which the one curve is nearest to a point."""
    parts = np.linspace(0.0, 1.0, 101)
    starts = np.array([_curve_to_bottom(params, part)[0] for part in parts])
    return float(parts[np.hypot(*(starts - (across, depth)).T).argmin()])
