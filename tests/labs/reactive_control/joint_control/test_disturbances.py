"""What pushes and pulls the arm, and the noise of its sensors."""

import numpy as np
import pytest

from labs.lab import Inputs
from labs.models.plant import plant
from labs.reactive_control.joint_control.disturbances import (
    PULL_STIFFNESS,
    STRONGEST_PULL,
    VELOCITY_NOISE,
    measurement_noise,
)
from labs.reactive_control.joint_control.lab import PUSH_STEPS
from labs.reactive_control.joint_control.sampled_stability import LinearisedRobot
from tests.labs.reactive_control.joint_control.runs import LAB, PUSHED, parameters, states


def test_a_push_is_an_impulse() -> None:
    """From rest and compensated, M v = J' f 0.2 s for a small force."""
    params = parameters(
        {"reference": "set-point", "kp": 0.0, "kd": 0.0, "push_force": 0.1, "amplitude": 0.0},
        push_direction="-z",
    )
    path = list(states(params, 0.5, {5: PUSHED}))
    forces = [LAB.measure(params, s)["force"] for s in path]
    assert forces == [0.1 if 5 < k <= 5 + PUSH_STEPS else 0.0 for k in range(len(path))]
    world = plant("ur5")
    mass = LinearisedRobot.near(world.model, world.data, path[0].q, 0.0).mass
    impulse = world.tip_jacobian(path[0].q).T @ np.array([0.0, 0.0, -0.1 * 0.2])
    np.testing.assert_allclose(path[26].v, np.linalg.solve(mass, impulse), rtol=2e-3, atol=1e-5)


def test_the_handle_pulls_like_a_spring() -> None:
    params = parameters({}, reference="set-point", amplitude=0.0)
    start = LAB.init(params, np.random.default_rng(0))
    tip = plant("ur5").tip(start.q)
    for offset, size in (
        ([0.0, 0.1, 0.0], 0.1 * PULL_STIFFNESS),
        ([0.0, 5.0, 0.0], STRONGEST_PULL),
    ):
        pulling = Inputs(handles={"pull": tuple(tip + offset)})
        state = LAB.step(params, pulling, start)
        assert float(np.linalg.norm(state.force)) == pytest.approx(size, rel=0.02)
        path = list(states(params, 1.0, dict.fromkeys(range(100), pulling)))
        assert plant("ur5").tip(path[-1].q)[1] > tip[1] + 0.01
        assert not LAB.step(params, Inputs(), state).force.any()


def test_noise_has_the_deviation_asked_for_and_no_memory() -> None:
    params = parameters({}, noise=0.004)
    state = LAB.init(params, np.random.default_rng(1))
    rows = []
    for k in range(2000):
        noise = measurement_noise(params, state.noise_key, k, LAB.period, tuple(range(10)), 6)
        assert noise is not None
        rows.append(noise)
    samples = np.concatenate(rows)
    n = samples[:, 0].size
    for kind, sigma in ((0, 0.004), (1, 0.004 * VELOCITY_NOISE)):
        x = samples[:, kind] / sigma
        assert abs(x.mean()) < 4 / np.sqrt(n)
        assert abs(x.std() - 1) < 4 / np.sqrt(2 * n)
        for lag in (1, 2, 5, 10, 20):
            assert abs(np.mean(x[lag:] * x[:-lag])) < 4 / np.sqrt(n)


def test_noise_does_not_depend_on_the_integration_step() -> None:
    state = LAB.init(parameters({}), np.random.default_rng(1))
    key, params = state.noise_key, parameters({}, noise=0.01)
    coarse = measurement_noise(params, key, 0, LAB.period, tuple(range(10)), 6)
    finer = params.change({"step": 0.0001})
    fine = measurement_noise(finer, key, 0, LAB.period, tuple(range(0, 100, 10)), 6)
    assert coarse is not None
    assert fine is not None
    np.testing.assert_array_equal(coarse, fine)
