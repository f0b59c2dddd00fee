"""The lab's loop, linearised at rest: where the reference is, and where it comes on its way."""

import numpy as np

from labs.models.arms import load_arm
from labs.models.plant import plant
from labs.reactive_control.joint_control.params import JointParams
from labs.reactive_control.joint_control.references import reference_motion
from labs.reactive_control.joint_control.sampled_stability import LinearisedRobot, LinearLoop

LINEARISATION_PHASES = np.array([0.0, 0.25, 0.45, 0.75])
"""Of the reference [cycles]: where it is linearised on its way."""


def linear_loop(params: JointParams, q: np.ndarray) -> LinearLoop:
    """The loop at rest at q (nq,), the robot with its payload, the controller without."""
    world, known = plant(params.robot, params.payload), plant(params.robot)
    robot = LinearisedRobot.near(world.model, world.data, q, params.friction)
    return LinearLoop(robot, known.model, known.data, q)


def loops_along_reference(params: JointParams, q_ref: np.ndarray) -> list[LinearLoop]:
    """The loop where the reference is, q_ref (nq,), and where it comes on its way."""
    home = load_arm(params.robot).home
    postures, _, _ = reference_motion(
        params.reference, home, params.amplitude, params.rate, LINEARISATION_PHASES
    )
    return [linear_loop(params, q) for q in (q_ref, *np.unique(postures, axis=0))]
