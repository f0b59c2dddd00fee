"""Reference motions for the joints: q_ref(t) with its two derivatives (notes, 1.2).

All three move every joint by the same angle s(phi) from a home posture q0,

    q_ref = q0 + s(phi) 1,   phi(t) = phi(0) + rate t   [cycles],

so that a change of rate changes the speed but never makes q_ref jump: whoever runs the motion
keeps phi. A change of amplitude does move q_ref at once. Derivatives are in time, at constant
rate: v_ref = rate ds/dphi 1, a_ref = rate^2 d2s/dphi2 1.
"""

from collections.abc import Callable, Mapping

import numpy as np

Profile = Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""(phases (m,) [cycles], amplitude [rad]) to s, ds/dphi, d2s/dphi2, each (m,)."""

MOVE_SHARE = 1.0 / 3.0
"""Share of a minimum-jerk cycle taken by each of its two moves; a rest of half a move's
duration follows each, so one cycle lasts three moves."""


def set_point(phase: np.ndarray, amplitude: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """s = A for ever."""
    still = np.zeros_like(phase)
    return still + amplitude, still, still


def sinusoid(phase: np.ndarray, amplitude: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """s = A sin(2 pi phi)."""
    turn = 2.0 * np.pi
    sine = amplitude * np.sin(turn * phase)
    return sine, turn * amplitude * np.cos(turn * phase), -(turn**2) * sine


def minimum_jerk(phase: np.ndarray, amplitude: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """From 0 to A and back with rests, each move of the least integral of squared jerk among
    those that start and end at rest:

        s = A (10 r^3 - 15 r^4 + 6 r^5),   r in [0, 1] the share of the move done

    (Flash and Hogan, 1985)."""
    cycle = phase % 1.0
    back = cycle >= 0.5
    r = np.minimum((cycle - 0.5 * back) / MOVE_SHARE, 1.0)
    sign = np.where(back, -amplitude, amplitude)
    s = back * amplitude + sign * r**3 * (10.0 + r * (6.0 * r - 15.0))
    ds = sign / MOVE_SHARE * 30.0 * (r * (1.0 - r)) ** 2
    dds = sign / MOVE_SHARE**2 * 60.0 * r * (1.0 - r) * (1.0 - 2.0 * r)
    return s, ds, dds


PROFILES: Mapping[str, Profile] = {
    "set-point": set_point,
    "sinusoid": sinusoid,
    "minimum-jerk": minimum_jerk,
}


def cycles_per_second(name: str, frequency: float, duration: float) -> float:
    """The rate of phi [1/s]: `frequency` [Hz] of the sinusoid, or as many cycles as fit when
    each minimum-jerk move lasts `duration` [s]. A set point does not move."""
    return {
        "set-point": 0.0,
        "sinusoid": frequency,
        "minimum-jerk": MOVE_SHARE / duration,
    }[name]


def reference_motion(
    name: str, home: np.ndarray, amplitude: float, rate: float, phase: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q_ref [rad], v_ref [rad/s], a_ref [rad/s^2], each (m, nv), at phases (m,) [cycles] that
    advance at `rate` [1/s]."""
    s, ds, dds = PROFILES[name](phase, amplitude)
    q_ref, v_ref, a_ref = np.empty((3, len(phase), len(home)))
    np.add(home, s[:, None], out=q_ref)
    v_ref[:] = (rate * ds)[:, None]
    a_ref[:] = (rate**2 * dds)[:, None]
    return q_ref, v_ref, a_ref
