"""The sampled loop: when the controller looks, what it holds, where it cuts."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from labs.algorithms.integrators import INTEGRATORS
from labs.reactive_control.joint_control.sampled_control import (
    SampledLoop,
    control_ticks,
    simulate_sampled,
    time_between_ticks,
    to_time_units,
)

HOME = np.zeros(2)
FREE = np.full(2, np.inf)


def loop(limit: np.ndarray = FREE, gain: float = 0.0, h: float = 1e-3) -> SampledLoop:
    """Two unit masses, k_p = 30, k_d = 2, k_z = 7, and a little nonlinear pull."""
    held = np.zeros(2)
    return SampledLoop(
        law=lambda q, v, z, q_ref, v_ref, a_ref: 30 * (q_ref - q) + 2 * (v_ref - v) + 7 * z,
        limit=limit,
        acceleration=lambda q, v: held - np.sin(q),
        held=held,
        integrate=INTEGRATORS["rk4"].step,
        h=h,
        integral_gain=gain,
    )


def references(m: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return np.tile([0.5, -0.2], (m, 1)), np.zeros((m, 2)), np.zeros((m, 2))


@pytest.mark.parametrize(
    ("since", "period", "step", "steps", "due", "left"),
    [
        (500, 10, 10, 10, tuple(range(10)), 10),
        (500, 10, 1, 100, tuple(range(0, 100, 10)), 10),
        (500, 500, 10, 10, (0,), 100),
        (100, 500, 10, 10, (), 200),
        (500, 500, 100, 1, (0,), 100),
        (400, 10, 100, 1, (0,), 100),
        (500, 50, 20, 5, (0, 3), 40),
        (40, 50, 20, 5, (1, 4), 20),
    ],
)
def test_ticks_fall_on_the_first_step_at_or_after_their_time(
    since: int, period: int, step: int, steps: int, due: tuple[int, ...], left: int
) -> None:
    assert control_ticks(since, period, step, steps) == (due, left)


def test_the_time_between_ticks_is_rounded_up_to_whole_steps() -> None:
    assert time_between_ticks(to_time_units(0.005), to_time_units(0.002)) == 60
    assert time_between_ticks(to_time_units(0.001), to_time_units(0.01)) == 100
    assert time_between_ticks(to_time_units(0.05), to_time_units(0.0001)) == 500


def test_the_torque_is_held_between_ticks() -> None:
    """Against a tight adaptive integration of every stretch between two ticks."""
    due, steps, gain = (2, 5, 9), 12, 0.003
    one = loop(gain=gain)
    one.held[:] = [1.0, -2.0]
    zeros = np.zeros(2)
    q, v, z, torques = simulate_sampled(one, due, steps, references(3), None, zeros, zeros, zeros)

    x, integral, tau = np.zeros(4), np.zeros(2), np.array([1.0, -2.0])
    applied = []
    for k in range(steps):
        if k in due:
            error = np.array([0.5, -0.2]) - x[:2]
            tau = 30 * error - 2 * x[2:] + 7 * integral
            integral = integral + gain * error
            applied.append(tau)
        x = solve_ivp(
            lambda t, x, tau=tau: np.concatenate([x[2:], tau - np.sin(x[:2])]),
            (0.0, 1e-3),
            x,
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
        ).y[:, -1]
    np.testing.assert_allclose(np.concatenate([q, v]), x, rtol=1e-10, atol=1e-13)
    np.testing.assert_allclose(z, integral, rtol=1e-10)
    np.testing.assert_allclose(torques, applied, rtol=1e-10)
    np.testing.assert_array_equal(one.held, torques[-1])


def test_without_a_tick_the_last_torque_stays() -> None:
    one = loop()
    one.held[:] = [0.4, 0.1]
    zeros = np.zeros(2)
    _, v, _, torques = simulate_sampled(one, (), 10, references(0), None, zeros, zeros, zeros)
    assert torques.shape == (0, 2)
    np.testing.assert_allclose(v, 0.01 * one.held, rtol=1e-4)


def test_torques_are_cut_to_the_limit_in_both_directions() -> None:
    one = loop(limit=np.array([3.0, 4.0]))
    zeros = np.zeros(2)
    _, _, _, torques = simulate_sampled(one, (0,), 1, references(1), None, zeros, zeros, zeros)
    np.testing.assert_array_equal(torques, [[3.0, -4.0]])


def test_the_controller_sees_the_noise_and_the_world_does_not() -> None:
    noise = np.array([[[0.1, 0.0], [0.0, -0.3]]])
    zeros = np.zeros(2)
    one = loop(gain=1.0)
    _, v, z, torques = simulate_sampled(one, (0,), 1, references(1), noise, zeros, zeros, zeros)
    np.testing.assert_allclose(torques, [[30 * 0.4, 30 * -0.2 + 2 * 0.3]])
    np.testing.assert_allclose(z, [0.4, -0.2])
    np.testing.assert_allclose(v, 1e-3 * torques[0], rtol=1e-6)


def test_arguments_are_left_alone() -> None:
    q, v, z = np.full(2, 0.1), np.full(2, 0.2), np.full(2, 0.3)
    new = simulate_sampled(loop(gain=1.0), (0,), 3, references(1), None, q, v, z)
    for array, value in ((q, 0.1), (v, 0.2), (z, 0.3)):
        np.testing.assert_array_equal(array, value)
        assert not any(np.shares_memory(array, made) for made in new)
