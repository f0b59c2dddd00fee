"""Regulators: which gains a policy uses, and what is said where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from labs.optimal_control.lqr.comparison import COMPARED_HORIZONS, HORIZON_COUNT, compare
from labs.optimal_control.lqr.regulator import (
    LQR_POLICIES,
    RegulatorSettings,
    regulator,
    settling_step,
)

SETTINGS = RegulatorSettings("cart-pole", 0.02, (10.0, 20.0, 1.0, 2.0), 0.1, 60, "q", 1.0, "steady")


def test_weights_stand_where_they_belong() -> None:
    """Cart-pole x = (p, theta, p', theta'); every joint of the UR5 turns."""
    problem = regulator(SETTINGS).problem
    np.testing.assert_array_equal(problem.q, np.diag([10.0, 20.0, 1.0, 2.0]))
    np.testing.assert_array_equal(problem.r, [[0.1]])
    ur5 = regulator(replace(SETTINGS, system="ur5")).problem
    np.testing.assert_array_equal(np.diag(ur5.q), [20.0] * 6 + [2.0] * 6)
    np.testing.assert_array_equal(ur5.r, 0.1 * np.eye(6))


def test_what_each_policy_uses() -> None:
    steady, window, receding = (regulator(replace(SETTINGS, policy=p)) for p in LQR_POLICIES)
    assert steady.gains.shape == (1, 1, 4)
    assert window.gains.shape == (60, 1, 4)
    np.testing.assert_array_equal(receding.gains, window.gains[:1])
    assert len(steady.values) == 1
    assert len(window.values) == 60
    assert steady.steady is not None
    np.testing.assert_array_equal(steady.gains[0], steady.steady.gain)


def test_the_steady_states_p_as_final_weight_makes_every_gain_steady() -> None:
    law = regulator(replace(SETTINGS, final="p", policy="window", horizon=20))
    assert law.steady is not None
    np.testing.assert_allclose(law.gains, np.tile(law.steady.gain, (20, 1, 1)), rtol=1e-8)
    assert law.constant_gain_count == 20


def test_growth_of_one_step_and_of_a_whole_window() -> None:
    steady = regulator(SETTINGS)
    p = steady.problem
    assert steady.spectral_radius == pytest.approx(
        np.abs(np.linalg.eigvals(p.a + p.b @ steady.gains[0])).max()
    )
    window = regulator(replace(SETTINGS, policy="window", horizon=3, alpha=0.0))
    turn = np.eye(4)
    for gain in window.gains:
        turn = (p.a + p.b @ gain) @ turn
    assert window.spectral_radius**3 == pytest.approx(np.abs(np.linalg.eigvals(turn)).max())
    assert window.spectral_radius > 1.0


@pytest.mark.parametrize("system", ["cart-pole", "pendulum", "mass", "ur5"])
def test_recursion_and_scipy_agree(system: str) -> None:
    assert 0.0 <= regulator(replace(SETTINGS, system=system)).riccati_error < 1e-9


def test_shares_end_at_one_and_begin_at_the_final_weight() -> None:
    law = regulator(replace(SETTINGS, horizon=300))
    p, k = law.relative_to_steady()
    assert p.shape == (301, 4)
    assert k.shape == (300, 4)
    np.testing.assert_allclose(p[0], 1.0, rtol=1e-3)
    np.testing.assert_allclose(k[0], 1.0, rtol=1e-3)
    assert law.steady is not None
    np.testing.assert_allclose(p[-1], np.diag(law.problem.q) / np.diag(law.steady.value))
    assert regulator(replace(SETTINGS, system="ur5")).relative_to_steady()[1].shape == (60, 6)


def test_settled_is_the_last_step_before_which_all_are_constant() -> None:
    shares = np.ones((6, 2))
    assert settling_step(shares) == 5
    shares[4, 1] = 1.02
    assert settling_step(shares) == 3
    shares[0, 0] = 0.5
    assert settling_step(shares) == -1
    assert settling_step(np.zeros((0, 0))) == -1


def test_what_cannot_be_is_told() -> None:
    blind = (0.0, 10.0, 1.0, 1.0)
    for settings in (
        replace(SETTINGS, weights=blind),
        replace(SETTINGS, weights=blind, policy="window", final="p"),
    ):
        trouble = regulator(settings).trouble
        assert trouble.startswith(
            "There is no steady state to regulate to: Q does not see the mode"
        )
        assert trouble.endswith(".")
    window = regulator(replace(SETTINGS, weights=blind, policy="window"))
    assert window.trouble == ""
    assert window.steady is None
    assert window.riccati_error == -1.0


def test_least_squares_agrees_until_the_fall_has_eaten_its_digits() -> None:
    mass = regulator(replace(SETTINGS, system="mass")).problem
    pole = regulator(SETTINGS).problem
    differences = {}
    for name, p in (("mass", mass), ("cart-pole", pole)):
        assert len(COMPARED_HORIZONS[name]) == HORIZON_COUNT
        for horizon in (COMPARED_HORIZONS[name][0], COMPARED_HORIZONS[name][-1]):
            found = compare(replace(p, horizon=horizon))
            differences[name, horizon] = found.difference
            assert found.riccati > 0.0
            assert found.least_squares > 0.0
    assert differences["mass", 10] < 1e-13
    assert differences["mass", 260] < 1e-12
    assert differences["cart-pole", 10] < 1e-13
    assert 1e-8 < differences["cart-pole", 260] < 1e-2
