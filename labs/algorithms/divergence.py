"""What to say when a sampled control loop has diverged: why, and what to change.

The cause is the first of continuous, sampled and simulated loop that explains the growth
(`sampled_stability`). What to change is searched for among what the user can set. A change is
proposed only if the linearised, simulated loop is stable with it, and with a margin: also with
k_p and k_i, or k_d, or all of them, MARGIN times larger and smaller, at every posture given. Where
a gain may take any value of a range, both ends of the range are named.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from labs.algorithms.integrators import INTEGRATORS
from labs.algorithms.joint_control import Gains
from labs.reactive_control.joint_control.sampled_stability import (
    GROWS,
    Diagnosis,
    LinearLoop,
    Setting,
)

BISECTIONS = 6
MOST_REMEDIES = 2
MARGIN = 1.25
"""Factor by which the gains may be off, and what is proposed still be stable."""
FASTER_ALONE = 1.0
"""[1/s] by which the robot without control may grow faster than it would, integrated exactly."""
LARGEST_SAG = 0.3
"""[rad] The linearised loop tells about the robot only where it comes to rest nearby."""
SMALLEST = 0.01
"""The least k_p or k_d that is tried besides 0, and the least share of k_i."""
FINENESS = 1.2
"""At most the ratio of one gain tried and the next."""


@dataclass(frozen=True)
class Menu:
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
    settings: tuple[Setting, ...]
    """The loop with it; where the text names a range, at both of its ends."""


def explain(loops: Sequence[LinearLoop], setting: Setting, menu: Menu) -> str:
    """Why the loop diverged near its reference, and what to change, in some sentences. `loops`
    are at postures of the reference, the present one first."""
    diagnosis = loops[0].diagnose(setting)
    advice = " or ".join(remedy.text for remedy in remedies(loops, setting, menu))
    return " ".join(filter(None, (_why(setting, diagnosis), _sentence(advice, diagnosis))))


def remedies(loops: Sequence[LinearLoop], setting: Setting, menu: Menu) -> list[Remedy]:
    """What `explain` proposes: stable near the reference with a margin, the one that goes to the
    root first."""
    searches = {
        "gains": (_less_integral, _other_damping, _other_stiffness, _feedback),
        "period": (_shorter_period, _other_damping, _other_stiffness),
        "integrator": (_other_integrator, _shorter_step, _other_damping, _other_stiffness),
    }.get(loops[0].diagnose(setting).fault, ())
    found: list[Remedy] = []
    for search in searches:
        found += search(loops, setting, menu)
    if searches and not found:
        found += _other_gains(loops, setting, menu)
    return found[:MOST_REMEDIES]


def stable(loops: Sequence[LinearLoop], setting: Setting) -> bool:
    """Whether the simulated loop rests near all postures and is stable there with all gains
    MARGIN off, and the integrator does not blow up the robot alone, which is what is left of the
    loop while a motor gives all it can."""
    alone = replace(setting, controller="open-loop")
    factors = [(1.0, 1.0), *product((MARGIN, 1.0 / MARGIN), repeat=2)]
    nearby = [replace(setting, gains=_scaled(setting.gains, *each)) for each in factors]
    return (
        all(loop.growth(near) <= GROWS for near in nearby for loop in loops)
        and all(loop.sag(setting) <= LARGEST_SAG for loop in loops)
        and all(loop.growth(alone) <= loop.poles(alone).real.max() + FASTER_ALONE for loop in loops)
    )


def _why(setting: Setting, diagnosis: Diagnosis) -> str:
    period, step = _time(setting.period), _time(setting.step)
    method = INTEGRATORS[setting.integrator].title
    simulated = f"grows as exp({diagnosis.simulated:.3g} t)"
    match diagnosis.fault:
        case "gains" if setting.controller == "open-loop":
            return f"Nothing feeds the error back, and near the reference it {simulated}."
        case "gains":
            return (
                "The gains are at fault: even with continuous control the error "
                f"grows as exp({diagnosis.continuous:.3g} t)."
            )
        case "period":
            return (
                f"The control period is at fault: with continuous control the error would "
                f"{_would_grow(diagnosis.continuous)}, but with the torque held for {period} it "
                f"grows as exp({diagnosis.sampled:.3g} t)."
            )
        case "integrator":
            return (
                f"The integrator and its step are at fault: {method} with {step} makes an error "
                f"that {simulated}; integrated exactly it would "
                f"{_would_grow(diagnosis.sampled)}."
            )
        case _:
            return (
                "Near the reference this loop is stable, so the motion was driven out of its "
                "neighbourhood: by a large error, a force or torques at their limit."
            )


def _would_grow(rate: float) -> str:
    return f"grow as exp({rate:.3g} t)" if rate > GROWS else "not grow"


def _sentence(advice: str, diagnosis: Diagnosis) -> str:
    if advice:
        return f"Try {advice}."
    return "No stable setting was found near this one." if diagnosis.fault else ""


def _shorter_period(loops: Sequence[LinearLoop], setting: Setting, menu: Menu) -> Iterator[Remedy]:
    """The longest shorter control period that is stable."""
    for period in sorted((p for p in menu.periods if p < setting.control_period), reverse=True):
        change = replace(setting, control_period=period)
        if change.period < setting.period and stable(loops, change):
            yield Remedy(f"a control period of {_time(period)}", (change,))
            return


def _shorter_step(loops: Sequence[LinearLoop], setting: Setting, menu: Menu) -> Iterator[Remedy]:
    """The longest shorter step that is stable."""
    for step in sorted((h for h in menu.steps if h < setting.step), reverse=True):
        change = replace(setting, step=step)
        if stable(loops, change):
            yield Remedy(f"a step of {_time(step)}", (change,))
            return


def _other_integrator(
    loops: Sequence[LinearLoop], setting: Setting, menu: Menu
) -> Iterator[Remedy]:
    """The cheapest other integrator that is stable with this step."""
    for name in ("semi-implicit-euler", "midpoint", "rk4"):
        change = replace(setting, integrator=name)
        if name != setting.integrator and stable(loops, change):
            yield Remedy(f"the integrator {INTEGRATORS[name].title}", (change,))
            return


def _other_damping(loops: Sequence[LinearLoop], setting: Setting, menu: Menu) -> Iterator[Remedy]:
    """The stable range of k_d nearest to the present one."""
    return _nearest_range(loops, setting, "kd", menu.highest_kd)


def _other_stiffness(loops: Sequence[LinearLoop], setting: Setting, menu: Menu) -> Iterator[Remedy]:
    """The stable range of k_p nearest to the present one."""
    return _nearest_range(loops, setting, "kp", menu.highest_kp)


def _less_integral(loops: Sequence[LinearLoop], setting: Setting, menu: Menu) -> Iterator[Remedy]:
    """The smallest stable k_i, and all up to the first that is not."""
    ki = setting.gains.ki
    if setting.controller == "pid" and ki > 0.0:
        tried = np.concatenate([[0.0], _between(SMALLEST * ki, ki)])
        yield from _first_range(loops, setting, "ki", tried, range(len(tried)))


def _feedback(loops: Sequence[LinearLoop], setting: Setting, menu: Menu) -> Iterator[Remedy]:
    """PD with gravity compensation instead of no feedback at all."""
    change = replace(setting, controller="pd-gravity")
    if setting.controller == "open-loop" and stable(loops, change):
        yield Remedy("a controller with feedback, such as PD with gravity compensation", (change,))


def _other_gains(loops: Sequence[LinearLoop], setting: Setting, menu: Menu) -> Iterator[Remedy]:
    """k_p and k_d together, the stable pair nearest to the present one; without k_i where that
    is needed, and with gravity compensation where there was no feedback."""
    base, prefix = setting, ""
    if setting.controller == "open-loop":
        base, prefix = replace(setting, controller="pd-gravity"), "PD with gravity compensation, "
    here = np.log(np.maximum([base.gains.kp, base.gains.kd], SMALLEST))
    pairs = list(product(_round_numbers(menu.highest_kp), _round_numbers(menu.highest_kd)))
    pairs.sort(key=lambda pair: float(np.linalg.norm(np.log(pair) - here)))
    with_integral = base.controller == "pid" and base.gains.ki > 0.0
    for kp, kd in pairs:
        for ki in (base.gains.ki, 0.0) if with_integral else (base.gains.ki,):
            change = replace(base, gains=Gains(kp, ki, kd))
            if stable(loops, change):
                text = f"{prefix}k_p = {kp:g} with k_d = {kd:g}"
                yield Remedy(f"{text} and k_i = 0" if with_integral and not ki else text, (change,))
                return


def _nearest_range(
    loops: Sequence[LinearLoop], setting: Setting, gain: str, highest: float
) -> Iterator[Remedy]:
    """Of a gain from 0 to `highest`: the stable range nearest to the present value."""
    if setting.controller != "open-loop":
        tried = np.concatenate([[0.0], _between(SMALLEST, highest)])
        here = max(getattr(setting.gains, gain), SMALLEST)
        distances = np.abs(np.log(np.maximum(tried, SMALLEST) / here))
        yield from _first_range(loops, setting, gain, tried, np.argsort(distances, kind="stable"))


def _first_range(
    loops: Sequence[LinearLoop],
    setting: Setting,
    gain: str,
    tried: np.ndarray,
    order: Iterable[int],
) -> Iterator[Remedy]:
    """The stable range of a gain that contains the first stable one of `tried` (k,), taken in
    this order. Its ends are found by bisection and rounded inward to two digits; they and every
    value of `tried` between are stable."""

    def changed(value: float) -> Setting:
        return replace(setting, gains=replace(setting.gains, **{gain: float(value)}))

    def good(value: float) -> bool:
        return stable(loops, changed(value))

    first = last = next((k for k in order if good(tried[k])), -1)
    if first < 0:
        return
    while first > 0 and good(tried[first - 1]):
        first -= 1
    while last < len(tried) - 1 and good(tried[last + 1]):
        last += 1
    low, high = float(tried[first]), float(tried[last])
    if first > 0:
        low = _rounded(_edge(good, low, tried[first - 1]), up=True)
    if last < len(tried) - 1:
        high = _rounded(_edge(good, high, tried[last + 1]), up=False)
    if low <= high and good(low) and good(high):
        words = f"from {low:g} to {high:g}"
        if low == high:
            words = f"= {low:g}"
        elif last == len(tried) - 1:
            words = f"of at least {low:g}"
        elif first == 0:
            words = f"of at most {high:g}"
        yield Remedy(f"k_{gain[1]} {words}", (changed(low), changed(high)))


def _edge(good: Callable[[float], bool], inside: float, outside: float) -> float:
    """The last good value found on the way from one that is to one that is not."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if good(middle) else (inside, middle)
    return inside


