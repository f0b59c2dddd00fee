"""Tracking along a lap, all there is to know: the problem in deviations, its policy for ever, and
the view that a policy of limited preview has of it (notes, 2.4.3 to 2.4.5)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from labs.algorithms.periodic_lqr import Periodic, periodic, preview
from labs.models.mechanisms import mechanism
from labs.optimal_control.lqr_tracking.laps import Course, Lap, lap
from labs.problems.linear_quadratic import LqrPolicy, LqrProblem

CHOSEN = {"ur5": 1, "cart-pole": 0}
"""The joint that has linear costs, and its motor: the shoulder, the cart."""


@dataclass(frozen=True)
class Setting:
    """All that the policies are made from."""

    course: Course
    feed_forward: str
    """One of `laps.FEED_FORWARDS`."""
    force: float
    """[N] along the world's y axis, that is known."""
    weights: tuple[float, float, float]
    """Of positions, of velocities, of the controls as shares of what the motors can give."""
    linear: tuple[float, float]
    """q of the joint [1/rad; 1/m] and s of the motor in CHOSEN, as a share like its weight."""


@dataclass(frozen=True, eq=False)
class View:
    """What holds at one step of the lap, with some steps of it in view."""

    lap: Lap
    index: int
    """The step."""
    x_ref: np.ndarray
    """(nx,)."""
    u_ref: np.ndarray
    """(nu,)."""
    lasting: LqrProblem
    """Of the whole lap."""
    window: LqrProblem
    """Of the steps in view, in deviations from the reference."""
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
        terms = {name: term[0] for name, term in self.lasting.terms.items()}
        squares = dx @ terms["q"] @ dx + du @ terms["r"] @ du
        return float(squares + 2.0 * (terms["q_linear"] @ dx + terms["s_linear"] @ du))


def lap_of(setting: Setting) -> Lap:
    """The reference and the linear system along it."""
    return lap(setting.course, setting.feed_forward, setting.force)


@lru_cache(maxsize=64)
def known(setting: Setting) -> Periodic:
    """The policy of somebody who has all of the future in view, and its cost. Raises LabError as
    `laps.lap` and `periodic` do."""
    along = lap_of(setting)
    nq, limit = along.x_ref.shape[1] // 2, mechanism(setting.course.robot).control_limit
    of_q, of_v, of_u = setting.weights
    q_linear, s_linear = np.zeros(2 * nq), np.zeros(len(limit))
    q_linear[CHOSEN[setting.course.robot]] = setting.linear[0]
    s_linear[CHOSEN[setting.course.robot]] = setting.linear[1]
    weight = np.diag(np.repeat([of_q, of_v], nq))
    return periodic(
        LqrProblem(
            horizon=len(along.a),
            a=along.a,
            b=along.b,
            q=weight,
            r=np.diag(of_u / limit**2),
            q_final=weight,
            c=along.c,
            q_linear=q_linear,
            s_linear=s_linear / limit,
        )
    )


@lru_cache(maxsize=16)
def view(setting: Setting, index: int, steps: int) -> View:
    """From step `index` of the lap, with `steps` in view. Raises LabError as `known` does."""
    along, lasting = lap_of(setting), known(setting)
    window, policy = preview(lasting, index, steps)
    x_ref, u_ref = along.x_ref[index], along.u_ref[index]
    return View(along, index, x_ref, u_ref, lasting.problem, window, policy)
