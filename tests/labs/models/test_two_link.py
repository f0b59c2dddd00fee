"""The compiled equation of motion of one joint and of two, against Pinocchio's."""

import numpy as np
import pinocchio as pin
import pytest

from labs.models.arms import load_arm
from labs.models.mechanisms import mechanism
from labs.models.two_link import simulate_two_link, two_link


def _ur5() -> pin.Model:
    """Shoulder lift and elbow, the other joints locked."""
    arm = load_arm("ur5")
    model = pin.buildReducedModel(arm.model, [1, 4, 5, 6], arm.home)
    model.armature = arm.model.armature[1:3]
    return model


MODELS = {
    "pendulum": lambda: mechanism("pendulum").model,
    "double pendulum": lambda: mechanism("double-pendulum").model,
    "UR5": _ur5,
}


@pytest.mark.parametrize("name", MODELS)
def test_accelerations_are_pinocchios(name: str) -> None:
    """In one substep v grows by h v', and q by h v of its end."""
    model, rng, h = MODELS[name](), np.random.default_rng(0), 0.1
    n, body, data = model.nv, two_link(model), model.createData()
    X, torques = 2.0 * rng.normal(size=(50, 2 * n)), 5.0 * rng.normal(size=(50, n))
    motion = (body.joints, body.inertia, body.gravity)
    after = simulate_two_link(*motion, X, torques, np.full(n, np.inf), h, 1)
    expected = [pin.aba(model, data, x[:n], x[n:], t) for x, t in zip(X, torques, strict=True)]
    np.testing.assert_allclose((after - X)[:, n:] / h, expected, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose((after - X)[:, :n] / h, after[:, n:], atol=1e-12)
    held = body.without_gravity()
    rest = np.hstack([X[:, :n], np.zeros((50, n))])
    still = simulate_two_link(
        held.joints, held.inertia, held.gravity, rest, 0 * torques, np.ones(n), h, 4
    )
    np.testing.assert_array_equal(still, rest)
