"""The tracking problem in deviations: its costs step by step and its units."""

import numpy as np
import pytest

from labs.models.mechanisms import mechanism
from labs.optimal_control.lqr_tracking.laps import ReferencePath
from labs.optimal_control.lqr_tracking.tracking import (
    COSTED_JOINT,
    TrackingSettings,
    full_preview,
    limited_preview,
    reference_lap,
)

SETTINGS = TrackingSettings(
    ReferencePath("ur5", "circle", 0.15, 60), "none", 0.0, (100.0, 1.0, 20.0), (3.0, -2.0)
)


def test_the_costs_of_steps_add_up_to_the_problems() -> None:
    rng = np.random.default_rng(1)
    problem = full_preview(SETTINGS).problem
    x, u = rng.standard_normal((61, 12)), rng.standard_normal((60, 6))
    paid = sum(limited_preview(SETTINGS, t, 0).cost(x[t], u[t]) for t in range(60))
    last = x[-1] @ problem.q_final @ x[-1]
    assert paid + last == pytest.approx(problem.cost(x, u))


def test_weights_and_linear_costs_are_in_units_of_the_motors() -> None:
    """At its limit a motor pays R, and with s = 1 twice 1 more."""
    problem, limit = full_preview(SETTINGS).problem, mechanism("ur5").control_limit
    at_limit = limit * np.eye(6)[COSTED_JOINT["ur5"]]
    assert at_limit @ problem.r @ at_limit == pytest.approx(20.0)
    assert problem.terms["s_linear"][0] @ at_limit == pytest.approx(-2.0)
    assert problem.terms["q_linear"][0, 1] == 3.0
    x_ref = reference_lap(SETTINGS).x_ref[5]
    np.testing.assert_array_equal(limited_preview(SETTINGS, 5, 9).x_ref, x_ref)
