"""Runs of the lab joint-control, for its tests."""

from collections.abc import Iterator, Mapping

import numpy as np
import pinocchio as pin

from labs.lab import Inputs
from labs.models.plant import plant
from labs.params import Value
from labs.reactive_control.joint_control.lab import JointControl, JointState
from labs.reactive_control.joint_control.params import JointParams
from tests.labs.experiments import ArticleExperiments

LAB = JointControl()
ARTICLE = ArticleExperiments("labs.reactive_control", "joint_control")
PUSHED = Inputs(actions=("push",))


def parameters(setting: Mapping[str, Value], **changes: Value) -> JointParams:
    return JointParams().change({**setting, **changes})


def states(
    params: JointParams, seconds: float, inputs: Mapping[int, Inputs] | None = None, seed: int = 0
) -> Iterator[JointState]:
    """The states from t = 0 on, until trouble."""
    state = LAB.init(params, np.random.default_rng(seed))
    yield state
    for k in range(round(seconds / LAB.period)):
        state = LAB.step(params, (inputs or {}).get(k, Inputs()), state)
        yield state
        if state.trouble:
            return


def final_state(
    params: JointParams, seconds: float, inputs: Mapping[int, Inputs] | None = None
) -> JointState:
    *_, state = states(params, seconds, inputs)
    return state


def error(state: JointState) -> np.ndarray:
    e: np.ndarray = state.q_ref - state.q
    return e


def gravity(params: JointParams, q: np.ndarray) -> np.ndarray:
    """g(q) of the controller's model."""
    known = plant(params.robot)
    torque: np.ndarray = pin.computeGeneralizedGravity(known.model, known.data, q).copy()
    return torque
