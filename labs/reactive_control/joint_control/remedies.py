"""What makes a diverging sampled loop stable, searched for among what the user can set.

A change is proposed only if the linearised, simulated loop is stable with it, and with a margin:
also with k_p and k_i, or k_d, or all of them, GAIN_MARGIN times larger and smaller, at every
posture given. Where a gain may take any value of a range, both ends of the range are named.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from labs.algorithms.integrators import INTEGRATORS
from labs.algorithms.joint_control import Gains
from labs.reactive_control.joint_control.sampled_control import format_milliseconds
from labs.reactive_control.joint_control.sampled_stability import (
    GROWTH_TOLERANCE,
    LinearLoop,
    LoopParameters,
)

BISECTIONS = 6
MAX_REMEDIES = 2
GAIN_MARGIN = 1.25
"""Factor by which the gains may be off, and what is proposed still be stable."""
OPEN_LOOP_GROWTH_MARGIN = 1.0
"""[1/s] by which the robot without control may grow faster than it would, integrated exactly."""
MAX_STATIC_DEVIATION = 0.3
"""[rad] The linearised loop tells about the robot only where it comes to rest nearby."""
SMALLEST_GAIN = 0.01
"""The least k_p or k_d that is tried besides 0, and the least share of k_i."""
GAIN_RATIO = 1.2
"""At most the ratio of one gain tried and the next."""


@dataclass(frozen=True)
class AvailableSettings:
    """What the user can choose from."""

    periods: Sequence[float]
    """Control periods [s]."""
    steps: Sequence[float]
    """Integration steps [s]."""
    highest_kp: float
    highest_kd: float


@dataclass(frozen=True)
class Remedy:
    """A change that makes the loop stable near its reference, as it is worded."""

    text: str
    settings: tuple[LoopParameters, ...]
    """The loop with it; where the text names a range, at both of its ends."""


def find_remedies(
    loops: Sequence[LinearLoop], settings: LoopParameters, available: AvailableSettings
) -> list[Remedy]:
    """What helps: stable near the reference with a margin, the one that goes to the
    root first."""
    searches = {
        "gains": (_smaller_integral_gain, _other_damping, _other_stiffness, _add_feedback),
        "period": (_shorter_period, _other_damping, _other_stiffness),
        "integrator": (_other_integrator, _shorter_step, _other_damping, _other_stiffness),
    }.get(loops[0].diagnose(settings).fault, ())
    found: list[Remedy] = []
    for search in searches:
        found += search(loops, settings, available)
    if searches and not found:
        found += _other_gains(loops, settings, available)
    return found[:MAX_REMEDIES]


def robustly_stable(loops: Sequence[LinearLoop], settings: LoopParameters) -> bool:
    """Whether the simulated loop rests near all postures and is stable there with all gains
    GAIN_MARGIN off, and the integrator does not blow up the robot alone, which is what is left of
    the loop while a motor gives all it can."""
    alone = replace(settings, controller="open-loop")
    factors = [(1.0, 1.0), *product((GAIN_MARGIN, 1.0 / GAIN_MARGIN), repeat=2)]
    nearby = [replace(settings, gains=_scale_gains(settings.gains, *each)) for each in factors]
    return (
        all(loop.growth_rate(near) <= GROWTH_TOLERANCE for near in nearby for loop in loops)
        and all(loop.static_deviation(settings) <= MAX_STATIC_DEVIATION for loop in loops)
        and all(
            loop.growth_rate(alone) <= loop.poles(alone).real.max() + OPEN_LOOP_GROWTH_MARGIN
            for loop in loops
        )
    )


def _shorter_period(
    loops: Sequence[LinearLoop], settings: LoopParameters, available: AvailableSettings
) -> Iterator[Remedy]:
    """The longest shorter control period that is stable."""
    for period in sorted(
        (p for p in available.periods if p < settings.control_period), reverse=True
    ):
        change = replace(settings, control_period=period)
        if change.period < settings.period and robustly_stable(loops, change):
            yield Remedy(f"a control period of {format_milliseconds(period)}", (change,))
            return


def _shorter_step(
    loops: Sequence[LinearLoop], settings: LoopParameters, available: AvailableSettings
) -> Iterator[Remedy]:
    """The longest shorter step that is stable."""
    for step in sorted((h for h in available.steps if h < settings.step), reverse=True):
        change = replace(settings, step=step)
        if robustly_stable(loops, change):
            yield Remedy(f"a step of {format_milliseconds(step)}", (change,))
            return


def _other_integrator(
    loops: Sequence[LinearLoop], settings: LoopParameters, available: AvailableSettings
) -> Iterator[Remedy]:
    """The cheapest other integrator that is stable with this step."""
    for name in ("semi-implicit-euler", "midpoint", "rk4"):
        change = replace(settings, integrator=name)
        if name != settings.integrator and robustly_stable(loops, change):
            yield Remedy(f"the integrator {INTEGRATORS[name].title}", (change,))
            return


def _other_damping(
    loops: Sequence[LinearLoop], settings: LoopParameters, available: AvailableSettings
) -> Iterator[Remedy]:
    """The stable range of k_d nearest to the present one."""
    return _nearest_stable_range(loops, settings, "kd", available.highest_kd)


def _other_stiffness(
    loops: Sequence[LinearLoop], settings: LoopParameters, available: AvailableSettings
) -> Iterator[Remedy]:
    """The stable range of k_p nearest to the present one."""
    return _nearest_stable_range(loops, settings, "kp", available.highest_kp)


def _smaller_integral_gain(
    loops: Sequence[LinearLoop], settings: LoopParameters, available: AvailableSettings
) -> Iterator[Remedy]:
    """The smallest stable k_i, and all up to the first that is not."""
    ki = settings.gains.ki
    if settings.controller == "pid" and ki > 0.0:
        tried = np.concatenate([[0.0], _gain_grid(SMALLEST_GAIN * ki, ki)])
        yield from _stable_range(loops, settings, "ki", tried, range(len(tried)))


def _add_feedback(
    loops: Sequence[LinearLoop], settings: LoopParameters, available: AvailableSettings
) -> Iterator[Remedy]:
    """PD with gravity compensation instead of no feedback at all."""
    change = replace(settings, controller="pd-gravity")
    if settings.controller == "open-loop" and robustly_stable(loops, change):
        yield Remedy("a controller with feedback, such as PD with gravity compensation", (change,))


def _other_gains(
    loops: Sequence[LinearLoop], settings: LoopParameters, available: AvailableSettings
) -> Iterator[Remedy]:
    """k_p and k_d together, the stable pair nearest to the present one; without k_i where that
    is needed, and with gravity compensation where there was no feedback."""
    base, prefix = settings, ""
    if settings.controller == "open-loop":
        base, prefix = replace(settings, controller="pd-gravity"), "PD with gravity compensation, "
    here = np.log(np.maximum([base.gains.kp, base.gains.kd], SMALLEST_GAIN))
    pairs = list(
        product(_round_numbers(available.highest_kp), _round_numbers(available.highest_kd))
    )
    pairs.sort(key=lambda pair: float(np.linalg.norm(np.log(pair) - here)))
    with_integral = base.controller == "pid" and base.gains.ki > 0.0
    for kp, kd in pairs:
        for ki in (base.gains.ki, 0.0) if with_integral else (base.gains.ki,):
            change = replace(base, gains=Gains(kp, ki, kd))
            if robustly_stable(loops, change):
                text = f"{prefix}k_p = {kp:g} with k_d = {kd:g}"
                yield Remedy(f"{text} and k_i = 0" if with_integral and not ki else text, (change,))
                return


def _nearest_stable_range(
    loops: Sequence[LinearLoop], settings: LoopParameters, gain: str, highest: float
) -> Iterator[Remedy]:
    """Of a gain from 0 to `highest`: the stable range nearest to the present value."""
    if settings.controller != "open-loop":
        tried = np.concatenate([[0.0], _gain_grid(SMALLEST_GAIN, highest)])
        here = max(getattr(settings.gains, gain), SMALLEST_GAIN)
        distances = np.abs(np.log(np.maximum(tried, SMALLEST_GAIN) / here))
        yield from _stable_range(loops, settings, gain, tried, np.argsort(distances, kind="stable"))


def _stable_range(
    loops: Sequence[LinearLoop],
    settings: LoopParameters,
    gain: str,
    tried: np.ndarray,
    order: Iterable[int],
) -> Iterator[Remedy]:
    """The stable range of a gain that contains the first stable one of `tried` (k,), taken in
    this order. Its ends are found by bisection and rounded inward to two digits; they and every
    value of `tried` between are stable."""

    def changed(value: float) -> LoopParameters:
        return replace(settings, gains=replace(settings.gains, **{gain: float(value)}))

    def accepted(value: float) -> bool:
        return robustly_stable(loops, changed(value))

    first = last = next((k for k in order if accepted(tried[k])), -1)
    if first < 0:
        return
    while first > 0 and accepted(tried[first - 1]):
        first -= 1
    while last < len(tried) - 1 and accepted(tried[last + 1]):
        last += 1
    low, high = float(tried[first]), float(tried[last])
    if first > 0:
        low = _round_to_two_digits(_bisect_limit(accepted, low, tried[first - 1]), up=True)
    if last < len(tried) - 1:
        high = _round_to_two_digits(_bisect_limit(accepted, high, tried[last + 1]), up=False)
    if low <= high and accepted(low) and accepted(high):
        words = f"from {low:g} to {high:g}"
        if low == high:
            words = f"= {low:g}"
        elif last == len(tried) - 1:
            words = f"of at least {low:g}"
        elif first == 0:
            words = f"of at most {high:g}"
        yield Remedy(f"k_{gain[1]} {words}", (changed(low), changed(high)))


def _bisect_limit(accepted: Callable[[float], bool], inside: float, outside: float) -> float:
    """The last accepted value on the way from one that is to one that is not."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if accepted(middle) else (inside, middle)
    return inside


