"""Errors and slopes, on a motion known in closed form."""

import numpy as np
import pytest

from labs.algorithms.runge_kutta import EULER, RK4, RungeKuttaStep, VectorField, runge_kutta_step
from labs.appendix.integration.convergence import (
    exact_solution,
    fitted_order,
    global_errors,
    local_errors,
)

OMEGA = 2.0
M = np.array([[0.0, 1.0], [-(OMEGA**2), 0.0]])
FLOW = VectorField(lambda x, t: M @ x, lambda x, t: M)
X0 = np.array([1.0, 0.0])


def at(t: float) -> np.ndarray:
    return np.array([np.cos(OMEGA * t), -OMEGA * np.sin(OMEGA * t)])


def test_the_reference_is_the_closed_form() -> None:
    np.testing.assert_allclose(exact_solution(FLOW, at(0.4), 0.4, 3.0), at(3.0), atol=1e-11)


def test_errors_are_the_distance_from_it() -> None:
    counts, h = (4, 8), np.array([0.5, 0.25])
    errors, costs = global_errors(
        lambda x, t, h: runge_kutta_step(EULER, FLOW, x, t, h), X0, at(2.0), 2.0, counts
    )
    for error, n in zip(errors, counts, strict=True):
        x = np.linalg.matrix_power(np.eye(2) + 2.0 / n * M, n) @ X0
        assert error == pytest.approx(np.linalg.norm(x - at(2.0)), rel=1e-12)
    np.testing.assert_array_equal(costs, counts)
    local = local_errors(
        lambda x, t, h: runge_kutta_step(RK4, FLOW, x, t, h),
        X0,
        0.0,
        np.array([at(v) for v in h]),
        h,
    )
    assert local[0] / local[1] == pytest.approx(2**5, rel=0.1)


def test_an_error_that_is_no_number_is_left_out() -> None:
    def lost(x: np.ndarray, t: float, h: float) -> RungeKuttaStep:
        return RungeKuttaStep(np.full_like(x, np.inf), 1, 0, 0.0, "")

    errors, costs = global_errors(lost, X0, X0, 1.0, (2, 4))
    np.testing.assert_array_equal(errors, 0.0)
    np.testing.assert_array_equal(costs, (2, 4))


def test_a_slope_is_fitted_to_what_says_something() -> None:
    h = np.array([1.0, 0.1, 0.01, 0.001, 0.0001])
    assert fitted_order(h, 3.0 * h**2) == pytest.approx(2.0)
    assert fitted_order(h, np.array([0.9, 0.4, 4e-4, 4e-7, 1e-13])) == pytest.approx(3.0)
    assert np.isnan(fitted_order(h, np.zeros(5)))
