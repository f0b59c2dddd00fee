"""Runge-Kutta: measured orders against SciPy, conditions of order, Newton, and what is refused."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from labs.algorithms.integrators import INTEGRATORS
from labs.algorithms.runge_kutta import (
    EULER,
    MIDPOINT,
    RK4,
    TABLEAUS,
    Tableau,
    VectorField,
    gauss_legendre,
    order,
    order_conditions,
    parse_tableau,
    runge_kutta_integrate,
    runge_kutta_step,
)
from labs.errors import LabError

RALSTON = parse_tableau("0 |\n1/3 | 1/3\n2/3 | 0 2/3\n| 1/4 0 3/4")
LOBATTO = parse_tableau("0 |; 1/2 | 5/24 1/3 -1/24; 1 | 1/6 2/3 1/6; | 1/6 2/3 1/6")
ORDERS = {
    "euler": 1,
    "midpoint": 2,
    "heun": 2,
    "rk3": 3,
    "rk4": 4,
    "implicit-euler": 1,
    "implicit-midpoint": 2,
    "gauss-legendre": 4,
}
METHODS = [*((TABLEAUS[name], p) for name, p in ORDERS.items()), (RALSTON, 3), (LOBATTO, 4)]
IDS = [*ORDERS, "ralston", "lobatto"]
X0 = np.array([0.8, -0.5, 0.3])


def f(x: np.ndarray, t: float) -> np.ndarray:
    """Smooth, nonlinear, and different at every time."""
    return np.array(
        [x[1] + 0.3 * np.sin(3 * t), -4 * np.sin(x[0]) - 0.3 * x[1] * x[2], np.cos(x[0] + t) - x[2]]
    )


def jacobian(x: np.ndarray, t: float) -> np.ndarray:
    return np.array(
        [
            [0, 1, 0],
            [-4 * np.cos(x[0]), -0.3 * x[2], -0.3 * x[1]],
            [-np.sin(x[0] + t), 0, -1],
        ]
    )


FLOW = VectorField(f, jacobian)


@pytest.fixture(scope="module")
def exact() -> np.ndarray:
    solution = solve_ivp(
        lambda t, x: f(x, t), (0.0, 1.0), X0, method="DOP853", rtol=1e-13, atol=1e-14
    )
    end: np.ndarray = solution.y[:, -1]
    return end


def test_every_named_method_is_measured() -> None:
    assert set(ORDERS) == set(TABLEAUS)


@pytest.mark.parametrize(("tableau", "p"), METHODS, ids=IDS)
def test_the_measured_order_is_the_stated_one(tableau: Tableau, p: int, exact: np.ndarray) -> None:
    n = 40 if p == 4 else 160
    coarse, fine = (
        np.linalg.norm(runge_kutta_integrate(tableau, FLOW, X0, 1.0 / k, k)[0] - exact)
        for k in (n, 2 * n)
    )
    assert np.log2(coarse / fine) == pytest.approx(p, abs=0.1)
    assert order(tableau) == p


def test_gauss_legendre_of_three_stages_has_order_six(exact: np.ndarray) -> None:
    coarse, fine = (
        np.linalg.norm(runge_kutta_integrate(gauss_legendre(3), FLOW, X0, 1.0 / k, k)[0] - exact)
        for k in (8, 16)
    )
    assert np.log2(coarse / fine) == pytest.approx(6, abs=0.2)


def test_gauss_legendre_is_the_published_tableau() -> None:
    r = np.sqrt(3.0)
    two = gauss_legendre(2)
    np.testing.assert_allclose(two.a, [[1 / 4, 1 / 4 - r / 6], [1 / 4 + r / 6, 1 / 4]], atol=1e-15)
    np.testing.assert_allclose(two.b, [0.5, 0.5], atol=1e-15)
    np.testing.assert_allclose(two.c, [0.5 - r / 6, 0.5 + r / 6], atol=1e-15)
    np.testing.assert_allclose(gauss_legendre(1).a, [[0.5]])


def test_conditions_are_the_taylor_coefficients_of_trees() -> None:
    """By sums written out in full."""
    t = LOBATTO
    q = range(t.stages)
    found = [
        sum(t.b),
        sum(t.b[i] * t.c[i] for i in q),
        sum(t.b[i] * t.c[i] ** 2 for i in q),
        sum(t.b[i] * t.a[i, j] * t.c[j] for i in q for j in q),
        sum(t.b[i] * t.c[i] ** 3 for i in q),
        sum(t.b[i] * t.c[i] * t.a[i, j] * t.c[j] for i in q for j in q),
        sum(t.b[i] * t.a[i, j] * t.c[j] ** 2 for i in q for j in q),
        sum(t.b[i] * t.a[i, j] * t.a[j, k] * t.c[k] for i in q for j in q for k in q),
    ]
    wanted = [1, 1 / 2, 1 / 3, 1 / 6, 1 / 4, 1 / 8, 1 / 12, 1 / 24]
    np.testing.assert_allclose(order_conditions(t), np.subtract(found, wanted), atol=1e-15)
    assert order(parse_tableau("0 | ; 1/2 | 1/2; 1/2 | 0 1/2; 1 | 0 0 1; | 1/6 1/3 1/3 1/5")) == 0
    assert order(parse_tableau("0 | ; 1/2 | 1/2; | 1/2 1/2")) == 1
    assert order(parse_tableau("0 | ; 1/2 | 1/2; 1 | -1 2; | 1 -1 1")) == 2  # a negative weight


@pytest.mark.parametrize(
    ("name", "tableau"), [("explicit-euler", EULER), ("midpoint", MIDPOINT), ("rk4", RK4)]
)
def test_the_integrators_of_mechanisms_do_the_same(name: str, tableau: Tableau) -> None:
    rng = np.random.default_rng(0)
    q, v = rng.normal(size=(2, 3))

    def a(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        value: np.ndarray = np.sin(q[::-1]) - 0.2 * v * q
        return value

    field = VectorField(
        lambda x, t: np.concatenate([x[3:], a(x[:3], x[3:])]), lambda x, t: np.eye(6)
    )
    wanted = np.concatenate(INTEGRATORS[name].step(a, q, v, 0.1))
    found = runge_kutta_step(tableau, field, np.concatenate([q, v]), 0.0, 0.1)
    np.testing.assert_allclose(found.x, wanted, rtol=0, atol=1e-15)
    assert found.evaluations == tableau.stages


# Implicit methods ------------------------------------------------------------------------------


@pytest.mark.parametrize("tableau", [gauss_legendre(2), LOBATTO], ids=["gauss", "lobatto"])
def test_newton_finds_the_stages_scipy_finds(tableau: Tableau) -> None:
    h, t, q, n = 0.4, 0.7, tableau.stages, 3

    def defect(flat: np.ndarray) -> np.ndarray:
        k = flat.reshape(q, n)
        points = X0 + h * tableau.a @ k
        return np.ravel([k[i] - f(points[i], t + h * tableau.c[i]) for i in range(q)])

    k = root(defect, np.tile(f(X0, t), q), tol=1e-13).x.reshape(q, n)
    done = runge_kutta_step(tableau, FLOW, X0, t, h)
    np.testing.assert_allclose(done.x, X0 + h * tableau.b @ k, atol=1e-11)
    assert done.status == ""
    assert done.residual < 1e-11


def test_newton_needs_one_iteration_where_the_motion_is_linear() -> None:
    m = np.array([[0.0, 1.0], [-9.0, -0.5]])
    x, h = np.array([1.0, 2.0]), 0.3
    done = runge_kutta_step(
        gauss_legendre(1), VectorField(lambda x, t: m @ x, lambda x, t: m), x, 0.0, h
    )
    eye = np.eye(2)
    np.testing.assert_allclose(
        done.x, np.linalg.solve(eye - h / 2 * m, (eye + h / 2 * m) @ x), atol=1e-14
    )
    assert done.iterations == 1
    assert done.evaluations == 1 + 2 * 1 + 1 * 2


def test_newton_converges_quadratically() -> None:
    """With a wrong Jacobian it needs many more steps: the derivatives are what makes it fast."""
    right = runge_kutta_step(gauss_legendre(2), FLOW, X0, 0.0, 0.4)
    wrong = runge_kutta_step(
        gauss_legendre(2), VectorField(f, lambda x, t: 0.0 * jacobian(x, t)), X0, 0.0, 0.4
    )
    assert right.iterations <= 5
    assert wrong.iterations >= 3 * right.iterations


def test_a_newton_that_fails_says_so() -> None:
    field = VectorField(lambda x, t: x**2 + 1.0, lambda x, t: np.diag(2.0 * x))
    done = runge_kutta_step(TABLEAUS["implicit-euler"], field, np.array([1.0]), 0.0, 2.0)
    assert done.status.startswith("Newton's method found no stages in ")
    assert done.residual > 0.1
    assert np.isnan(
        runge_kutta_integrate(TABLEAUS["implicit-euler"], field, np.array([1.0]), 2.0, 3)[0]
    ).all()


def test_the_implicit_midpoint_rule_conserves_a_quadratic_energy() -> None:
    field = VectorField(
        lambda x, t: np.array([x[1], -x[0]]), lambda x, t: np.array([[0.0, 1.0], [-1.0, 0.0]])
    )
    x = np.array([1.0, 0.0])
    for tableau in (gauss_legendre(1), gauss_legendre(2)):
        end, _ = runge_kutta_integrate(tableau, field, x, 0.5, 1000)
        assert end @ end == pytest.approx(1.0, abs=1e-11)
    end, _ = runge_kutta_integrate(RK4, field, x, 0.5, 1000)
    assert end @ end == pytest.approx((1 - 0.5**6 / 72 + 0.5**8 / 576) ** 1000, rel=1e-10)


# Tableaus as text ------------------------------------------------------------------------------


def test_a_tableau_is_read_as_it_is_written() -> None:
    for text in ("0 |\n1/2 | .5\n\n | 0 1", " 0|;0.5|1/2 0;|0 1e0"):
        tableau = parse_tableau(text)
        np.testing.assert_array_equal(tableau.a, MIDPOINT.a)
        np.testing.assert_array_equal(tableau.b, MIDPOINT.b)
        np.testing.assert_array_equal(tableau.c, MIDPOINT.c)
        assert tableau.explicit
    assert not LOBATTO.explicit


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "at least two rows"),
        ("| 1", "at least two rows"),
        ("\n".join(["0 |"] * 7 + ["| 1"]), "7 rows of stages; at most 6"),
        ("0 |; 1/2 1/2; | 0 1", "row 2 ('1/2 1/2') has no bar"),
        ("0 |; | 1/2; | 0 1", "row 2 ('| 1/2') needs one number, c"),
        ("0 |; 1/2 | 1/3; | 0 1", "row 2: c = 0.5 but its a add up to 0.333333"),
        ("0 |; 1/2 | 1/0; | 0 1", "row 2: '1/0' is no number"),
        ("0 |; 1/2 | half; | 0 1", "row 2: 'half' is no number"),
        ("0 |; nan | nan; | 0 1", "row 2: 'nan' is no number"),
        ("0 |; 1e9 | 1e9; | 0 1", "row 2: 1e9 is beyond"),
        ("0 |; 1 | 1 0 0; | 0 1", "row 2 has 3 weights; there are 2 stages"),
        ("0 |; 1/2 | 1/2; 1 | 0 1", "the last row ('1 | 0 1') holds the weights b"),
        ("0 |; 1/2 | 1/2; | 1", "the last row has 1 weights b; there are 2 stages"),
        ("0 |; 1/2 | 1/2; | 1 x", "the last row: 'x' is no number"),
    ],
)
def test_what_is_no_tableau_is_refused_by_row(text: str, sentence: str) -> None:
    with pytest.raises(LabError) as refusal:
        parse_tableau(text)
    assert sentence in str(refusal.value)
