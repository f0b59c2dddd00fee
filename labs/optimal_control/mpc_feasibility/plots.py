"""What the page of feasibility plots, and the fields behind it."""

from collections.abc import Mapping

import numpy as np

from labs.algorithms.polygons import area, vertices
from labs.optimal_control.mpc_feasibility.problem import FeasibilitySettings, feasibility
from labs.optimal_control.mpc_feasibility.sets import LIMIT_NAMES, AdmissibleSetGrowth, compute_sets
from labs.plots import Curves, Line, Note, Plot, Readout, TimeSeries, Trace
from labs.tasks.phase_plane.systems import PlaneSystem

PLOTS: tuple[Plot, ...] = (
    TimeSeries(
        "Position",
        "{x_unit}",
        Line("position", "x_1"),
        Line("goal", r"x_1^{\text{ref}}", "dash"),
        Line("p_high", "p_{max}", "limit"),
        Line("p_low", "-p_{max}", "limit"),
    ),
    TimeSeries(
        "Distance to the edges",
        "",
        Line("depth_feasible", r"\text{of } \mathcal{X}_0"),
        Line("depth_invariant", r"\text{of } C_\infty", "dash"),
        when={"limited": ("both",)},
    ),
    TimeSeries(
        "Control",
        "{u_unit}",
        Line("control", "u"),
        Line("u_high", "u_{max}", "limit"),
        Line("u_low", "-u_{max}", "limit"),
    ),
    Curves(
        "What can still be broken",
        "t",
        "J* / limit",
        Trace("t", "J", LIMIT_NAMES, "marked", 1),
        Trace("t", "zero", "", "dash"),
    ),
    Curves(
        "Size of the sets",
        "steps",
        "area / that of X",
        Trace("to_go", "feasible_area", "X_(N-j), j steps to the end", "marked", 1),
        Trace("grown", "admissible_area", "O_t", "marked", 2),
        Trace("to_go", "invariant_area", "C_∞", "dash"),
    ),
    Curves(
        "What holds it",
        "{x_name} [{x_unit}]",
        "{u_unit}",
        Trace("held", "holding", "control that holds it there", "line", 1),
        Trace("held", "holding_limits", ("u_max", "-u_max"), "dash"),
        when={"system": ("joint", "unstable")},
    ),
    Note("Planner", "planner"),
    TimeSeries(
        "Velocity",
        "{v_unit}",
        Line("velocity", "x_2"),
        Line("v_high", "v_{max}", "limit"),
        Line("v_low", "-v_{max}", "limit"),
    ),
    Readout("failures", "Periods without a plan", "", whole=True),
    Readout("failed", "First of them", "", whole=True),
    Readout("impact", "Speed at the wall", "{v_unit}"),
    Readout("dead", "Dead ends in X₀", "%"),
    Readout("leak", "X₁ outside X₀", "%"),
    Readout("share", "X₀'s share of C∞", "%"),
    Readout("t_star", "t*", "", whole=True),
    Readout("decided", "Controls a plan decides", "", whole=True),
)


def set_fields(setup: FeasibilitySettings, growth: AdmissibleSetGrowth) -> Mapping[str, np.ndarray]:
    """Of the sets, and of the admissible set's growth."""
    at, sets = feasibility(setup), compute_sets(setup)
    whole = area(vertices(at.box))
    chain = [area(polygon) / whole for polygon in sets.chain]
    reach = setup.limits[0] * at.system.x_max[0]
    held = at.system.x_eq[0] + np.linspace(-reach, reach, 41)
    by_q = float((np.eye(2) - at.problem.A)[1, 0] / at.problem.B[1, 0])
    limit = at.system.u_max * setup.limits[2]
    return {
        "t": np.arange(float(len(growth.J))),
        "J": growth.J,
        "zero": np.zeros(len(growth.J)),
        "to_go": np.arange(float(len(chain))) + (0.0 if sets.terminal is not None else 1.0),
        "feasible_area": np.array(chain[::-1]),
        "invariant_area": np.full(len(chain), area(sets.invariant) / whole),
        "grown": np.arange(float(len(growth.polygons))),
        "admissible_area": np.array([area(polygon) / whole for polygon in growth.polygons]),
        "held": held,
        "holding": at.system.u_eq + by_q * (held - at.system.x_eq[0]),
        "holding_limits": np.tile([limit, -limit], (len(held), 1)),
    }


def system_labels(system: PlaneSystem) -> Mapping[str, str]:
    """Names and units of a system."""
    return {
        "x_name": "position" if system.body == "mass" else "angle",
        "x_unit": system.units[0],
        "v_unit": system.units[1],
        "u_unit": system.control_unit.replace(" ", "·"),
    }
