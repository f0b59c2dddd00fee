"""Stability functions against exact expansions, and the limits they set."""

from math import factorial

import numpy as np
import pytest

from labs.algorithms.absolute_stability import (
    StabilityFunction,
    boundary,
    largest_step,
    measured_limit,
    reversed_characteristic,
    spectral_radius,
)
from labs.algorithms.runge_kutta import TABLEAUS, Flow, parse, step

R = {name: StabilityFunction.of(tableau) for name, tableau in TABLEAUS.items()}


def linear(m: np.ndarray) -> Flow:
    """x' = M x."""
    return Flow(lambda x, t: m @ x, lambda x, t: m)


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
        x = step(TABLEAUS[name], linear(m), np.array([1.0, 0.0]), 0.0, 0.3).x
        wanted = R[name](np.array(0.3 * lam))
        np.testing.assert_allclose(x, [wanted.real, wanted.imag], atol=1e-13)


def test_the_reversed_characteristic_polynomial_is_the_determinant() -> None:
    m = np.random.default_rng(0).normal(size=(4, 4))
    found = reversed_characteristic(m)
    for z in (0.3, -1.2, 2.0):
        wanted = np.linalg.det(np.eye(4) - z * m)
        assert np.polynomial.polynomial.polyval(z, found) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("name", ["euler", "midpoint", "rk3", "rk4", "implicit-euler"])
def test_the_boundary_is_where_r_has_modulus_one_and_closes(name: str) -> None:
    edge = boundary(R[name], reach=8.0)
    np.testing.assert_allclose(np.abs(R[name](edge)), 1.0, atol=1e-12)
    assert abs(edge[0] - edge[-1]) < 1e-9
    assert np.abs(np.diff(edge)).max() < 0.15, "no jumps"
    assert np.abs(edge).min() < 1e-5, "it passes through 0"
    # Symmetric about the real axis, and reaching as far to the left as the real limit.
    assert edge.imag.max() == pytest.approx(-edge.imag.min(), abs=1e-3)
    limit = largest_step(R[name], np.array([-1.0]))
    if np.isfinite(limit):
        axis = edge[np.abs(edge.imag) < 0.03].real
        assert axis.min() == pytest.approx(-limit, abs=1e-3)


def test_the_boundary_of_gauss_legendre_is_the_imaginary_axis() -> None:
    for name in ("implicit-midpoint", "gauss-legendre"):
        edge = boundary(R[name], reach=5.0)
        assert np.abs(edge.real).max() < 1e-10
        assert edge.imag.max() > 4.0
        assert edge.imag.min() < -4.0


def test_odd_tableaus_have_a_boundary_or_none() -> None:
    assert len(boundary(StabilityFunction.of(parse("0 | ; | 0")), 4.0)) == 0
    for text in ("0 | ; 1 | 1; | 1/2 -1/2", "0 | ; 0 | 0; 0 | 0; | 1 1 1", "1 | 1; | 100"):
        edge = boundary(StabilityFunction.of(parse(text)), 4.0)
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
    assert largest_step(R[name], np.array([2.0j, -2.0j])) == pytest.approx(imaginary / 2)
    assert largest_step(R[name], np.array([-0.5, 0.0])) == pytest.approx(real * 2)


def test_the_limit_of_euler_on_a_damped_oscillation() -> None:
    lam = -1.2 + 5.29j
    found = largest_step(R["euler"], np.array([lam, lam.conjugate()]))
    assert found == pytest.approx(2.4 / abs(lam) ** 2, rel=1e-12)


@pytest.mark.parametrize("name", ["euler", "midpoint", "rk3", "rk4"])
def test_theory_and_the_limit_found_by_raising_h_agree(name: str) -> None:
    m = np.array([[0.0, 1.0], [-25.0, -2.0]])
    flow = linear(m)

    def growth(h: float) -> float:
        return spectral_radius(lambda x: step(TABLEAUS[name], flow, x, 0.0, h).x, 2, 1e-3)

    theory = largest_step(R[name], np.linalg.eigvals(m))
    assert measured_limit(growth, 1e-3, 2.0) == pytest.approx(theory, rel=1e-5)
    for h, grows in ((0.98 * theory, False), (1.02 * theory, True)):
        x = np.array([1e-3, 0.0])
        for _ in range(2000):
            x = step(TABLEAUS[name], flow, x, 0.0, h).x
        assert (np.linalg.norm(x) > 1e-2) == grows


def test_a_limit_that_is_not_there_is_zero_or_infinite() -> None:
    assert measured_limit(lambda h: 1.1, 0.01, 2.0) == 0.0
    assert measured_limit(lambda h: 0.9, 0.01, 2.0) == np.inf
    assert measured_limit(lambda h: h, 0.01, 2.0) == pytest.approx(1.0, abs=1e-6)
