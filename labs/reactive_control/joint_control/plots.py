"""What joint control plots, and the eigenvalues behind it."""

from collections.abc import Mapping

import numpy as np

from labs.plots import Curves, Line, Readout, TimeSeries, Trace
from labs.reactive_control.joint_control.sampled_stability import LinearLoop, LoopParameters

PLOTS = (
    TimeSeries("Position", "rad", Line("q", "q"), Line("q_ref", "q^{ref}", "dash"), select="joint"),
    TimeSeries("Error", "rad", Line("error", "e = q^{ref} - q"), select="joint"),
    TimeSeries(
        "Torque",
        "N·m",
        Line("torque", r"\tau"),
        Line("torque_limit", r"\tau_{max}", "limit"),
        Line("torque_floor", r"-\tau_{max}", "limit"),
        select="joint",
    ),
    TimeSeries("Energy", "J", Line("kinetic", "T"), Line("potential", "U"), Line("total", "T + U")),
    Curves(
        "Closed-loop eigenvalues",
        "Re [1/s]",
        "Im [1/s]",
        Trace("poles_re", "poles_im", style="points", series=1),
        guide="left-half-plane",
    ),
    Curves(
        "Eigenvalues of one control period",
        "Re",
        "Im",
        Trace("map_re", "map_im", style="points", series=1),
        guide="unit-circle",
    ),
    Readout("rms_error", "RMS error", "rad"),
    Readout("steady_state_error", "Steady-state error (last second)", "rad"),
    Readout("overshoot", "Overshoot", "%"),
    Readout("settling_time", "Settling time (2 %)", "s"),
    Readout("peak_torque", "Peak torque", "N·m"),
    Readout("force", "Force on the end-effector", "N"),
)


def eigenvalue_fields(loop: LinearLoop, settings: LoopParameters) -> Mapping[str, np.ndarray]:
    """Of the loop under continuous control, and of one control period as simulated."""
    poles, multipliers = loop.poles(settings), loop.multipliers(settings)
    return {
        "poles_re": poles.real,
        "poles_im": poles.imag,
        "map_re": multipliers.real,
        "map_im": multipliers.imag,
    }
