"""What the page plots, and the fields behind it."""

from collections.abc import Mapping

import numpy as np

from labs.optimal_control.mpc_stability.closed_loop import ClosedLoopRun
from labs.optimal_control.mpc_stability.value_surface import ValueSurface
from labs.plots import Bars, Curves, Line, Note, Plot, Readout, ShownWhen, TimeSeries, Trace

CHANGE_NAMES = ("falls by l", "falls by less", "rises", "infeasible next")

AT_REST: ShownWhen = {"task": ("regulate", "economic")}

PLOTS: tuple[Plot, ...] = (
    Curves(
        "Value along the run",
        "period",
        "V*",
        Trace("k", "V_run", "V*", "marked", 1),
        Trace("k", "V_promised", "V*(x₀) − Σ l", "dash", 2),
    ),
    TimeSeries(
        "Change of the value",
        "",
        Line("change", r"V^*(x^+) - V^*(x)"),
        Line("minus_l", "-l(x, u^*_0)", "dash"),
    ),
    Note("Assumptions", "assumptions"),
    Bars("What V* does over X₀", "shares", r"\text{share}", "%", names="changes"),
    TimeSeries("Position", "{q_unit}", Line("q", "q"), Line("q_ref", "q_r", "dash")),
    TimeSeries(
        "Control",
        "{u_unit}",
        Line("u", "u"),
        Line("u_max", "u_{max}", "limit"),
        Line("u_min", "-u_{max}", "limit"),
    ),
    TimeSeries("Velocity", "{v_unit}", Line("v", "v"), Line("v_ref", "v_r", "dash")),
    TimeSeries("Value", "", Line("V", "V^*_N")),
    Note("The run", "run"),
    Readout("V", "V*", ""),
    Readout("worst", "Worst V*(x⁺) − V* + l", ""),
    Readout("falls", "V* falls by l on", "% of X₀", when=AT_REST),
    Readout("rises", "V* rises on", "% of X₀", when=AT_REST),
    Readout("area", "X₀", "{area_unit}", when=AT_REST),
    Readout(
        "terminal_area",
        "Terminal set",
        "{area_unit}",
        when={"terminal_set": ("origin", "invariant")},
    ),
)


def run_fields(run: ClosedLoopRun) -> Mapping[str, np.ndarray]:
    """V* at every period of the run that has one, with what the theorem allows it."""
    has = run.found
    k = np.arange(len(run.V)) + (run.k + 1 - len(run.V))
    first = run.V[0] if len(run.V) and has[0] else 0.0
    promised = first - np.concatenate([[0.0], np.cumsum(run.stage_costs)])[: len(run.V)]
    return {"k": k[has].astype(float), "V_run": run.V[has], "V_promised": promised[has]}


def surface_fields(surface: ValueSurface) -> Mapping[str, np.ndarray]:
    """In percent."""
    return {"shares": 100.0 * surface.shares()}
