"""What to say when a sampled control loop has diverged: why, and what to change.

The cause is the first of continuous, sampled and simulated loop that explains the growth
(`sampled_stability`). What to change is searched for among what the user can set: a change is
proposed only if the linearised, simulated loop is stable with it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import sqrt

from labs.algorithms.integrators import INTEGRATORS
from labs.reactive_control.joint_control.sampled_control import UNIT, time_between_ticks, units
from labs.reactive_control.joint_control.sampled_stability import (
    GROWS,
    Diagnosis,
    LinearLoop,
    Setting,
)

BISECTIONS = 12
MOST_REMEDIES = 2


@dataclass(frozen=True)
class Menu:
    """What the user can choose from."""

    periods: Sequence[float]
    """Control periods [s]."""
    steps: Sequence[float]
    """Integration steps [s]."""
    highest_kd: float


def explain(loop: LinearLoop, setting: Setting, menu: Menu) -> str:
    """Two sentences: why the loop diverged near its reference, and what to change."""
    diagnosis = loop.diagnose(setting)
    remedies = [text for text, _ in _remedies(loop, setting, menu, diagnosis.fault)]
    advice = " or ".join(remedies[:MOST_REMEDIES])
    return f"{_why(setting, diagnosis)} {_sentence(advice)}"


def remedies(loop: LinearLoop, setting: Setting, menu: Menu) -> list[Setting]:
    """The settings `explain` proposes, each stable near the reference."""
    fault = loop.diagnose(setting).fault
    return [change for _, change in _remedies(loop, setting, menu, fault)][:MOST_REMEDIES]


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


def _sentence(advice: str) -> str:
    return f"Try {advice}." if advice else "Try smaller gains, a smaller error or less force."


def _remedies(
    loop: LinearLoop, setting: Setting, menu: Menu, fault: str
) -> Iterator[tuple[str, Setting]]:
    """Stable changes, the one that goes to the root first."""
    searches = {
        "gains": (_less_integral, _other_damping, _feedback),
        "period": (_shorter_period, _other_damping),
        "integrator": (_other_integrator, _shorter_step, _other_damping),
    }.get(fault, ())
    for search in searches:
        yield from search(loop, setting, menu)


def _stable(loop: LinearLoop, setting: Setting) -> bool:
    return loop.growth(setting) <= GROWS


def _shorter_period(
    loop: LinearLoop, setting: Setting, menu: Menu
) -> Iterator[tuple[str, Setting]]:
    """The longest shorter control period that is stable."""
    step = units(setting.step)
    shorter = {time_between_ticks(units(p), step) * UNIT for p in menu.periods}
    for period in sorted(p for p in shorter if p < setting.period)[::-1]:
        change = replace(setting, period=period)
        if _stable(loop, change):
            yield f"a control period of {_time(period)}", change
            return


def _shorter_step(loop: LinearLoop, setting: Setting, menu: Menu) -> Iterator[tuple[str, Setting]]:
    """The longest shorter step that is stable and divides the control period."""
    for step in sorted(h for h in menu.steps if h < setting.step)[::-1]:
        change = replace(setting, step=step)
        if units(setting.period) % units(step) == 0 and _stable(loop, change):
            yield f"a step of {_time(step)}", change
            return


def _other_integrator(
    loop: LinearLoop, setting: Setting, menu: Menu
) -> Iterator[tuple[str, Setting]]:
    """The cheapest other integrator that is stable with this step."""
    for name in ("semi-implicit-euler", "midpoint", "rk4"):
        change = replace(setting, integrator=name)
        if name != setting.integrator and _stable(loop, change):
            yield f"the integrator {INTEGRATORS[name].title}", change
            return


def _other_damping(loop: LinearLoop, setting: Setting, menu: Menu) -> Iterator[tuple[str, Setting]]:
    """The k_d nearest to the present one that is stable: looked for downward, then upward, by
    factors of two, then by bisection, and rounded to the stable side."""
    here = setting.gains.kd
    downward = [here / 2**k for k in range(1, 9)]
    upward = [kd for k in range(12) if (kd := max(2 * here, 0.05) * 2**k) <= menu.highest_kd]
    for candidates, word in ((downward, "at most"), (upward, "at least")):
        stable = next((kd for kd in candidates if _stable(loop, _damped(setting, kd))), None)
        if stable is None or stable == here:
            continue
        unstable = min(2 * stable, here) if word == "at most" else max(stable / 2, here)
        for _ in range(BISECTIONS):
            middle = sqrt(stable * max(unstable, 1e-3))
            if _stable(loop, _damped(setting, middle)):
                stable = middle
            else:
                unstable = middle
        kd = _rounded(stable, up=word == "at least")
        yield f"k_d of {word} {kd:g}", _damped(setting, kd)
        return


def _less_integral(loop: LinearLoop, setting: Setting, menu: Menu) -> Iterator[tuple[str, Setting]]:
    """The largest stable k_i below the present one."""
    stable, unstable = 0.0, setting.gains.ki
    if setting.controller != "pid" or not _stable(loop, _integrating(setting, 0.0)):
        return
    for _ in range(BISECTIONS):
        middle = 0.5 * (stable + unstable)
        if _stable(loop, _integrating(setting, middle)):
            stable = middle
        else:
            unstable = middle
    ki = _rounded(stable, up=False)
    yield f"k_i of at most {ki:g}", _integrating(setting, ki)


def _feedback(loop: LinearLoop, setting: Setting, menu: Menu) -> Iterator[tuple[str, Setting]]:
    """PD with gravity compensation instead of no feedback at all."""
    change = replace(setting, controller="pd-gravity")
    if setting.controller == "open-loop" and _stable(loop, change):
        yield "a controller with feedback, such as PD with gravity compensation", change


def _damped(setting: Setting, kd: float) -> Setting:
    return replace(setting, gains=replace(setting.gains, kd=kd))


def _integrating(setting: Setting, ki: float) -> Setting:
    return replace(setting, gains=replace(setting.gains, ki=ki))


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
