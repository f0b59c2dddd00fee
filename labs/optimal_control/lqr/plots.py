"""What the regulator's page plots, and the fields behind it."""

from collections.abc import Mapping

import numpy as np

from labs.models.coordinates import coordinate_labels
from labs.optimal_control.lqr.comparison import COMPARED_HORIZONS, HORIZON_COUNT
from labs.optimal_control.lqr.linear_systems import LINEAR_SYSTEMS, LinearSystem
from labs.optimal_control.lqr.own_system import OwnSystem
from labs.optimal_control.lqr.region_of_attraction import HALF_WIDTHS, SYSTEM_CODES, grid_axes
from labs.optimal_control.lqr.regulator import Regulator, settling_step
from labs.plots import Curves, Line, Matrix, Plot, Readout, TimeSeries, Trace

MECHANISM = {"system": tuple(LINEAR_SYSTEMS)}
WITH_REGION = {"system": tuple(SYSTEM_CODES)}

PLOTS: tuple[Plot, ...] = (
    TimeSeries("Deviation", "{q_unit}", Line("dq", "q - q_{eq}"), select="joint"),
    TimeSeries(
        "Control",
        "{u_unit}",
        Line("u", "u"),
        Line("u_max", "u_{max}", "limit"),
        Line("u_min", "-u_{max}", "limit"),
        select="motor",
    ),
    Curves(
        "Where the policy recovers",
        "{phase}",
        "{phase_rate}",
        Trace("region_x", "region_y", "comes back", "points", 3),
        Trace("path_x", "path_y", "so far", "line", 1),
        Trace("now_x", "now_y", "now", "points", 2),
        when=WITH_REGION,
    ),
    TimeSeries(
        "Cost",
        "",
        Line("paid", r"\text{so far}"),
        Line("total", r"\text{so far} + V_t(x_t)"),
        Line("predicted", r"x_0^T P_0\, x_0", "limit"),
    ),
    Curves(
        "Value, backward from N",
        "t [steps]",
        "Pₜ,ᵢᵢ / steady",
        Trace("p_steps", "p", "i = {}", "line", 1),
        Trace("p_mark", "p_span", "constant before", "dash", 0),
        log_y=True,
    ),
    Curves(
        "Gain, backward from N",
        "t [steps]",
        "{gain_entry} / steady",
        Trace("k_steps", "k", "i = {}", "line", 1),
        Trace("k_mark", "k_span", "constant before", "dash", 0),
    ),
    Curves(
        "Eigenvalues of one step",
        "Re",
        "Im",
        Trace("open_re", "open_im", "A", "points", 7),
        Trace("closed_re", "closed_im", "A + B K", "points", 1),
        guide="unit-circle",
        equal=True,
    ),
    TimeSeries("Velocity", "{v_unit}", Line("v", r"\dot q"), select="joint", when=MECHANISM),
    Curves(
        "Time to solve",
        "N",
        "time [s]",
        Trace("horizons", "riccati", "Riccati, slope", "marked", 1, "riccati_slope"),
        Trace("horizons", "at_once", "least squares, slope", "marked", 2, "at_once_slope"),
        log_x=True,
        log_y=True,
    ),
    Curves(
        "Difference of the two solutions",
        "N",
        "difference",
        Trace("horizons", "difference", "share of the largest control", "marked", 4),
        log_x=True,
        log_y=True,
    ),
    Matrix("Gain now", "gain", "K_t", shade=True),
    Readout("to_end", "Time to go", "s"),
    Readout("growth", "Growth of a small deviation", "a step"),
    Readout("lean", "Largest lean recovered", "{phase_unit}", when=WITH_REGION),
    Readout("recursions", "Riccati steps to the steady state", "", whole=True),
    Readout("settled", "Constant gains, of N", "", whole=True),
)


