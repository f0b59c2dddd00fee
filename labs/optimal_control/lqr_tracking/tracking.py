"""Tracking along a lap: the problem in deviations, its policy with all of the future in view, and
the one with a limited preview (notes, 2.4.3 to 2.4.5)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from labs.algorithms.periodic_lqr import PeriodicRegulator, preview_problem, solve_periodic
from labs.models.mechanisms import mechanism
from labs.optimal_control.lqr_tracking.laps import Lap, ReferencePath, lap
from labs.problems.linear_quadratic import LqrPolicy, LqrProblem

COSTED_JOINT = {"ur5": 1, "cart-pole": 0}
"""The joint that has linear costs, and its motor: the shoulder, the cart."""


@dataclass(frozen=True)
class TrackingSettings:
    """All that the policies are made from."""

    reference_path: ReferencePath
    feed_forward: str
    """One of `laps.FEED_FORWARDS`."""
    force: float
    """[N] along the world's y axis, that is known."""
    weights: tuple[float, float, float]
    """Of positions, of velocities, of the controls as shares of what the motors can give."""
    linear_costs: tuple[float, float]
    """q of the joint [1/rad; 1/m] and s of the motor in COSTED_JOINT, a share like its weight."""


@dataclass(frozen=True, eq=False)
class LimitedPreview:
    """The policy at one step of the lap, with some steps of it in view."""

    lap: Lap
    index: int
    """t, the step of the lap."""
    x_ref: np.ndarray
    """(nx,)."""
    u_ref: np.ndarray
    """(nu,)."""
    lap_problem: LqrProblem
    """Of the whole lap, in deviations from the reference."""
    window: LqrProblem
    """Of the steps in view, likewise."""
    policy: LqrPolicy
    """Of the window."""

    @property
    def gain(self) -> np.ndarray:
        """K_t (nu, nx)."""
        gain: np.ndarray = self.policy.gains[0]
        return gain

    @property
    def k(self) -> np.ndarray:
        """k_t (nu,)."""
        k: np.ndarray = self.policy.offsets[0]
        return k

    def cost(self, dx: np.ndarray, du: np.ndarray) -> float:
        """Of this step, whether its linear terms are in view or not: dx (nx,), du (nu,)."""
        terms = {name: term[0] for name, term in self.lap_problem.terms.items()}
        squares = dx @ terms["q"] @ dx + du @ terms["r"] @ du
        return float(squares + 2.0 * (terms["q_linear"] @ dx + terms["s_linear"] @ du))


def reference_lap(settings: TrackingSettings) -> Lap:
    """The reference and the linear system along it."""
    return lap(settings.reference_path, settings.feed_forward, settings.force)


@lru_cache(maxsize=64)
def full_preview(settings: TrackingSettings) -> PeriodicRegulator:
    """The policy of somebody who has all of the future in view, and its cost. Raises LabError as
    `laps.lap` and `solve_periodic` do."""
    along = reference_lap(settings)
    nq, limit = along.x_ref.shape[1] // 2, mechanism(settings.reference_path.robot).control_limit
    position_weight, velocity_weight, effort_weight = settings.weights
    q_linear, s_linear = np.zeros(2 * nq), np.zeros(len(limit))
    joint = COSTED_JOINT[settings.reference_path.robot]
    q_linear[joint], s_linear[joint] = settings.linear_costs
    q = np.diag(np.repeat([position_weight, velocity_weight], nq))
    return solve_periodic(
        LqrProblem(
            horizon=len(along.a),
            a=along.a,
            b=along.b,
            q=q,
            r=np.diag(effort_weight / limit**2),
            q_final=q,
            c=along.c,
            q_linear=q_linear,
            s_linear=s_linear / limit,
        )
    )


@lru_cache(maxsize=16)
def limited_preview(settings: TrackingSettings, index: int, steps: int) -> LimitedPreview:
    """From step `index` of the lap, with `steps` in view. Raises as `full_preview` does."""
    along, lasting = reference_lap(settings), full_preview(settings)
    window, policy = preview_problem(lasting, index, steps)
    x_ref, u_ref = along.x_ref[index], along.u_ref[index]
    return LimitedPreview(along, index, x_ref, u_ref, lasting.problem, window, policy)
