"""What integration plots, and the arrays behind it: a column for each of METHOD_NAMES."""

from collections.abc import Mapping

import numpy as np

from labs.algorithms.runge_kutta import order_conditions
from labs.appendix.integration.accuracy import (
    GROWTH_STEPS,
    HIGHEST_GROWTH,
    LONGEST_STEP,
    STEP_SIZES,
    growth_of_step,
    stability_region_edge,
    tableau_of,
)
from labs.appendix.integration.convergence import fitted_order
from labs.appendix.integration.params import METHOD_NAMES, METHOD_TITLES, IntegrationParams
from labs.plots import Bars, Curves, Line, Readout, TimeSeries, Trace

TITLES = tuple(METHOD_TITLES.values())


def _lines(channel: str) -> tuple[Line, ...]:
    """One for each method."""
    return tuple(Line(f"{channel}_{m}", rf"\text{{{name}}}") for m, name in METHOD_TITLES.items())


PLOTS = (
    TimeSeries(
        "Sideways position of the tip",
        "m",
        *_lines("tip"),
        Line("tip", r"\text{exact}", "limit"),
    ),
    TimeSeries("Energy drift, decades", "log₁₀ of a fall's energy", *_lines("drift")),
    Curves(
        "Global error after half a second",
        "step h [s]",
        "error",
        Trace("step_sizes", "global_errors", TITLES, "marked", 1, "global_orders"),
        log_x=True,
        log_y=True,
    ),
    Curves(
        "Local error of one step",
        "step h [s]",
        "error",
        Trace("step_sizes", "local_errors", TITLES, "marked", 1, "local_orders"),
        log_x=True,
        log_y=True,
    ),
    Curves(
        "Global error against cost",
        "evaluations of f in half a second",
        "error",
        Trace("costs", "global_errors", TITLES, "marked", 1),
        log_x=True,
        log_y=True,
    ),
    Curves(
        "Growth of a small swing in one step",
        "step h [s]",
        "factor",
        Trace("growth_steps", "growth", TITLES, "line", 1, "limits"),
        Trace("limit_steps", "limit_growth", "", "points", 1),
        Trace("h", "h_line", "h now", "dash"),
        log_x=True,
    ),
    Curves(
        "Region of absolute stability",
        "Re z",
        "Im z",
        *(
            Trace(f"edge_re_{name}", f"edge_im_{name}", METHOD_TITLES[name], "line", i)
            for i, name in enumerate(METHOD_NAMES, start=1)
            if name != "semi"
        ),
        Trace("z_re", "z_im", "hλ", "points"),
        guide="imaginary-axis",
        equal=True,
    ),
    TimeSeries("Energy", "J", *_lines("energy"), Line("energy", r"\text{exact}", "limit")),
    Bars("Order conditions of your tableau", "conditions", r"\text{off by}", ""),
    Readout("own_order", "Order of your tableau", "", whole=True),
    Readout("own_sum", "Sum of its b", ""),
    Readout("reach", "h |λ|, fastest swing", ""),
    Readout("newton", "Newton iterations in a step", "", whole=True),
    Readout("going", "Methods still going", "of 8", whole=True),
)


def error_fields(
    global_errors: np.ndarray, local_errors: np.ndarray, costs: np.ndarray
) -> Mapping[str, np.ndarray]:
    """Of arrays (8, k), and the orders (8,) their slopes show, NaN where they show none."""
    return {
        "step_sizes": STEP_SIZES,
        "global_errors": global_errors.T,
        "local_errors": local_errors.T,
        "costs": costs.T,
        "global_orders": np.array([fitted_order(STEP_SIZES, row) for row in global_errors]),
        "local_orders": np.array([fitted_order(STEP_SIZES, row) for row in local_errors]),
    }


def stability_fields(params: IntegrationParams, limits: np.ndarray) -> Mapping[str, np.ndarray]:
    """What a step does to a small swing; its limits (8,) [s] are NaN where they are not among
    the steps shown, their marks 0, which a logarithmic axis leaves out."""
    z = params.h * params.plant.eigenvalues
    shown = (limits >= GROWTH_STEPS[0]) & (limits < LONGEST_STEP)
    found: dict[str, np.ndarray] = {
        "growth_steps": GROWTH_STEPS,
        "growth": np.stack([growth_of_step(*params.method(m)) for m in METHOD_NAMES], axis=1),
        "limits": np.where(shown, limits, np.nan),
        "limit_steps": np.where(shown, limits, 0.0)[None],
        "limit_growth": np.ones((1, len(METHOD_NAMES))),
        "h": np.full(2, params.h),
        "h_line": np.array([0.0, HIGHEST_GROWTH]),
        "z_re": z.real,
        "z_im": z.imag,
        "conditions": order_conditions(tableau_of(params.own_tableau)),
    }
    for name in METHOD_NAMES:
        if name != "semi":  # it is no Runge-Kutta method
            edge = stability_region_edge(params.method(name)[0])
            found |= {f"edge_re_{name}": edge.real, f"edge_im_{name}": edge.imag}
    return found
