"""Stability functions against exact expansions, and the limits they set."""

from math import factorial

import numpy as np
import pytest

from labs.algorithms.absolute_stability import (
    StabilityFunction,
    bisect_stability_limit,
    largest_stable_step,
    reversed_characteristic_polynomial,
    stability_boundary,
)
from labs.algorithms.butcher_tableau import Tableau, parse_tableau
from labs.algorithms.runge_kutta import TABLEAUS, VectorField, order, runge_kutta_step

R = {name: StabilityFunction.of(tableau) for name, tableau in TABLEAUS.items()}


def linear(m: np.ndarray) -> VectorField:
    """x' = M x."""
    return VectorField(lambda x, t: m @ x, lambda x, t: m)


@pytest.mark.parametrize(
    ("name", "p"), [("euler", 1), ("midpoint", 2), ("heun", 2), ("rk3", 3), ("rk4", 4)]
)
def test_explicit_methods_of_order_q_truncate_the_exponential(name: str, p: int) -> None:
    np.testing.assert_allclose(R[name].p, [1 / factorial(k) for k in range(p + 1)], atol=1e-15)
    np.testing.assert_array_equal(R[name].q, [1.0])


@pytest.mark.parametrize(
    ("name", "p", "q"),
    [
        ("implicit-euler", [1.0], [1.0, -1.0]),
        ("implicit-midpoint", [1.0, 0.5], [1.0, -0.5]),
        ("gauss-legendre", [1.0, 0.5, 1 / 12], [1.0, -0.5, 1 / 12]),
    ],
)
def test_implicit_ones_are_pades(name: str, p: list[float], q: list[float]) -> None:
    np.testing.assert_allclose(R[name].p, p, atol=1e-15)
    np.testing.assert_allclose(R[name].q, q, atol=1e-15)


@pytest.mark.parametrize("name", TABLEAUS)
def test_a_step_multiplies_by_r(name: str) -> None:
    """On x' = lambda x, complex lambda as a rotation with damping in the plane."""
    for lam in (-1.0 + 2.0j, 0.3 - 0.7j, 4.0j):
        m = np.array([[lam.real, -lam.imag], [lam.imag, lam.real]])
        x = runge_kutta_step(TABLEAUS[name], linear(m), np.array([1.0, 0.0]), 0.0, 0.3).x
        wanted = R[name](np.array(0.3 * lam))
        np.testing.assert_allclose(x, [wanted.real, wanted.imag], atol=1e-13)


def test_the_reversed_characteristic_polynomial_is_the_determinant() -> None:
    m = np.random.default_rng(0).normal(size=(4, 4))
    found = reversed_characteristic_polynomial(m)
    for z in (0.3, -1.2, 2.0):
        wanted = np.linalg.det(np.eye(4) - z * m)
        assert np.polynomial.polynomial.polyval(z, found) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("name", ["euler", "midpoint", "rk3", "rk4", "implicit-euler"])
def test_the_boundary_is_where_r_has_modulus_one_and_closes(name: str) -> None:
    edge = stability_boundary(R[name], reach=8.0)
    np.testing.assert_allclose(np.abs(R[name](edge)), 1.0, atol=1e-12)
    assert abs(edge[0] - edge[-1]) < 1e-9
    assert np.abs(np.diff(edge)).max() < 0.15, "no jumps"
    assert np.abs(edge).min() < 1e-5, "it passes through 0"
    # Symmetric about the real axis, and reaching as far to the left as the real limit.
    assert edge.imag.max() == pytest.approx(-edge.imag.min(), abs=1e-3)
    limit = largest_stable_step(R[name], np.array([-1.0]))
    if np.isfinite(limit):
        axis = edge[np.abs(edge.imag) < 0.03].real
        assert axis.min() == pytest.approx(-limit, abs=1e-3)


def test_the_boundary_of_gauss_legendre_is_the_imaginary_axis() -> None:
    for name in ("implicit-midpoint", "gauss-legendre"):
        edge = stability_boundary(R[name], reach=5.0)
        assert np.abs(edge.real).max() < 1e-10
        assert edge.imag.max() > 4.0
        assert edge.imag.min() < -4.0


def test_odd_tableaus_have_a_boundary_or_none() -> None:
    assert len(stability_boundary(StabilityFunction.of(parse_tableau("0 | ; | 0")), 4.0)) == 0
    for text in ("0 | ; 1 | 1; | 1/2 -1/2", "0 | ; 0 | 0; 0 | 0; | 1 1 1", "1 | 1; | 100"):
        edge = stability_boundary(StabilityFunction.of(parse_tableau(text)), 4.0)
        assert np.isfinite(edge).all()


SQRT3, SQRT8 = np.sqrt(3.0), np.sqrt(8.0)


@pytest.mark.parametrize(
    ("name", "imaginary", "real"),
    [
        ("euler", 0.0, 2.0),
        ("midpoint", 0.0, 2.0),
        ("heun", 0.0, 2.0),
        ("rk3", SQRT3, 2.512745326618329),
        ("rk4", SQRT8, 2.785293563405282),
        ("implicit-euler", np.inf, np.inf),
        ("implicit-midpoint", np.inf, np.inf),
        ("gauss-legendre", np.inf, np.inf),
    ],
)
def test_the_largest_steps_are_the_published_ones(name: str, imaginary: float, real: float) -> None:
    assert largest_stable_step(R[name], np.array([2.0j, -2.0j])) == pytest.approx(imaginary / 2)
    assert largest_stable_step(R[name], np.array([-0.5, 0.0])) == pytest.approx(real * 2)


