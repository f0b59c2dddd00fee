"""Chance constraints: back-offs in closed form, and the promise counted over 10,000 runs."""

import numpy as np
import pytest
from scipy.stats import binom, norm

from labs.algorithms.chance_mpc import (
    Noise,
    back_off,
    error_covariances,
    nominal_from_measured_state,
    nominal_from_predicted_state,
    stationary_covariance,
)
from labs.algorithms.linear_mpc import LinearPlanner
from labs.algorithms.riccati import steady_state
from labs.errors import LabError
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import box
from labs.resumable import run_to_completion

RUNS = 10_000
SURE = 1e-6
"""That a count leaves its interval by chance."""
WALL = 0.5


def cart(q: float = 10.0) -> tuple[LinearMpcProblem, Noise]:
    """A cart told to press on to a place behind a wall; noise moves and pushes it."""
    T = 0.2
    A, B = np.array([[1.0, T], [0.0, 1.0]]), np.array([[0.5 * T * T], [T]])
    Q, R = np.diag([q, 1.0]), np.eye(1)
    lqr = steady_state(A, B, Q, R)
    X, U = box([-1.5, -1.0], [WALL, 1.0]), box([-2.0], [2.0])
    reference = np.array([WALL + 0.2, 0.0])
    problem = LinearMpcProblem(15, A, B, Q, R, lqr.value, X, U, x_ref=reference)
    return problem, Noise(np.diag([0.01, 0.03]) ** 2, lqr.gain)


def interval(probability: float) -> tuple[float, float]:
    """Where the share of RUNS independent events of this probability lies, but for SURE."""
    low, high = binom.interval(1.0 - SURE, RUNS, probability)
    return low / RUNS, high / RUNS


def test_the_back_off_in_closed_form() -> None:
    """x+ = a x + w: variances add up as a geometric series."""
    a, sigma, eye = 0.8, 0.3, np.eye(1)
    problem = LinearMpcProblem(
        6, a * eye, eye, eye, eye, eye, box([-1.0], [2.0]), box([-1.0], [1.0])
    )
    noise = Noise(sigma**2 * eye, np.zeros((1, 1)))
    Sigma = error_covariances(problem, noise)[:, 0, 0]
    exact = sigma**2 * (1.0 - a ** (2.0 * np.arange(7))) / (1.0 - a**2)
    np.testing.assert_allclose(Sigma, exact, atol=1e-12)
    stationary = stationary_covariance(problem, noise)
    assert stationary[0, 0] == pytest.approx(sigma**2 / (1.0 - a**2))
    margins = back_off(problem.state_set, Sigma[:, None, None], 0.975)
    np.testing.assert_allclose(margins, 1.959964 * np.sqrt(exact)[:, None] * [1.0, 1.0], rtol=1e-6)
    assert not back_off(problem.state_set, stationary, 0.5).any(), "half of the runs: no margin"


@pytest.mark.parametrize("probability", [0.5, 0.8, 0.95, 0.999])
def test_planned_from_the_measured_state(probability: float) -> None:
    """One plan, with K about it: each limit at each step is broken as seldom as promised, and just
    so where the plan goes to its margin."""
    problem, noise = cart()
    tight = nominal_from_measured_state(problem, noise, probability)
    plan = run_to_completion(LinearPlanner(tight).plan(np.array([-0.1, 0.2]), None))
    assert plan.found
    rng, x, active = np.random.default_rng(0), np.tile(plan.X[0], (RUNS, 1)), 0
    assert tight.state_margins is not None
    for k in range(problem.N):
        u = plan.U[k] + (x - plan.X[k]) @ noise.K.T
        for limits, values, nominal, margins in (
            (problem.state_set, x, plan.X[k], tight.state_margins[k]),
            (problem.control_set, u, plan.U[k], tight.control_margins[k]),  # type: ignore[index]
        ):
            if k == 0:
                continue  # nothing is uncertain yet
            shares = (values @ limits.H.T > limits.h).mean(axis=0)
            low, high = interval(1.0 - probability)
            assert (shares <= high).all()
            tense = limits.H @ nominal > limits.h - margins - 1e-7
            assert (shares[tense] >= low).all()
            active += int(tense.sum())
        w = rng.standard_normal((RUNS, 2)) @ np.sqrt(noise.covariance)
        x = x @ problem.A.T + u @ problem.B.T + w
    assert active >= 2


@pytest.mark.parametrize("probability", [0.5, 0.9, 0.99])
def test_planned_from_the_predicted_state(probability: float) -> None:
    """In closed loop: never infeasible; at the wall each step is beyond it in the share of runs
    that was promised, and the share of those ever beyond keeps to Boole's bound."""
    problem, noise = cart()
    tight = nominal_from_predicted_state(problem, noise, probability)
    planner = LinearPlanner(tight)
    rng, z, plan = np.random.default_rng(0), np.array([-0.1, 0.2]), None
    x, ever, sum_of_shares, at_wall = np.tile(z, (RUNS, 1)), np.zeros(RUNS, dtype=bool), 0.0, 0
    sigma = np.sqrt(stationary_covariance(problem, noise)[0, 0])
    low, high = interval(1.0 - probability)
    for k in range(50):
        plan = run_to_completion(planner.plan(z, plan))
        assert plan.found
        u = plan.U[0] + (x - z) @ noise.K.T
        w = rng.standard_normal((RUNS, 2)) @ np.sqrt(noise.covariance)
        x, z = x @ problem.A.T + u @ problem.B.T + w, plan.X[1]
        beyond = x[:, 0] > WALL
        ever, sum_of_shares = ever | beyond, sum_of_shares + beyond.mean()
        assert beyond.mean() <= high
        if k > 25:
            assert z[0] == pytest.approx(WALL - norm.ppf(probability) * sigma, abs=1e-6)
            assert beyond.mean() >= low
            at_wall += 1
    assert at_wall > 20
    assert 1.0 - probability < ever.mean() <= sum_of_shares


def test_what_is_refused() -> None:
    problem, noise = cart()
    for probability in (0.49, 1.0, 1.5):
        with pytest.raises(LabError, match="probability"):
            nominal_from_measured_state(problem, noise, probability)
    with pytest.raises(LabError, match="stabilise"):
        nominal_from_predicted_state(problem, Noise(noise.covariance, np.zeros((1, 2))), 0.9)
