"""What ties the four families together, in numbers: along the optimal motion the costate, the
gradient of V and the direct method's multipliers are one curve, and each tail is optimal."""

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from labs.optimal_control.families.motion import MethodMotion
from labs.optimal_control.families.params import FamiliesParams

NEGLIGIBLE = 1e-12


def relative_difference(
    curves: np.ndarray, others: np.ndarray, size: np.ndarray | None = None
) -> float:
    """The largest distance of two (k, 2), each column in parts of its largest value [%]."""
    size = np.abs(others).max(axis=0) if size is None else size
    return float(100.0 * (np.abs(curves - others).max(axis=0) / np.maximum(size, NEGLIGIBLE)).max())


def tail_gaps(
    params: FamiliesParams, optimal: MethodMotion, tail: MethodMotion
) -> Mapping[str, float]:
    """By how much a tail misses the optimal motion, and its cost what was left of J [%]."""
    rest = np.stack([np.interp(tail.t, optimal.t, column) for column in optimal.X.T], axis=1)
    left = optimal.cost - cost_until(params, optimal, float(tail.t[0]))
    return {
        "tail_gap": relative_difference(tail.X, rest, np.abs(optimal.X).max(axis=0)),
        "tail_cost_gap": 100.0 * abs(tail.cost - left) / max(optimal.cost, NEGLIGIBLE),
    }


def cost_until(params: FamiliesParams, motion: MethodMotion, t: float) -> float:
    """int l dt from 0 to t [s], by cubics through the samples of l."""
    rate = params.cost.running(motion.X, motion.U[:, None])
    return float(CubicSpline(motion.t, rate).integrate(0.0, t))
