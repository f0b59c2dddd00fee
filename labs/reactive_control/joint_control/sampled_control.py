"""A robot under a controller that samples: the torque is held between two looks at the state.

At a control tick the law sees the (noisy) state and sets the torque, cut to what the motors can
give,

    tau = min(max(law(q + n_q, v + n_v, z, q_ref, v_ref, a_ref), -tau_max), tau_max),

then integration steps of length h follow until the next tick (zero-order hold). The integral of
the error is the controller's own sum, z+ = z + T e with T the time between ticks.

Time is counted in units of 0.1 ms, as integers, so it never drifts.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from labs.algorithms.integrators import Acceleration, IntegratorStep
from labs.algorithms.joint_control import ControlLaw

TIME_UNIT = 1e-4
"""[s] the unit of time counted here."""


def to_time_units(seconds: float) -> int:
    """This many seconds as a whole number of units."""
    return round(seconds / TIME_UNIT)


def format_milliseconds(seconds: float) -> str:
    """A time [s] in words: "2 ms"."""
    return f"{1000 * seconds:g} ms"


def time_between_ticks(period: int, step: int) -> int:
    """`period` rounded up to whole integration steps: a tick falls on the first step at or
    after its time."""
    return -(-period // step) * step


@lru_cache(maxsize=256)
def control_ticks(since: int, period: int, step: int, steps: int) -> tuple[tuple[int, ...], int]:
    """Which of the next `steps` integration steps begin with a control tick, when the last tick
    was `since` units ago; and how long ago the last one is at the end."""
    due = []
    for k in range(steps):
        if since >= period:
            due.append(k)
            since = 0
        since += step
    return tuple(due), since


@dataclass(frozen=True)
class SampledLoop:
    """What does not change during one stretch of time."""

    law: ControlLaw
    limit: np.ndarray
    """(nv,) [N m]; infinite where nothing limits."""
    acceleration: Acceleration
    """Reads the torque in `held`."""
    held: np.ndarray
    """(nv,) [N m] the torque now; written at every tick."""
    integrate: IntegratorStep
    h: float
    """[s] length of an integration step."""
    integral_gain: float
    """[s] T while the law uses the integral of the error, else 0."""


def simulate_sampled(
    loop: SampledLoop,
    due: tuple[int, ...],
    steps: int,
    reference: tuple[np.ndarray, np.ndarray, np.ndarray],
    noise: np.ndarray | None,
    q: np.ndarray,
    v: np.ndarray,
    z: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Advances (q, v, z) by `steps` integration steps. `reference` holds q_ref, v_ref, a_ref,
    each (m or more, nv), row j for the j-th tick of `due`; `noise` is (m, 2, nv), added to the
    measured q and v. Returns q, v, z and the torques (m, nv) set at the ticks.

    A loop that diverges runs on to infinity or NaN; look at what comes back."""
    law, limit, integrate = loop.law, loop.limit, loop.integrate
    h = np.full(len(q), loop.h)
    acceleration, held, gain = loop.acceleration, loop.held, loop.integral_gain
    floor, minimum, maximum = -limit, np.minimum, np.maximum
    q_ref, v_ref, a_ref = reference
    torques = np.empty((len(due), len(q)))
    ends = (*due, steps)
    for _ in range(ends[0]):
        q, v = integrate(acceleration, q, v, h)
    for j, (start, end) in enumerate(pairwise(ends)):
        seen_q, seen_v = (q, v) if noise is None else (q + noise[j, 0], v + noise[j, 1])
        tau = law(seen_q, seen_v, z, q_ref[j], v_ref[j], a_ref[j])
        minimum(maximum(tau, floor), limit, out=held)
        torques[j] = held
        if gain:
            z = z + gain * (q_ref[j] - seen_q)
        for _ in range(end - start):
            q, v = integrate(acceleration, q, v, h)
    return q, v, z, torques
