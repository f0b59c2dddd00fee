"""Runge-Kutta: measured orders against SciPy, conditions of order, Newton, and what is refused."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from labs.algorithms.butcher_tableau import Tableau, parse_tableau
from labs.algorithms.integrators import INTEGRATORS
from labs.algorithms.runge_kutta import (
    EULER,
    MIDPOINT,
    RK4,
    TABLEAUS,
    VectorField,
    gauss_legendre,
    order,
    order_conditions,
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


BOOKS = {
    # Fehlberg 1969, Cash and Karp 1990, Dormand and Prince 1980, as books print them, with the
    # orders of their first and their second row of weights.
    "rkf45": (
        """0 |
1/4   | 1/4
3/8   | 3/32       9/32
12/13 | 1932/2197 -7200/2197 7296/2197
1     | 439/216   -8         3680/513  -845/4104
1/2   | -8/27      2        -3544/2565 1859/4104 -11/40
---------------------------------------------------
      | 25/216     0         1408/2565 2197/4104 -1/5
      | 16/135     0         6656/12825 28561/56430 -9/50 2/55""",
        (4, 5),
    ),
    "cash-karp": (
        """\ufeff0 |
1/5 | 1/5
3/10 | 3/40, 9/40
3/5 | 3/10, -9/10, 6/5
1 | -11/54, 5/2, -70/27, 35/27
7/8 | 1631/55296, 175/512, 575/13824, 44275/110592, 253/4096
| 37/378, 0, 250/621, 125/594, 0, 512/1771
| 2825/27648, 0, 18575/48384, 13525/55296, 277/14336, 1/4""",
        (5, 4),
    ),
    "dormand-prince": (
        r"""\begin{array}{c|ccccccc}
0 & \\
\frac{1}{5} & \frac{1}{5} \\
\frac{3}{10} & \frac{3}{40} & \frac{9}{40} \\
\frac{4}{5} & \frac{44}{45} & -\frac{56}{15} & \frac{32}{9} \\
\frac{8}{9} & \frac{19372}{6561} & -\frac{25360}{2187} & \frac{64448}{6561} & -\frac{212}{729} \\
1 & \frac{9017}{3168} & -\frac{355}{33} & \frac{46732}{5247} & \frac{49}{176} & -5103/18656 \\
1 & 35/384 & 0 & 500/1113 & 125/192 & -2187/6784 & 11/84 \\ \hline
& 35/384 & 0 & 500/1113 & 125/192 & -2187/6784 & 11/84 & 0 \\
& 5179/57600 & 0 & 7571/16695 & 393/640 & -92097/339200 & 187/2100 & 1/40
\end{array}""",
        (5, 4),
    ),
}


@pytest.mark.parametrize("name", BOOKS)
@pytest.mark.parametrize("pick", [0, 1])
def test_pairs_of_books_have_their_orders(name: str, pick: int, exact: np.ndarray) -> None:
    text, orders = BOOKS[name]
    tableau = parse_tableau(text, pick)
    assert parse_tableau(tableau.text).text == tableau.text
    assert order(tableau) == 4, "as far as it is told"
    coarse, fine = (
        np.linalg.norm(runge_kutta_integrate(tableau, FLOW, X0, 1.0 / k, k)[0] - exact)
        for k in (12, 24)
    )
    assert np.log2(coarse / fine) == pytest.approx(orders[pick], abs=0.5)


@pytest.mark.parametrize(
    "text",
    [
        "0 |\n50 % | 50 %\n| 0 100 %",
        "sep=;\n0;;\n0,5;0,5;\n;0;1",
        "\ufeff0;;\r\n1/2;1/2;\r\n;;1;\r\n",
        "0,,\n0.5,0.5,\n,0,1",
        '"0"\t\n"50 %"\t"1/2"\n\t0\t1',
        "sep=;\n0 |\n1/2 | 1/2\n| 0 1",
        "% midpoint\n0 & \\\\ % first\n1/2 & 1/2 \\\\\n& 0 & 1 # weights",
    ],
    ids=["per cent", "sep", "excel", "commas", "tabs", "sep and bars", "comments"],
)
def test_spreadsheets_and_comments_are_read(text: str) -> None:
    tableau = parse_tableau(text)
    np.testing.assert_array_equal(tableau.a, MIDPOINT.a)
    np.testing.assert_array_equal(tableau.b, MIDPOINT.b)


def test_decimals_of_nine_digits_are_near_enough() -> None:
    rows = "0 |\n0.333333333 | 0.3333333337\n0.6666666667 | 0 0.666666667\n| 1/4 0 3/4"
    assert order(parse_tableau(rows)) == 3
    assert parse_tableau("0 |\n1 | 1\n| 0,5 0,5").b.tolist() == [0.5, 0.5]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "at least two rows"),
        ("| 1", "at least two rows"),
        ("\n".join(["0 |"] * 8 + ["| 1"]), "8 rows of stages; at most 7"),
        ("0 |; 1/2 1/2; | 0 1", "row 2 ('1/2 1/2') has no bar"),
        ("0 |; 1/2 3 | 1/2; | 0 1", "row 2 ('1/2 3 | 1/2') needs one number, c"),
        ("0 |; | 1/2; | 0 1", "row 2 of b has 2 weights; there are 1 stages"),
        ("0 |; 1 | 1; | 0 1; | 0 1; | 0 1", "3 rows of weights b at the end"),
        ("0 |; 1/2 | 1/3; | 0 1", "row 2: c = 0.5 but its a add up to 0.3333333333, -0.17 off"),
        ("0 |; 1 | 1.0000001; | 0 1", "c = 1 but its a add up to 1.0000001, +1e-07 off"),
        ("0 |; 1/2 | 1/0; | 0 1", "row 2: '1/0' is no number"),
        ("0 |; 1/2 | half; | 0 1", "row 2: 'half' is no number"),
        ("0 |; nan | nan; | 0 1", "row 2: 'nan' is no number"),
        ("0 |; 1e9 | 1e9; | 0 1", "row 2: 1e9 is beyond"),
        ("0 |; 1 | 1 0 1; | 0 1", "row 2 has 3 weights; there are 2 stages"),
        ("0 |; 1/2 | 1/2; 1 | 0 1", "the last row ('1 | 0 1') holds the weights b"),
        ("0 |; 1/2 | 1/2; | 1/2", "the last row has 1 weights b; there are 2 stages"),
        ("0 |; 1/2 | 1/2; | 1 x", "the last row: 'x' is no number"),
    ],
)
def test_what_is_no_tableau_is_refused_by_row(text: str, sentence: str) -> None:
    with pytest.raises(LabError) as refusal:
        parse_tableau(text)
    assert sentence in str(refusal.value)
