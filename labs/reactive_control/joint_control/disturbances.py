"""What disturbs the arm: a hand that pushes or pulls its end-effector, and noisy sensors."""

import numpy as np

from labs.models.plant import Force
from labs.reactive_control.joint_control.params import JointParams
from labs.reactive_control.joint_control.sampled_control import to_time_units

PULL_STIFFNESS = 400.0
"""[N/m] between the end-effector and the handle that pulls it."""
STRONGEST_PULL = 150.0
"""[N]"""
VELOCITY_NOISE = 10.0
"""[1/s] noise of the measured velocity [rad/s] for each radian of noise of the angle."""
NOISE_STEP = 0.001
"""[s] between two random numbers of one sensor."""


def end_effector_force(
    params: JointParams, pushed: bool, handle: tuple[float, float, float] | None
) -> Force | None:
    """The force on the end-effector: a push while it lasts, and a spring towards the handle
    while it is held, no stronger than `STRONGEST_PULL`. None when there is neither."""
    push = np.zeros(3)
    if pushed:
        sign = -1.0 if params.push_direction.startswith("-") else 1.0
        push["xyz".index(params.push_direction[-1])] = sign * params.push_force
    if handle is None:
        return (lambda tip: push) if push.any() else None
    target = np.array(handle)

    def force(tip: np.ndarray) -> np.ndarray:
        pull: np.ndarray = PULL_STIFFNESS * (target - tip)
        size = float(pull @ pull) ** 0.5
        applied: np.ndarray = push + pull * (STRONGEST_PULL / max(size, STRONGEST_PULL))
        return applied

    return force


def measurement_noise(
    params: JointParams, key: int, step: int, period: float, due: tuple[int, ...], joints: int
) -> np.ndarray | None:
    """(m, 2, joints) added to measured q and v at the ticks `due` of this world step, which
    lasts `period` [s]. The random numbers are numbered by time: one row for each NOISE_STEP,
    whatever the step of integration. None without noise."""
    if params.noise == 0.0:
        return None
    counter = step << 64  # each step has 2^64 numbers of its own
    generator = np.random.Generator(np.random.Philox(key=key, counter=counter))
    rows: np.ndarray = generator.standard_normal(
        (to_time_units(period) // to_time_units(NOISE_STEP), 2, joints)
    )
    rows *= np.array([[params.noise], [VELOCITY_NOISE * params.noise]])
    h = to_time_units(params.step)
    chosen: np.ndarray = rows[[k * h // to_time_units(NOISE_STEP) for k in due]]
    return chosen
