"""Orders, errors and largest steps of the methods on the pendulums."""

import numpy as np
import pytest

from labs.algorithms.runge_kutta import TABLEAUS, order
from labs.appendix.integration.accuracy import (
    LONGEST_STEP,
    STEP_COUNTS,
    STEP_SIZES,
    one_step_method,
)
from labs.appendix.integration.convergence import exact_solution
from labs.appendix.integration.params import (
    IMPLICIT_METHODS,
    METHOD_NAMES,
)
from tests.labs.appendix.integration.runs import (
    LAB,
    ORDERS,
    of_method,
    solved,
)
from tests.labs.solving import solve, solved_world


@pytest.mark.parametrize("system", ["pendulum", "double-pendulum"])
@pytest.mark.parametrize("implicit", IMPLICIT_METHODS)
def test_all_orders_show(system: str, implicit: str) -> None:
    world = solved({"system": system, "implicit": implicit, "start": 0.5})
    orders = ORDERS | {"implicit": order(TABLEAUS[implicit])}
    for name, p in orders.items():
        assert of_method(world, "global_orders", name) == pytest.approx(p, abs=0.1), name


CASH_KARP = (
    "0 | ; 1/5 | 1/5; 3/10 | 3/40 9/40; 3/5 | 3/10 -9/10 6/5; 1 | -11/54 5/2 -70/27 35/27;"
    "7/8 | 1631/55296 175/512 575/13824 44275/110592 253/4096;"
    "| 37/378 0 250/621 125/594 0 512/1771"
)


def growth_of_a_step(method: str, rods: int, friction: float, h: float) -> float:
    """The spectral radius of the derivative of the method's own step at rest, by differences."""
    advance, small = one_step_method(method, rods, friction), 1e-4
    columns = [
        (advance(small * unit, 0.0, h).x - advance(-small * unit, 0.0, h).x) / (2 * small)
        for unit in np.eye(2 * rods)
    ]
    return float(np.abs(np.linalg.eigvals(np.array(columns))).max())


@pytest.mark.parametrize("friction", [0.0, 0.5, 5.0])
@pytest.mark.parametrize("system", ["pendulum", "double-pendulum"])
def test_the_limits_are_where_the_steps_begin_to_grow(system: str, friction: float) -> None:
    world = solved({"system": system, "friction": friction, "tableau": CASH_KARP})
    rods = world.params.rods
    texts = {"yours": CASH_KARP, "implicit": "implicit-midpoint"}
    for name, limit in zip(METHOD_NAMES, world.state.limits, strict=True):
        method = texts.get(name, name)
        if limit == LONGEST_STEP:
            assert growth_of_a_step(method, rods, friction, 1.99) <= 1.0 + 1e-6, name
        elif limit > 0.0:
            assert growth_of_a_step(method, rods, friction, 0.99 * limit) <= 1.0 + 1e-6, name
            assert growth_of_a_step(method, rods, friction, 1.01 * limit) > 1.0 + 1e-6, name
        else:
            assert friction == 0.0
            assert growth_of_a_step(method, rods, friction, 0.05) > 1.0 + 1e-8, name


def test_no_step_of_cash_karp_is_short_enough_without_friction() -> None:
    limits = dict(zip(METHOD_NAMES, solved({"tableau": CASH_KARP}).state.limits, strict=True))
    assert [name for name, limit in limits.items() if limit == 0.0] == [
        "euler",
        "midpoint",
        "heun",
        "yours",
    ]


def test_the_limit_of_semi_implicit_euler() -> None:
    """h^2 k + 2 h d = 4 for q'' = -k q - d q'."""
    for friction in (0.0, 0.5):
        world = solved({"friction": friction})
        k, d = -world.params.plant.jacobian(np.zeros(2), 0.0)[1]
        assert world.state.limits[1] == pytest.approx((np.sqrt(d**2 + 4 * k) - d) / k, rel=1e-4)


def test_growth_crosses_one_at_the_limit() -> None:
    world = solved({"friction": 0.5})
    fields = LAB.fields(world.params, world.state)
    limits = dict(zip(METHOD_NAMES, fields["limits"], strict=True))
    for i, (name, limit) in enumerate(limits.items()):
        if np.isfinite(limit):
            growth = np.interp(limit, fields["growth_steps"], fields["growth"][:, i])
            assert growth == pytest.approx(1.0, abs=0.01), name
            assert fields["limit_steps"][0, i] == limit
        else:
            assert fields["limit_steps"][0, i] == 0.0
    assert np.isnan(limits["implicit"])


def test_local_errors_are_those_of_one_step() -> None:
    world = solved({})
    plant = world.params.plant
    middle = exact_solution(plant.vector_field, world.params.x0(), 0.0, 0.2)
    for h, error in zip(STEP_SIZES, world.state.local_errors[0], strict=True):
        wanted = (
            middle + h * plant.f(middle, 0.0) - exact_solution(plant.vector_field, middle, 0.0, h)
        )
        assert error == pytest.approx(np.linalg.norm(wanted), rel=1e-6)
    np.testing.assert_array_equal(world.state.costs[0], STEP_COUNTS)


def test_the_study_starts_again_when_the_tableau_changes() -> None:
    world = solved_world("integration", {})
    before = world.state.global_errors.copy()
    world.change({"tableau": "0 | ; | 1"})
    assert world.solving
    solve(world)
    np.testing.assert_array_equal(world.state.global_errors[7], before[0])
    np.testing.assert_array_equal(world.state.global_errors[:7], before[:7])
