"""What the page of the brachistochrone plots, and the fields behind it."""

from collections.abc import Mapping

import numpy as np

from labs.optimal_control.brachistochrone.history import DescentHistory
from labs.optimal_control.brachistochrone.params import BrachistochroneParams
from labs.optimal_control.brachistochrone.race import BEAD_COUNT, CURVE_NAMES, START_NAMES, BeadRace
from labs.plots import Bars, Curves, Line, Note, Plot, Readout, TimeSeries, Trace

OF_CURVES, OF_STARTS = {"race": ("curves",)}, {"race": ("starts",)}
TITLES = {
    "line": "Straight line",
    "knee": "Steep, then straight",
    "circle": "Circle",
    "cycloid": "Cycloid",
    "yours": "Your curve",
    "optimised": "Optimised",
}
"""Of the curves, as a sentence names them."""
SNELL_LIMIT = 2.0
"""What is plotted of sin(alpha) / v, as a multiple of the fastest curve's."""

PLOTS: tuple[Plot, ...] = (
    Bars("Behind the fastest", "behind", r"T - T_{\min}", "ms", gaps=True, names="bead"),
    Curves(
        "Speed along the way",
        "across from A [m]",
        "speed [m/s]",
        Trace("way_x", "way_speed", "{bead}", "line", 1),
    ),
    Curves(
        "Snell's law",
        "across from A [m]",
        "sin α / v, relative",
        Trace("snell_x", "snell", "{bead}", "line", 1),
        when=OF_CURVES,
    ),
    Curves(
        "Optimiser",
        "iteration",
        "",
        Trace("iterations", "excess", "behind the fastest curve [ms]", "marked", 6),
        Trace("stepped", "gradient", "max |∂T/∂v| [ms/(m/s)]", "line", 7),
        log_y=True,
    ),
    Curves(
        "Error over N",
        "segments N",
        "relative error of T",
        Trace("grid_segments", "grid_error", "solved", "marked", 6),
        Trace("grid_segments", "first_order", "order 1", "dash", 7),
        Trace("grid_segments", "second_order", "order 2", "dash", 1),
        log_x=True,
        log_y=True,
    ),
    TimeSeries("Speed", "m/s", Line("speed", "v"), select="bead"),
    TimeSeries("Height over the end", "m", Line("height", "z"), select="bead"),
    TimeSeries(
        "Energy",
        "J/kg",
        Line("kinetic", "v^2/2"),
        Line("potential", "g z"),
        Line("heat", r"\mu g X"),
        select="bead",
        stacked=True,
        lead=3,
    ),
    Note("Finish", "finish"),
    Readout("fastest", "Fastest possible", "s"),
    *(
        Readout(f"behind_{name}", f"{TITLES[name]}, behind", "ms", when=OF_CURVES)
        for name in CURVE_NAMES
    ),
    Readout("spread", "First to last", "ms", when=OF_STARTS),
    Readout("isochrone", "From anywhere: π√(r/g)", "s", when=OF_STARTS),
    Readout("iteration", "Iterations", "", whole=True),
)


def race_fields(params: BrachistochroneParams, race: BeadRace) -> dict[str, np.ndarray]:
    """How far behind each is, and what is plotted along the ways."""
    behind = np.full(BEAD_COUNT, np.nan)
    if np.isfinite(race.shortest_time):
        behind[race.finishing_order] = race.times[race.finishing_order] - race.shortest_time
    points = np.stack([motion.point for motion in race.sampled_motions], axis=1)
    speed = np.stack([motion.speed for motion in race.sampled_motions], axis=1)
    return {
        "behind": np.round(1e3 * behind, 3),
        "way_x": points[..., 0],
        "way_speed": speed,
    } | _snell_fields(params, race, points[..., 0], speed)


def _snell_fields(
    params: BrachistochroneParams, race: BeadRace, x: np.ndarray, speed: np.ndarray
) -> dict[str, np.ndarray]:
    """sin(alpha) / v, alpha being the angle to the plumb line (with friction, to the gravity that
    counts), in parts of the value that the fastest curve keeps all the way."""
    if race.fastest is None:
        return {"snell_x": np.zeros((0, BEAD_COUNT)), "snell": np.zeros((0, BEAD_COUNT))}
    stretch = np.hypot(1.0, params.mu)
    across, down = np.stack([motion.direction for motion in race.sampled_motions], axis=2).swapaxes(
        0, 1
    )
    sine = np.abs(across + params.mu * down) / stretch
    constant = 0.5 / np.sqrt(params.g * stretch * race.fastest.radius)
    law = sine / np.maximum(speed, 1e-9) / constant
    return {"snell_x": x, "snell": np.minimum(law, SNELL_LIMIT)}


def optimiser_fields(race: BeadRace, history: DescentHistory) -> dict[str, np.ndarray]:
    """Iterations so far, and the error of each grid solved."""
    best = 1e3 * race.fastest.time if race.fastest else 0.0
    known = (history.solved > 0.0) & (best > 0.0)
    N, error = history.segments[known], history.solved[known] / max(best, 1.0) - 1.0
    guides = {"first_order": N, "second_order": N}
    if len(N):
        guides = {"first_order": error[0] * N[0] / N, "second_order": error[0] * (N[0] / N) ** 2}
    return guides | {
        "iterations": np.arange(float(len(history.cost))),
        "excess": history.cost - best,
        "stepped": np.arange(1.0, len(history.gradient) + 1.0),
        "gradient": history.gradient,
        "grid_segments": N,
        "grid_error": error,
    }


def finish_note(params: BrachistochroneParams, race: BeadRace, t: float) -> str:
    """Who has arrived t seconds after the start, in order, and who never will."""
    names = [TITLES[name] for name in CURVE_NAMES]
    if params.race == "starts":
        names = [f"Start {name}" for name in START_NAMES]
    lines = [
        f"{race.rank(i)}. {names[i]}: {race.times[i]:.4f} s."
        for i in race.finishing_order
        if race.times[i] <= t
    ]
    for name, descent in zip(names, race.descents, strict=True):
        if not descent.arrived and descent.clock[-1] <= t:
            left = float(np.hypot(*(race.end - descent.points[-1])))
            lines.append(f"{name}: stuck {left:.2f} m from the end, its speed is used up.")
    if not params.in_reach and params.race == "curves":
        lines.append(
            f"On any path, friction takes the height of {params.mu * params.across:.2f} m up to B, "
            f"which lies {params.depth:.2f} m down: lower μ, or B."
        )
    return "\n".join(lines) or "The beads are on their way."


def bead_names(params: BrachistochroneParams) -> Mapping[str, tuple[str, ...]]:
    """What the components of vectors are."""
    return {"bead": CURVE_NAMES if params.race == "curves" else START_NAMES}
