"""The eigenvalues joint-control plots, against differences of the nonlinear robot's motion."""

import numpy as np
import pinocchio as pin

from labs.models.plant import plant
from labs.plots import channel_names, field_names
from tests.labs.reactive_control.joint_control.runs import LAB, final_state, gravity, parameters


def test_eigenvalues_are_those_of_the_loop_with_its_payload_and_friction() -> None:
    params = parameters({}, payload=4.0, friction=3.0, amplitude=0.0)
    state = LAB.init(params, np.random.default_rng(0))
    world, q0, d = plant("ur5", 4.0), state.q_ref, 1e-6

    # What holds the payload where the loop is linearised, so that it rests there.
    held = pin.computeGeneralizedGravity(world.model, world.data, q0) - gravity(params, q0)

    def rate(x: np.ndarray) -> np.ndarray:
        q, v = x[:6], x[6:]
        tau = held + params.kp * (q0 - q) - params.kd * v + gravity(params, q)
        return np.concatenate([v, world.acceleration(tau, 3.0)(q, v)])

    at = np.concatenate([q0, np.zeros(6)])
    slope = np.array([(rate(at + d * e) - rate(at - d * e)) / (2 * d) for e in np.eye(12)]).T
    fields = LAB.fields(params, state)
    found = np.sort_complex(fields["poles_re"] + 1j * fields["poles_im"])
    np.testing.assert_allclose(found, np.sort_complex(np.linalg.eigvals(slope)), rtol=1e-5)


def test_plots_name_real_channels() -> None:
    params = parameters({}, reference="set-point", initial_error=0.1)
    rest = final_state(params, 5.0)
    measure, fields = LAB.measure(params, rest), LAB.fields(params, rest)
    for plot in LAB.plots:
        assert set(channel_names(plot)) <= set(measure)
        assert set(field_names(plot)) <= set(fields)