def _gain_grid(low: float, high: float) -> np.ndarray:
    """(k,) from low to high, each at most GAIN_RATIO times the one before."""
    return np.geomspace(low, high, int(np.ceil(np.log(high / low) / np.log(GAIN_RATIO))) + 1)


def _round_numbers(highest: float) -> list[float]:
    """1, 2 and 5 times powers of ten, from SMALLEST_GAIN to `highest`."""
    decades = range(int(np.floor(np.log10(SMALLEST_GAIN))), int(np.log10(highest)) + 1)
    numbers = [float(f"{digit}e{decade}") for decade in decades for digit in (1, 2, 5)]
    return [number for number in numbers if SMALLEST_GAIN <= number <= highest]


def _scale_gains(gains: Gains, stiffness: float, damping: float) -> Gains:
    return Gains(stiffness * gains.kp, stiffness * gains.ki, damping * gains.kd)


def _round_to_two_digits(value: float, *, up: bool) -> float:
    """To two significant digits, upward or downward."""
    if value <= 0.0:
        return 0.0
    rounded = float(f"{value:.1e}")
    if (rounded < value) == up and rounded != value:
        exponent = int(f"{value:e}".partition("e")[2])
        rounded += (1 if up else -1) * 10.0 ** (exponent - 1)
    return float(f"{rounded:.1e}")
