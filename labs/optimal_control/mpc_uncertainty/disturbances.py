"""What is added to the state at each step: drawn for all runs, or chosen against them."""

import numpy as np

from labs.optimal_control.mpc_uncertainty.params import UncertaintyParams

WORST_CASE_STEPS = 20
"""Steps within which the worst disturbance drives a run to the edge of the tube."""


def sample_disturbances(params: UncertaintyParams, A_K: np.ndarray, steps: int) -> np.ndarray:
    """w (steps, runs, 2), of the errors' dynamics A_K (2, 2)."""
    shape = (steps, round(params.count), 2)
    rng = np.random.default_rng(round(params.seed))
    match params.kind:
        case "uniform":
            scaled = rng.uniform(-1.0, 1.0, shape)
        case "corners":
            scaled = rng.choice([-1.0, 1.0], shape)
        case "gaussian":
            scaled = rng.standard_normal(shape) / params.width
        case _:
            scaled = _worst_case(shape, A_K)
    return np.asarray(scaled * params.w_max)


def _worst_case(shape: tuple[int, ...], A_K: np.ndarray) -> np.ndarray:
    """Corners of W, each sign what moves the position the farthest towards the wall
    WORST_CASE_STEPS steps later; each run has its own turn."""
    steps, runs, _ = shape
    k, run = np.arange(steps)[:, None], np.arange(runs)[None]
    left = (run - k - 1) % WORST_CASE_STEPS
    powers = np.array([np.linalg.matrix_power(A_K, i)[0] for i in range(WORST_CASE_STEPS)])
    return np.asarray(np.where(powers[left] < 0.0, -1.0, 1.0))
