"""What to say when a sampled control loop has diverged: why, and what to change.

The cause is the first of continuous, sampled and simulated loop that explains the growth
(`sampled_stability`); what to change, `remedies` searches for.
"""

from collections.abc import Sequence

from labs.algorithms.integrators import INTEGRATORS
from labs.reactive_control.joint_control.remedies import AvailableSettings, find_remedies
from labs.reactive_control.joint_control.sampled_control import format_milliseconds
from labs.reactive_control.joint_control.sampled_stability import (
    GROWTH_TOLERANCE,
    Diagnosis,
    LinearLoop,
    LoopParameters,
)


def divergence_message(
    loops: Sequence[LinearLoop], settings: LoopParameters, available: AvailableSettings
) -> str:
    """Why the loop diverged near its reference, and what to change, in some sentences. `loops`
    are at postures of the reference, the present one first."""
    diagnosis = loops[0].diagnose(settings)
    advice = " or ".join(remedy.text for remedy in find_remedies(loops, settings, available))
    return " ".join(
        filter(None, (_cause_message(settings, diagnosis), _advice_message(advice, diagnosis)))
    )


def _cause_message(settings: LoopParameters, diagnosis: Diagnosis) -> str:
    period, step = format_milliseconds(settings.period), format_milliseconds(settings.step)
    method = INTEGRATORS[settings.integrator].title
    simulated = f"grows as exp({diagnosis.simulated:.3g} t)"
    match diagnosis.fault:
        case "gains" if settings.controller == "open-loop":
            return f"Nothing feeds the error back, and near the reference it {simulated}."
        case "gains":
            return (
                "The gains are at fault: even with continuous control the error "
                f"grows as exp({diagnosis.continuous:.3g} t)."
            )
        case "period":
            return (
                f"The control period is at fault: with continuous control the error would "
                f"{_growth_phrase(diagnosis.continuous)}, but with the torque held for {period} it "
                f"grows as exp({diagnosis.sampled:.3g} t)."
            )
        case "integrator":
            return (
                f"The integrator and its step are at fault: {method} with {step} makes an error "
                f"that {simulated}; integrated exactly it would "
                f"{_growth_phrase(diagnosis.sampled)}."
            )
        case _:
            return (
                "Near the reference this loop is stable, so the motion was driven out of its "
                "neighbourhood: by a large error, a force or torques at their limit."
            )


def _growth_phrase(rate: float) -> str:
    return f"grow as exp({rate:.3g} t)" if rate > GROWTH_TOLERANCE else "not grow"


def _advice_message(advice: str, diagnosis: Diagnosis) -> str:
    if advice:
        return f"Try {advice}."
    return "No stable setting was found near this one." if diagnosis.fault else ""
