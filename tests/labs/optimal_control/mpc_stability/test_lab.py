"""The lab mpc-stability: its numbers against independent ones, and how a run begins anew."""

import numpy as np
import pytest

from labs.algorithms.polygons import vertices
from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.optimal_control.mpc_stability.assumptions import check_assumptions
from labs.optimal_control.mpc_stability.formulation import Formulation
from labs.optimal_control.mpc_stability.params import MpcStabilityParams
from labs.optimal_control.mpc_stability.reference import Reference
from labs.optimal_control.mpc_stability.value_surface import (
    FALLS,
    FALLS_LESS,
    INFEASIBLE_NEXT,
    RISES,
    value_surface,
)
from labs.params import Value
from labs.resumable import run_to_completion
from tests.labs.algorithms.linear_mpc_problems import by_quadprog
from tests.labs.optimal_control.mpc_stability.simulation import simulate


def formulation(**setting: Value) -> Formulation:
    return MpcStabilityParams(**setting).formulation  # type: ignore[arg-type]


def test_a_reference_is_a_motion_of_the_system() -> None:
    p = formulation(system="cart").problem
    found = Reference.of(p.A, p.B, 0.3, 0.2, 0.1)
    k = np.arange(60)
    X, U = found.states(k), found.controls(k)
    np.testing.assert_allclose(X[1:], X[:-1] @ p.A.T + U[:-1] @ p.B.T, atol=1e-12)
    np.testing.assert_allclose(X[:, 0], 0.3 * np.sin(2 * np.pi * 0.2 * 0.1 * k), atol=1e-12)


@pytest.mark.parametrize("ingredients", [("none", "none"), ("p", "invariant"), ("q", "origin")])
def test_the_surface_is_the_value_and_tells_what_becomes_of_it(
    ingredients: tuple[str, str],
) -> None:
    """Against plans one by one, by another solver."""
    given = formulation(N=4.0, terminal_cost=ingredients[0], terminal_set=ingredients[1])
    surface = run_to_completion(value_surface(given, (4, 9)))
    p, seen = given.problem, set()
    for x, V, change in zip(
        surface.points.reshape(-1, 2), surface.V.ravel(), surface.change.ravel(), strict=True
    ):
        now = by_quadprog(p, x)
        assert now is not None
        assert pytest.approx(now[0], abs=1e-6) == V
        u = now[2][0]
        after = by_quadprog(p, p.step(x, u))
        seen.add(int(change))
        if after is None:
            assert change == INFEASIBLE_NEXT
            continue
        rise = after[0] - now[0]
        excess = rise + (x @ p.Q @ x + u @ p.R @ u) / 2
        assert change == RISES if rise > 1e-5 else change in (FALLS, FALLS_LESS) or rise > -1e-5
        if abs(excess) > 1e-5 and change in (FALLS, FALLS_LESS):
            assert (excess < 0.0) == (change == FALLS)
    assert seen == {FALLS} if "none" not in ingredients else len(seen) == 4


def test_the_worst_of_the_terminal_set_is_that_of_brute_force() -> None:
    """Over its corners and 400 more points, with 501 controls each."""
    given = formulation(terminal_cost="q", alpha=2.0, terminal_set="invariant", u_max=5.0)
    p = given.problem
    assert p.terminal_set is not None
    corners = vertices(p.terminal_set)
    X = np.random.default_rng(0).dirichlet(np.full(len(corners), 0.3), 400) @ corners
    X, U = np.vstack([X, corners])[:, None], np.linspace(-5.0, 5.0, 501)[None, :, None]
    after = X @ p.A.T + U @ p.B.T
    change = ((after @ p.Q_f) * after).sum(-1) - ((X @ p.Q_f) * X).sum(-1)
    change += ((X @ p.Q) * X).sum(-1) + (U * U * p.R[0, 0]).sum(-1)
    best = np.where(p.terminal_set.contains(after, 1e-9), change / 2.0, np.inf).min(axis=1)
    assert check_assumptions(given).decrease == pytest.approx(
        best[np.isfinite(best)].max(), rel=0.03
    )


def test_a_lazier_gain_costs_more() -> None:
    """So that its P bounds Riccati's from above, and stabilises."""
    P, riccati = (formulation(rho=rho).problem.Q_f for rho in (7.0, 1.0))
    assert (np.linalg.eigvalsh(P - riccati) > -1e-9).all()
    assert check_assumptions(formulation(rho=7.0)).terminal_bound == pytest.approx(
        np.linalg.eigvalsh(P)[-1] / 2
    )


def test_what_holds_is_told_apart() -> None:
    assert check_assumptions(formulation()).hold == (True, True, True, True)
    assert check_assumptions(formulation(terminal_set="none")).hold == (True, False, False, True)
    assert check_assumptions(formulation(q_v=0.0)).hold[3] is False
    assert check_assumptions(formulation(terminal_cost="none")).hold == (True, True, False, True)
    assert check_assumptions(formulation(terminal_cost="none", terminal_set="origin")).hold[2]
    assert check_assumptions(formulation(task="economic", price=0.5)).hold[3] is False


def test_a_motion_beyond_the_limits_says_so() -> None:
    found = simulate({"system": "cart", "task": "track", "amplitude": 1.0, "frequency": 1.0}, 1.0)
    assert "beyond the limits" in found.notes["assumptions"]
    assert "smaller or slower" in found.notes["run"]
    assert found.run.k == -1


def test_another_start_or_problem_begins_another_run() -> None:
    world = World(find_lab("mpc-stability"))
    for _ in range(30):
        world.advance()
    assert world.state.run.k == 3
    world.hold("state", (0.1, 0.5, 0.3))
    world.advance()
    assert world.state.run.k == 0
    params = world.params
    assert isinstance(params, MpcStabilityParams)
    np.testing.assert_array_equal(world.state.run.x, params.start)
    assert world.t == pytest.approx(0.31)
    for _ in range(20):
        world.advance()
    world.change({"N": 8.0})
    world.advance()
    assert world.state.run.k == 0


def test_a_run_is_the_plans_of_the_problem() -> None:
    found = simulate({}, 1.0)
    p = formulation().problem
    for x, V in zip(found.run.path, found.run.V, strict=True):
        now = by_quadprog(p, x)
        assert now is not None
        assert pytest.approx(now[0], abs=1e-7) == V
