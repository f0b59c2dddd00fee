"""The problem of the four families: its bodies, its cost, its first guess, its closed form, and the
finite problem that dynamic programming makes of it."""

import itertools

import numpy as np
import pytest

from labs.algorithms import backward_recursion, indirect
from labs.models.mass_on_a_line import mass_on_a_line
from labs.models.mechanisms import mechanism
from labs.optimal_control.families.closed_form import closed_form, riccati
from labs.optimal_control.families.cost import SwingCost
from labs.optimal_control.families.motion import SAMPLES, first_guess
from labs.optimal_control.families.params import BODIES, FamiliesParams
from labs.optimal_control.families.systems import BLOCK_ON_A_LINE, PENDULUM
from labs.optimal_control.families.tables import discretize_to_mdp, integrate, nearest_node
from labs.resumable import run_to_completion

LIMITED = SwingCost(1.0, 0.05, 0.2, 10.0, 1.0, q_min=-0.5, q_max=2.0, rho=50.0)


def test_the_pendulum_is_the_one_that_is_drawn() -> None:
    """The drawn one hangs at q = 0, this one stands there."""
    rng = np.random.default_rng(1)
    X, U = rng.normal(size=(20, 2)), rng.normal(size=(20, 1))
    drawn = mechanism("pendulum").derivatives(X + np.array([np.pi, 0.0]), U)
    for found, wanted in zip(PENDULUM.derivatives(X, U), drawn, strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-9)
    np.testing.assert_allclose(PENDULUM.f(X[0], U[0]), drawn[0][0], atol=1e-9)
    assert mass_on_a_line().model.inertias[1].mass == BLOCK_ON_A_LINE.inertia


@pytest.mark.parametrize("name", BODIES)
def test_derivatives_of_dynamics_and_cost(name: str) -> None:
    """By central differences, also outside the limits on q."""
    body, rng, e = BODIES[name], np.random.default_rng(2), 1e-6
    X, U = 3.0 * rng.normal(size=(30, 2)), rng.normal(size=(30, 1))
    f_x, f_u = body.derivatives(X, U)[1:]
    cost = LIMITED.running_derivatives(X, U, exact=True)
    for k, step in enumerate(e * np.eye(2)):
        up, down = body.derivatives(X + step, U)[0], body.derivatives(X - step, U)[0]
        np.testing.assert_allclose(f_x[:, :, k], (up - down) / (2 * e), atol=1e-7)
        slope = (LIMITED.running(X + step, U) - LIMITED.running(X - step, U)) / (2 * e)
        np.testing.assert_allclose(cost.l_x[:, k], slope, rtol=1e-6, atol=1e-6)
        ahead = LIMITED.running_derivatives(X + step, U, True).l_x
        behind = LIMITED.running_derivatives(X - step, U, True).l_x
        np.testing.assert_allclose(cost.l_xx[:, :, k], (ahead - behind) / (2 * e), atol=1e-5)
        final = (LIMITED.final(X[0] + step) - LIMITED.final(X[0] - step)) / (2 * e)
        gradient, hessian = LIMITED.final_derivatives(X[0], True)
        assert gradient[k] == pytest.approx(final, abs=1e-6)
        np.testing.assert_array_equal(hessian, np.diag([20.0, 2.0]))
    up, down = body.derivatives(X, U + e)[0], body.derivatives(X, U - e)[0]
    np.testing.assert_allclose(f_u[:, :, 0], (up - down) / (2 * e), atol=1e-7)
    slope = (LIMITED.running(X, U + e) - LIMITED.running(X, U - e)) / (2 * e)
    np.testing.assert_allclose(cost.l_u[:, 0], slope, atol=1e-6)
    np.testing.assert_array_equal(cost.l_uu, np.full((30, 1, 1), 0.4))


