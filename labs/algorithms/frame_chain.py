"""The chain of frames of a serial arm (notes, 1.1.1).

Frame 0 is the world, frame i moves with joint i, and frame n, the last, is at the end-effector.
The pose of frame i in frame i-1 depends on q_i alone, and poses in a row multiply:

    H_n^0(q) = H_1^0(q_1) H_2^1(q_2) ... H_n^(n-1)(q_n).

A pose H = [R p; 0 1] is (4, 4), its last column in metres.
"""

import numpy as np
import pinocchio as pin


class FrameChain:
    """A serial arm of one-degree-of-freedom joints, up to the frame with index `tip`."""

    def __init__(self, model: pin.Model, tip: int) -> None:
        self._model, self._data = model, model.createData()
        self._tip = model.frames[tip].placement.homogeneous

    def factors(self, q: np.ndarray) -> list[np.ndarray]:
        """H_i^(i-1)(q_i), i = 1 ... n, at q (n,) [rad; m where a joint slides]."""
        pin.forwardKinematics(self._model, self._data, q)
        poses = [self._data.liMi[i].homogeneous for i in range(1, self._model.njoints)]
        poses[-1] = poses[-1] @ self._tip
        return poses

    def derivative_norms(self, q: np.ndarray) -> np.ndarray:
        """(n + 1, n): the Frobenius norm of the derivative of each factor (a row) and of their
        product (the last row) by each joint (a column), from central differences. It adds up
        metres and pure numbers: what counts is which entries are zero."""
        step = 1e-6
        norms = np.empty((len(q) + 1, len(q)))
        for j, change in enumerate(step * np.eye(len(q))):
            ahead, behind = self.factors(q + change), self.factors(q - change)
            ahead.append(multiply_poses(ahead))
            behind.append(multiply_poses(behind))
            norms[:, j] = np.linalg.norm(np.subtract(ahead, behind), axis=(1, 2)) / (2.0 * step)
        return norms


def multiply_poses(factors: list[np.ndarray]) -> np.ndarray:
    """The poses (4, 4) multiplied, the first leftmost."""
    pose = np.eye(4)
    for factor in factors:
        pose = pose @ factor
    return pose