def _between(low: float, high: float) -> np.ndarray:
    """(k,) from low to high, each at most FINENESS times the one before."""
    return np.geomspace(low, high, int(np.ceil(np.log(high / low) / np.log(FINENESS))) + 1)


def _round_numbers(highest: float) -> list[float]:
    """1, 2 and 5 times powers of ten, from SMALLEST to `highest`."""
    decades = range(int(np.floor(np.log10(SMALLEST))), int(np.log10(highest)) + 1)
    numbers = [float(f"{digit}e{decade}") for decade in decades for digit in (1, 2, 5)]
    return [number for number in numbers if SMALLEST <= number <= highest]


def _scaled(gains: Gains, stiffness: float, damping: float) -> Gains:
    return Gains(stiffness * gains.kp, stiffness * gains.ki, damping * gains.kd)


def _rounded(value: float, *, up: bool) -> float:
    """To two significant digits, upward or downward."""
    if value <= 0.0:
        return 0.0
    rounded = float(f"{value:.1e}")
    if (rounded < value) == up and rounded != value:
        exponent = int(f"{value:e}".partition("e")[2])
        rounded += (1 if up else -1) * 10.0 ** (exponent - 1)
    return float(f"{rounded:.1e}")


def _time(seconds: float) -> str:
    return f"{1000 * seconds:g} ms"
