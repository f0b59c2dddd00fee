"""What the tracking page plots, and the fields behind it."""

import numpy as np

from labs.optimal_control.lqr_tracking.laps import CONTROL_PERIOD
from labs.optimal_control.lqr_tracking.tracking import LimitedPreview
from labs.plots import Curves, Line, Matrix, Plot, Readout, TimeSeries, Trace

PLOTS: tuple[Plot, ...] = (
    TimeSeries("Tracking error", "m", Line("error", "e"), Line("ghost_error", "e^{ghost}")),
    TimeSeries(
        "Position",
        "m",
        Line("p", "p"),
        Line("p_ghost", "p^{ghost}"),
        Line("p_ref", "p^{ref}", "dash"),
    ),
    TimeSeries(
        "Control",
        "{u_unit}",
        Line("u", "u", "dash"),
        Line("feedback", r"K_t (x - x^{ref})"),
        Line("u_ref", "u^{ref}"),
        Line("affine", "k_t"),
        select="motor",
    ),
    TimeSeries(
        "Joints", "{q_unit}", Line("q", "q"), Line("q_ref", "q^{ref}", "dash"), select="joint"
    ),
    TimeSeries(
        "Cost of a lap",
        "",
        Line("lap_cost", "J"),
        Line("ghost_lap_cost", "J^{ghost}"),
        Line("optimum", "J^*", "dash"),
    ),
    Curves(
        "Affine term over the preview",
        "time ahead [s]",
        "k [{u_unit}]",
        Trace("ahead", "k", "k, motor {}", series=1),
    ),
    Curves(
        "Gains over the preview",
        "time ahead [s]",
        "K of the {first_motor}",
        Trace("ahead", "K_q", "by q{}", "line", 1),
        Trace("ahead", "K_v", "by v{}", "dash", 1),
    ),
    Matrix("Gain now, by position", "K_position", "K_t", shade=True),
    Matrix("Gain now, by velocity", "K_velocity", "K_t", shade=True),
    Readout("lap_paid", "Cost of a lap", ""),
    Readout("ghost_lap_paid", "Cost of a lap, ghost", ""),
    Readout("optimum", "Predicted optimum", ""),
    Readout("error", "Tracking error", "m"),
    Readout("ghost_error", "Tracking error, ghost", "m"),
)


def preview_fields(now: LimitedPreview, motor: int) -> dict[str, np.ndarray]:
    """The gain now; over the preview, the affine term (N, nu) and the gains of one motor, (N, nq)
    by position and by velocity."""
    gains, nq = now.policy.gains, now.gain.shape[1] // 2
    return {
        "K_position": now.gain[:, :nq],
        "K_velocity": now.gain[:, nq:],
        "ahead": CONTROL_PERIOD * np.arange(len(gains)),
        "k": now.policy.offsets,
        "K_q": gains[:, motor, :nq],
        "K_v": gains[:, motor, nq:],
    }
