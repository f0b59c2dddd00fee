"""What is kept of the iterations of a direct method, to be plotted and drawn, in collocation,
multiple shooting and the race of direct methods."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from labs.algorithms.sqp import SqpIterate
from labs.tasks.direct.params import DirectParams
from labs.tasks.direct.systems import RestToRestTask
from labs.tasks.direct.trajectory import PiecewiseTrajectory

KEPT_PATHS = 6
"""Iterations whose paths are drawn."""
ARC_POINTS = 4
"""Of a piece."""
SCROLL_SPEED = 0.2
"""[m/s] along -x, at which what moves in a plane is drawn as if the world moved back: so that
motions along one circle part."""


@dataclass(frozen=True, eq=False)
class IterationHistory:
    """Numbers of all iterations and the last paths. Arrays are never written into again."""

    cost: np.ndarray
    """(k + 1,) from the first guess on."""
    violation: np.ndarray
    """(k + 1,) the largest of the constraints."""
    gaps: np.ndarray
    """(k + 1, pieces): |x_(i+1) - where piece i ends|, of each."""
    residual: np.ndarray
    """(k,) of the conditions of optimality after each iteration."""
    alpha: np.ndarray
    """(k,) the step lengths."""
    tips: np.ndarray
    """(KEPT_PATHS, pieces, ARC_POINTS, 3) [m] of the tip, the newest last."""
    phases: np.ndarray
    """(KEPT_PATHS, pieces, ARC_POINTS, 2): position and velocity of the joint that tells most."""

    @classmethod
    def start(cls, params: DirectParams, at: SqpIterate, motion: PiecewiseTrajectory) -> Self:
        """Of a first guess."""
        none, gaps = np.zeros(0), np.linalg.norm(motion.gaps, axis=1)
        tips, phases = _arcs(params, motion)
        return cls(
            np.array([at.values.f]),
            np.array([at.violation]),
            gaps[None],
            none,
            none,
            np.tile(tips, (KEPT_PATHS, 1, 1, 1)),
            np.tile(phases, (KEPT_PATHS, 1, 1, 1)),
        )

    def append(self, params: DirectParams, at: SqpIterate, motion: PiecewiseTrajectory) -> Self:
        """One iteration later."""
        tips, phases = _arcs(params, motion)
        return type(self)(
            np.append(self.cost, at.values.f),
            np.append(self.violation, at.violation),
            np.concatenate([self.gaps, np.linalg.norm(motion.gaps, axis=1)[None]]),
            np.append(self.residual, at.optimality.residual if at.optimality else 0.0),
            np.append(self.alpha, at.alpha),
            np.concatenate([self.tips[1:], tips[None]]),
            np.concatenate([self.phases[1:], phases[None]]),
        )

    @property
    def iterations(self) -> int:
        return len(self.alpha)


def shift_in_time(at: RestToRestTask, places: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Places (..., 3) [m] at `times` (...) [s], moved back as time goes where motions are plane."""
    shift = SCROLL_SPEED * times[..., None] * np.array([1.0, 0.0, 0.0])
    return np.asarray(places - shift if at.planar else places)


def _arcs(params: DirectParams, motion: PiecewiseTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """Of the tip (pieces, ARC_POINTS, 3) as drawn, and in the phase plane (..., 2)."""
    body, joint = params.task.mechanism, params.task.shown
    X = motion.arcs(ARC_POINTS)
    tips = np.array([body.tip_positions(arc) for arc in X])
    h = motion.T / motion.pieces
    times = motion.times[:-1, None] + np.linspace(0.0, h, ARC_POINTS)
    return shift_in_time(params.task, tips, times), X[:, :, [joint, body.nq + joint]]
