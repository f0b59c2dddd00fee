"""What happens to the two runs that the plan does not know of: pushes and noise."""

import numpy as np

from labs.models.mechanisms import Mechanism, mechanism
from labs.optimal_control.ddp.params import DdpParams
from labs.tasks.motion.playback import Playback, apply_state_jump

VELOCITY_NOISE_RATIO = 10.0
"""[1/s] noise of the measured velocity [rad/s] for each radian of noise of the angle."""


def apply_impulse(plant: Mechanism, playback: Playback, impulse: float) -> Playback:
    """The runs after an impulse [N s] along y has struck the tips of both robots."""
    along_y, n = np.array([0.0, impulse, 0.0]), plant.nq
    jumps = [plant.velocity_jump(x[:n], along_y) for x in playback.x]
    return apply_state_jump(playback, np.concatenate([np.zeros((2, n)), jumps], axis=1))


def sample_noise(
    params: DdpParams, substeps: int, key: int, step: int
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Noise of one world step: of the torques (nu,), and of the measured state (substeps, nx).
    It is a function of the run's key and the number of the step; None where there is no noise."""
    if not (params.noise or params.noise_torque):
        return None, None
    counter = step << 64  # each step has 2^64 numbers of its own
    generator = np.random.Generator(np.random.Philox(key=key, counter=counter))
    system = mechanism(params.system)
    torque = params.noise_torque * params.control_scale * generator.standard_normal(system.nu)
    deviation = params.noise * np.repeat([1.0, VELOCITY_NOISE_RATIO], system.nq)
    return torque, deviation * generator.standard_normal((substeps, system.nx))
