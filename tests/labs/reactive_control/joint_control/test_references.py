"""The references: derivatives by finite differences, and their landmarks."""

import numpy as np
import pytest

from labs.reactive_control.joint_control.references import (
    MOVE_SHARE,
    PROFILES,
    cycles_per_second,
    reference_motion,
)

HOME = np.array([0.1, -0.7, 2.0])


@pytest.mark.parametrize("name", PROFILES)
def test_derivatives_match_finite_differences(name: str) -> None:
    rate, d = 0.37, 1e-5
    # Away from the corners of the minimum-jerk acceleration's derivative.
    t = np.linspace(0.011, 6.007, 97)
    here, ahead, behind = (
        reference_motion(name, HOME, 0.6, rate, rate * s) for s in (t, t + d, t - d)
    )
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * d), here[1], atol=2e-9)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * d), here[2], atol=2e-8)


@pytest.mark.parametrize("name", PROFILES)
def test_a_reference_repeats_with_every_cycle(name: str) -> None:
    phase = np.linspace(0.0, 0.99, 23)
    for first, second in zip(
        reference_motion(name, HOME, 0.6, 0.5, phase),
        reference_motion(name, HOME, 0.6, 0.5, phase + 3),
        strict=True,
    ):
        np.testing.assert_allclose(first, second, atol=1e-12)


def test_the_sinusoid_has_the_frequency_and_amplitude_asked_for() -> None:
    assert cycles_per_second("sinusoid", 0.4, 9.0) == 0.4
    q, v, a = reference_motion("sinusoid", HOME, 0.3, 0.4, np.array([0.0, 0.25]))
    np.testing.assert_allclose(q[:, 1] - HOME[1], [0.0, 0.3], atol=1e-15)
    np.testing.assert_allclose(v[:, 1], [0.3 * 2 * np.pi * 0.4, 0.0], atol=1e-15)
    np.testing.assert_allclose(a[:, 1], [0.0, -0.3 * (2 * np.pi * 0.4) ** 2], atol=1e-14)


def test_a_set_point_stands() -> None:
    q, v, a = reference_motion("set-point", HOME, 0.3, 0.0, np.zeros(4))
    np.testing.assert_array_equal(q, np.tile(HOME + 0.3, (4, 1)))
    assert not v.any()
    assert not a.any()


def test_minimum_jerk_moves_rests_and_comes_back() -> None:
    duration, amplitude = 1.2, 0.5
    rate = cycles_per_second("minimum-jerk", 9.0, duration)
    times = np.array(
        [0.0, duration, 1.4 * duration, 1.5 * duration, 2.5 * duration, 2.9 * duration]
    )
    q, v, a = reference_motion("minimum-jerk", HOME, amplitude, rate, rate * times)
    np.testing.assert_allclose(q[:, 0] - HOME[0], [0, 0.5, 0.5, 0.5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(v, 0.0, atol=1e-12)
    np.testing.assert_allclose(a, 0.0, atol=1e-10)
    _, middle, _ = reference_motion(
        "minimum-jerk", HOME, amplitude, rate, np.array([MOVE_SHARE / 2])
    )
    assert middle[0, 0] == pytest.approx(1.875 * amplitude / duration)


def test_minimum_jerk_has_less_jerk_than_its_neighbours() -> None:
    """Adding any shape that keeps both ends at rest raises the integral of squared jerk."""
    r = np.linspace(0.0, 1.0, 20_001)
    s, _, _ = PROFILES["minimum-jerk"](r * MOVE_SHARE * (1 - 1e-12), 1.0)
    polynomial = np.polynomial.Polynomial(np.polynomial.polynomial.polyfit(r, s, 5))
    np.testing.assert_allclose(polynomial(r), s, atol=1e-9)
    bump = np.polynomial.Polynomial([0, 0, 0, 1, -3, 3, -1])
    for shape in (bump, bump * np.polynomial.Polynomial([1, -2])):
        least = (polynomial.deriv(3) ** 2).integ()
        for size in (0.5, -0.5):
            more = ((polynomial + size * shape).deriv(3) ** 2).integ()
            assert more(1) - more(0) > least(1) - least(0) + 1e-3
