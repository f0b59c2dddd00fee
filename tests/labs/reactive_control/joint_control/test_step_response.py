"""Overshoot and settling time against a second-order response known in closed form."""

import numpy as np
import pytest

from labs.reactive_control.joint_control.step_response import SETTLING_BAND, StepResponse


def respond(error: np.ndarray, times: np.ndarray) -> StepResponse:
    response = StepResponse.begin(0.0, error[0])
    assert response is not None
    for t, e in zip(times[1:], error[1:], strict=True):
        response = response.update(float(t), e)
    return response


@pytest.mark.parametrize("size", [0.4, -0.4])
def test_the_second_order_response(size: float) -> None:
    zeta, omega = 0.3, 5.0
    damped = omega * np.sqrt(1 - zeta**2)
    t = np.linspace(0.0, 8.0, 80_001)
    decay = np.exp(-zeta * omega * t)
    shape = decay * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t))
    error = size * np.stack([shape, 0.5 * np.exp(-9.0 * t)], axis=1)
    response = respond(error, t)
    expected = np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2))
    assert response.overshoot == pytest.approx(expected, rel=1e-6)
    outside = t[np.abs(shape) > SETTLING_BAND]
    assert response.settled == pytest.approx(outside[-1] + (t[1] - t[0]), abs=1e-9)


def test_an_error_that_stays_never_settles() -> None:
    t = np.linspace(0.0, 5.0, 501)
    response = respond(0.1 * np.exp(-t)[:, None] + 0.01, t)
    assert response.settled < 0
    assert response.overshoot == 0.0


def test_leaving_the_band_unsettles() -> None:
    response = StepResponse.begin(2.0, np.array([1.0]))
    assert response is not None
    inside = response.update(3.0, np.array([0.01])).update(4.0, np.array([-0.01]))
    assert inside.settled == 1.0
    again = inside.update(5.0, np.array([-0.05]))
    assert again.settled < 0
    assert again.update(6.0, np.array([0.0])).settled == 4.0
    assert again.overshoot == pytest.approx(0.05)


def test_no_step_no_response() -> None:
    assert StepResponse.begin(0.0, np.zeros(3)) is None
