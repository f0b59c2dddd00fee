"""The systems to regulate: exact where they are linear, the simulation's derivatives elsewhere."""

import numpy as np
import pytest

from labs.algorithms.stabilizability import unstabilizable_modes
from labs.errors import LabError
from labs.optimal_control.lqr.linear_systems import LINEAR_SYSTEMS, SIMULATION_STEP, linear_system

PERIODS = (0.01, 0.05, 0.2)


@pytest.mark.parametrize("period", PERIODS)
def test_the_mass_is_a_double_integrator(period: float) -> None:
    a, b = linear_system("mass").linear(period)
    np.testing.assert_allclose(a, [[1.0, period], [0.0, 1.0]], atol=1e-14)
    np.testing.assert_allclose(b, [[period**2 / 2], [period]], atol=1e-14)


@pytest.mark.parametrize("name", LINEAR_SYSTEMS)
@pytest.mark.parametrize("period", PERIODS)
def test_a_and_b_are_the_derivatives_of_the_simulation(name: str, period: float) -> None:
    """By central differences over as many steps as the world does in a period."""
    system = linear_system(name)

    def after(x: np.ndarray, u: np.ndarray) -> np.ndarray:
        for _ in range(round(period / SIMULATION_STEP)):
            x = system.step(x, u)
        return x

    a, b = system.linear(period)
    eps = 1e-5
    for i, e in enumerate(eps * np.eye(system.nx)):
        column = after(system.x_eq + e, system.u_eq) - after(system.x_eq - e, system.u_eq)
        np.testing.assert_allclose(column / (2 * eps), a[:, i], atol=1e-6)
    for i, e in enumerate(eps * np.eye(system.nu)):
        column = after(system.x_eq, system.u_eq + e) - after(system.x_eq, system.u_eq - e)
        np.testing.assert_allclose(column / (2 * eps), b[:, i], atol=1e-6)


@pytest.mark.parametrize("name", LINEAR_SYSTEMS)
def test_it_rests_where_it_should_and_can_be_regulated(name: str) -> None:
    system = linear_system(name)
    np.testing.assert_allclose(system.step(system.x_eq, system.u_eq), system.x_eq, atol=1e-9)
    assert len(unstabilizable_modes(*system.linear(0.02))) == 0
    assert system.out_of_range(system.x_eq) == ""


def test_upright_is_unstable_and_a_mass_is_not() -> None:
    assert np.abs(np.linalg.eigvals(linear_system("pendulum").linear(0.02)[0])).max() > 1.1
    assert np.abs(np.linalg.eigvals(linear_system("cart-pole").linear(0.02)[0])).max() > 1.1
    assert np.linalg.eigvals(linear_system("mass").linear(0.02)[0]) == pytest.approx([1.0, 1.0])


def test_a_force_on_the_tip_accelerates_the_mass() -> None:
    """f = 3 N along y for 10 ms on 1 kg; a force along z moves nothing."""
    system = linear_system("mass")
    x = system.step(system.x_eq, np.zeros(1), lambda tip: np.array([0.0, 3.0, 5.0]))
    np.testing.assert_allclose(x, [3.0 * SIMULATION_STEP**2 / 2, 3.0 * SIMULATION_STEP], atol=1e-14)


def test_a_force_on_the_poles_tip_is_a_torque_about_its_hinge() -> None:
    """Upright, f along +y at the tip of a rod 0.5 m long turns it by -0.5 f."""
    system = linear_system("pendulum")
    pushed = system.step(system.x_eq, np.zeros(1), lambda tip: np.array([0.0, 2.0, 0.0]))
    turned = system.step(system.x_eq, np.array([-1.0]))
    np.testing.assert_allclose(pushed, turned, atol=1e-5)


@pytest.mark.parametrize(
    ("name", "x", "why"),
    [
        ("cart-pole", [1.6, np.pi, 0.0, 0.0], "ran off its rail, 1.5 m"),
        ("cart-pole", [0.0, 6 * np.pi, 0.0, 0.0], "turned twice round"),
        ("pendulum", [np.pi, 101.0], "passed 100"),
        ("mass", [np.nan, 0.0], "ran off its rail"),
    ],
)
def test_what_is_lost_says_why(name: str, x: list[float], why: str) -> None:
    assert why in linear_system(name).out_of_range(np.array(x))


def test_wrong_names_and_periods_are_refused() -> None:
    with pytest.raises(LabError, match=r"no linear system is named 'boat'; there are cart-pole"):
        linear_system("boat")
    for period in (0.005, 0.015, 0.0):
        with pytest.raises(LabError, match=r"takes whole steps of 0\.01 s, one at least"):
            linear_system("mass").linear(period)