CASH_KARP = parse_tableau(
    """0 |
    1/5  | 1/5
    3/10 | 3/40 9/40
    3/5  | 3/10 -9/10 6/5
    1    | -11/54 5/2 -70/27 35/27
    7/8  | 1631/55296 175/512 575/13824 44275/110592 253/4096
    | 37/378 0 250/621 125/594 0 512/1771"""
)


def chebyshev(stages: int, damping: float) -> tuple[Tableau, float]:
    """The tableau, one stage after the other, of the stabilised method R(z) = T_s(w0 + w1 z) /
    T_s(w0) with w0 = 1 + damping / s^2 and R'(0) = 1; and how far |R| <= 1 goes on the negative
    real axis: T_s stays within its value at w0 down to -w0. (Hairer, Wanner, II, IV.2.)"""
    t = np.polynomial.Chebyshev.basis(stages)
    w0 = 1.0 + damping / stages**2
    w1 = t(w0) / t.deriv()(w0)
    in_powers = t.convert(kind=np.polynomial.Polynomial)
    p: np.ndarray = (in_powers(np.polynomial.Polynomial([w0, w1])) / t(w0)).coef
    a = np.diag((p[2:] / p[1:-1])[::-1], -1)
    return Tableau(a, p[1] * np.eye(stages)[-1], a.sum(axis=1)), 2.0 * w0 / w1


@pytest.mark.parametrize("damping", [0.0, 0.01, 0.05, 0.3])
@pytest.mark.parametrize("stages", range(1, 7))
def test_a_stabilised_method_keeps_the_small_coefficients_that_limit_it(
    stages: int, damping: float
) -> None:
    """Without damping |R| touches 1 between and must not stop there."""
    tableau, wanted = chebyshev(stages, damping)
    found = largest_stable_step(StabilityFunction.of(tableau), np.array([-0.5]))
    assert found == pytest.approx(2.0 * wanted, rel=1e-8)


def test_the_limit_of_six_damped_stages() -> None:
    tableau, wanted = chebyshev(6, 0.05)
    assert wanted == pytest.approx(69.757, abs=5e-4)
    w0 = 1.0 + 0.05 / 36
    t6 = np.cosh(6.0 * np.arccosh(w0))
    last = 32.0 * (2.0 * w0 / wanted) ** 6 / t6
    assert last < 2e-8
    assert StabilityFunction.of(tableau).p[-1] == pytest.approx(last, rel=1e-11)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_limit_scales_with_time(scale: float) -> None:
    tableau, wanted = chebyshev(6, 0.05)
    r = StabilityFunction.of(tableau)
    assert largest_stable_step(r, np.array([-scale])) == pytest.approx(wanted / scale, rel=1e-8)


def test_cash_karp_has_no_stable_step_without_friction() -> None:
    """Order 5 in six stages: on the imaginary axis |R|^2 - 1 = 2 (1/720 - p_6) s^6 + ...; it grows
    by 1e-7 only at s = 0.2."""
    assert order(CASH_KARP) == 4  # "or more"
    r = StabilityFunction.of(CASH_KARP)
    assert r.p[5] == pytest.approx(1 / 120, rel=1e-14)
    assert largest_stable_step(r, np.array([5.4j, -5.4j])) == 0.0
    s = 0.1
    assert abs(r(np.array(1j * s))) - 1.0 == pytest.approx((1 / 720 - r.p[6]) * s**6, rel=0.01)
    # Hardly any friction, and there is a limit.
    assert 0.0 < largest_stable_step(r, np.array([5.4j - 1e-6])) < 0.1


def test_a_reducible_tableau_has_the_limit_of_what_it_reduces_to() -> None:
    twice = parse_tableau("0 | ; 1/2 | 0 1/2; | 1 0")  # the second stage, implicit, is not used
    assert largest_stable_step(StabilityFunction.of(twice), np.array([-1.0])) == pytest.approx(2.0)


def test_the_limit_of_euler_on_a_damped_oscillation() -> None:
    lam = -1.2 + 5.29j
    found = largest_stable_step(R["euler"], np.array([lam, lam.conjugate()]))
    assert found == pytest.approx(2.4 / abs(lam) ** 2, rel=1e-12)


@pytest.mark.parametrize("name", ["euler", "midpoint", "rk3", "rk4"])
def test_theory_and_the_limit_found_by_raising_h_agree(name: str) -> None:
    m = np.array([[0.0, 1.0], [-25.0, -2.0]])
    field = linear(m)

    def growth(h: float) -> float:
        columns = [runge_kutta_step(TABLEAUS[name], field, unit, 0.0, h).x for unit in np.eye(2)]
        return float(np.abs(np.linalg.eigvals(np.array(columns))).max())

    theory = largest_stable_step(R[name], np.linalg.eigvals(m))
    assert bisect_stability_limit(growth, 1e-3, 2.0) == pytest.approx(theory, rel=1e-5)
    for h, grows in ((0.98 * theory, False), (1.02 * theory, True)):
        x = np.array([1e-3, 0.0])
        for _ in range(2000):
            x = runge_kutta_step(TABLEAUS[name], field, x, 0.0, h).x
        assert (np.linalg.norm(x) > 1e-2) == grows


def test_a_limit_that_is_not_there_is_zero_or_infinite() -> None:
    assert bisect_stability_limit(lambda h: 1.1, 0.01, 2.0) == 0.0
    assert bisect_stability_limit(lambda h: 0.9, 0.01, 2.0) == np.inf
    assert bisect_stability_limit(lambda h: h, 0.01, 2.0) == pytest.approx(1.0, abs=1e-6)
