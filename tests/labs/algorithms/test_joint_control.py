"""The laws against the formulas written out, and their linearisation against differences."""

import numpy as np
import pinocchio as pin
import pytest

from labs.algorithms.equation_of_motion import mass_matrix
from labs.algorithms.joint_control import CONTROL_LAWS, ControlLaw, Gains, linearise_law
from labs.models.arms import load_arm

GAINS = Gains(kp=120.0, ki=33.0, kd=9.0)


@pytest.fixture(params=["ur5", "panda", "double-pendulum"])
def model(request: pytest.FixtureRequest) -> pin.Model:
    return load_arm(request.param).model


def arguments(model: pin.Model) -> list[np.ndarray]:
    """q, v, z, q_ref, v_ref, a_ref."""
    return list(np.random.default_rng(3).normal(size=(6, model.nv)))


def law(name: str, model: pin.Model) -> ControlLaw:
    return CONTROL_LAWS[name](model, model.createData(), GAINS)


def test_open_loop_is_the_references_inverse_dynamics(model: pin.Model) -> None:
    q, v, z, q_ref, v_ref, a_ref = arguments(model)
    data = model.createData()
    expected = mass_matrix(model, data, q_ref) @ a_ref + pin.nonLinearEffects(
        model, data, q_ref, v_ref
    )
    found = law("open-loop", model)
    np.testing.assert_allclose(found(q, v, z, q_ref, v_ref, a_ref), expected, atol=1e-10)
    np.testing.assert_array_equal(
        found(q, v, z, q_ref, v_ref, a_ref), found(2 * q, -v, z + 1, q_ref, v_ref, a_ref)
    )


def test_pid_is_its_three_terms(model: pin.Model) -> None:
    q, v, z, q_ref, v_ref, a_ref = arguments(model)
    expected = 120.0 * (q_ref - q) + 9.0 * (v_ref - v) + 33.0 * z
    found = law("pid", model)(q, v, z, q_ref, v_ref, a_ref)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_pd_with_gravity_adds_gravity_at_the_measured_posture(model: pin.Model) -> None:
    q, v, z, q_ref, v_ref, a_ref = arguments(model)
    still = np.zeros(model.nv)
    gravity = pin.rnea(model, model.createData(), q, still, still)
    expected = 120.0 * (q_ref - q) + 9.0 * (v_ref - v) + gravity
    found = law("pd-gravity", model)(q, v, z, q_ref, v_ref, a_ref)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)


def test_computed_torque_makes_the_acceleration_it_asks_for(model: pin.Model) -> None:
    q, v, z, q_ref, v_ref, a_ref = arguments(model)
    tau = law("computed-torque", model)(q, v, z, q_ref, v_ref, a_ref)
    expected = a_ref + 120.0 * (q_ref - q) + 9.0 * (v_ref - v)
    found = pin.aba(model, model.createData(), q, v, tau)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("name", CONTROL_LAWS)
def test_the_linearisation_matches_finite_differences(name: str, model: pin.Model) -> None:
    q_ref = arguments(model)[0]
    still, d = np.zeros(model.nv), 1e-6
    found = linearise_law(name, model, model.createData(), GAINS, q_ref)
    tau = law(name, model)
    for i, unit in enumerate(np.eye(model.nv) * d):
        columns = [
            (
                tau(q_ref + x, y, z, q_ref, still, still)
                - tau(q_ref - x, -y, -z, q_ref, still, still)
            )
            / (2 * d)
            for x, y, z in ((unit, still, still), (still, unit, still), (still, still, unit))
        ]
        np.testing.assert_allclose(-columns[0], found.k_q[:, i], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(-columns[1], found.k_v[:, i], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(columns[2], found.k_z[:, i], rtol=1e-6, atol=1e-6)