def plot_labels(system: LinearSystem | OwnSystem) -> dict[str, str | tuple[str, ...]]:
    """The coordinates of the system, and the one whose phase plane is shown: the last."""
    named = (
        own_labels(system) if isinstance(system, OwnSystem) else coordinate_labels(system.mechanism)
    )
    unit, rate = named["q_unit"][-1], named["v_unit"][-1]
    return named | {
        "phase": f"{'place' if unit == 'm' else 'lean from the rest'} [{unit}]",
        "phase_rate": f"its rate [{rate}]",
        "phase_unit": unit,
        "gain_entry": "Kₜ,ᵢᵢ" if system.nu > 1 else "Kₜ,₁ᵢ",
    }


def own_labels(system: OwnSystem) -> dict[str, tuple[str, ...]]:
    """Of states and controls without units."""
    joints, motors = (
        tuple(f"{name}{k + 1}" for k in range(count))
        for name, count in (("x", system.nx), ("u", system.nu))
    )
    none = ("",) * system.nx
    return {
        "joint": joints, "motor": motors, "q_unit": none, "v_unit": none,
        "u_unit": ("",) * system.nu,
    }  # fmt: skip


def region_fields(system: str, region: np.ndarray, path: np.ndarray) -> dict[str, np.ndarray]:
    """The grid points that are known to be recovered from, and the path (k, 2) in the same
    phase plane."""
    edge = np.array(HALF_WIDTHS.get(system, (np.inf, np.inf)))
    path = np.clip(path, -edge, edge)
    fields = {
        "path_x": path[:, 0],
        "path_y": path[:, 1],
        "now_x": path[-1:, 0],
        "now_y": path[-1:, 1],
        "region_x": np.zeros(0),
        "region_y": np.zeros(0),
    }
    if system in SYSTEM_CODES:
        coordinates, rates = grid_axes(system)
        rows, columns = np.nonzero(region == 1)
        fields |= {"region_x": coordinates[columns], "region_y": rates[rows]}
    return fields


def closed_loop_fields(regulator: Regulator, gain: np.ndarray) -> dict[str, np.ndarray]:
    """The gain used now (nu, nx), and the eigenvalues of one step without and with it."""
    a, b = regulator.problem.a, regulator.problem.b
    opened = np.linalg.eigvals(a).astype(complex)
    closed = opened if regulator.trouble else np.linalg.eigvals(a + b @ gain).astype(complex)
    return {
        "gain": gain,
        "open_re": opened.real,
        "open_im": opened.imag,
        "closed_re": closed.real,
        "closed_im": closed.imag,
    }


def recursion_fields(regulator: Regulator) -> dict[str, np.ndarray]:
    """How P_t and K_t come to rest, with a mark where they are constant."""
    fields: dict[str, np.ndarray] = {}
    for name, shares in zip("pk", regulator.relative_to_steady(), strict=True):
        mark = settling_step(shares)
        span = np.array([shares.min(initial=1.0), shares.max(initial=1.0)])
        fields |= {
            f"{name}_steps": np.arange(len(shares), dtype=float),
            name: shares,
            f"{name}_mark": np.full(2 if mark >= 0 else 0, float(mark)),
            f"{name}_span": span if mark >= 0 else np.zeros(0),
        }
    return fields


def comparison_fields(
    system: str, differences: np.ndarray, seconds: Mapping[str, float | np.ndarray]
) -> dict[str, np.ndarray]:
    """Of Riccati and least squares over the horizon; zero where it is not known (yet)."""
    horizons = np.array(COMPARED_HORIZONS[system], float)
    known = differences > 0.0
    fields = {
        "horizons": horizons,
        "difference": np.where(known, np.maximum(differences, 1e-17), 0.0),
    }
    for name in ("riccati", "at_once"):
        spent = np.array(seconds.get(name, np.zeros(HORIZON_COUNT)))
        fields |= {name: spent, f"{name}_slope": _slope(horizons, spent)}
    return fields


def _slope(horizons: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Of log(seconds) over log(N), through the last three; none while they are not known."""
    if not (seconds > 0.0).all():
        return np.zeros(0)
    fit = np.polyfit(np.log(horizons[-3:]), np.log(seconds[-3:]), 1)
    return np.round(fit[:1], 1)