def test_the_first_guess_starts_ends_and_swings_as_it_says() -> None:
    problem = FamiliesParams().problem(np.array([3.0, 0.0]), 2.0)
    straight, swung = first_guess(problem, 0.0), first_guess(problem, 2.0)
    for guess in (straight, swung):
        assert len(guess.t) == SAMPLES + 1
        np.testing.assert_allclose(guess.X[0], [3.0, 0.0], atol=0.1)
        np.testing.assert_allclose(guess.X[-1], [0.0, 0.0], atol=0.1)
        assert np.abs(guess.U).max() <= 4.0
        inside = np.abs(guess.U) < 4.0
        u = indirect.hamiltonian_minimiser(problem, guess.X, guess.P)[:, 0]
        np.testing.assert_allclose(u[inside], guess.U[inside], atol=1e-9)
    assert np.abs(swung.X - straight.X)[:, 0].max() == pytest.approx(1.5, abs=0.1)


def test_the_closed_form_solves_its_equations() -> None:
    params = FamiliesParams(system="mass", horizon=2.0)
    exact = closed_form(params, params.x0, 2.0)
    assert exact is not None
    problem = params.problem(params.x0, 2.0)
    f = problem.dynamics.derivatives(exact.X, exact.U[:, None])[0]
    slopes = np.gradient(exact.X, exact.t, axis=0)
    np.testing.assert_allclose(slopes[1:-1], f[1:-1], atol=1e-3)
    end = problem.cost.final_derivatives(exact.X[-1], False)[0]
    np.testing.assert_allclose(exact.P[-1], end, atol=1e-9)
    for k in (0, 50, 149):
        P = riccati(params, np.array([2.0 - exact.t[k]]))[0]
        np.testing.assert_allclose(exact.P[k], 2.0 * P @ exact.X[k], atol=1e-9)
    assert closed_form(params.change({"u_max": 1.0}), params.x0, 2.0) is None
    limited = params.change({"limited": True, "q_max": 0.5})
    assert closed_form(limited, params.x0, 2.0) is None
    assert closed_form(FamiliesParams(), params.x0, 2.0) is None


# Dynamic programming --------------------------------------------------------------------------


def test_a_step_of_a_table_is_integrated_exactly() -> None:
    """Of the mass, whose motion under a held force is known."""
    params = FamiliesParams(system="mass")
    problem = params.problem(np.zeros(2), 1.0)
    ends, cost = integrate(problem, np.array([[0.5, -1.0]]), np.array([[2.0]]), 0.1)
    np.testing.assert_allclose(ends, [[0.5 - 0.1 + 0.01, -0.8]], atol=1e-12)
    s = np.linspace(0.0, 0.1, 2001)
    path = np.stack([0.5 - s + s**2, -1.0 + 2.0 * s], axis=1)
    rate = problem.cost.running(path, np.full((2001, 1), 2.0))
    assert cost[0] == pytest.approx(np.trapezoid(rate, s), rel=1e-6)


def test_the_table_is_the_best_of_all_sequences() -> None:
    params = FamiliesParams(horizon=0.6)
    problem, grid = params.problem(np.zeros(2), 0.6), params.grid(21)
    levels = np.array([-4.0, 0.0, 4.0])
    mdp = run_to_completion(discretize_to_mdp(problem, grid, 0.2, levels))
    final = np.array([problem.cost.final(x) for x in grid.nodes])
    V, _ = backward_recursion.value_and_policy_tables(mdp, final, 3)
    for start in (0, 100, 222, 440):
        paid = []
        for sequence in itertools.product(range(3), repeat=3):
            at, cost = start, 0.0
            for u in sequence:
                cost, at = cost + mdp.C[at, u], mdp.successors[at, u]
            paid.append(cost + final[at])
        assert V[3, start] == pytest.approx(min(paid), rel=1e-12)


def test_what_leaves_the_grid_ends_at_its_edge() -> None:
    grid = FamiliesParams().grid(21)
    corners = nearest_node(grid, np.array([[-99.0, -99.0], [99.0, 99.0], [-99.0, 99.0]]))
    np.testing.assert_array_equal(corners, [0, 440, 20])
    np.testing.assert_array_equal(nearest_node(grid, grid.nodes), np.arange(441))
