"""Small functions of arrays, which they never write into."""

from collections.abc import Mapping

import numpy as np

Training = Mapping[str, np.ndarray]
"""What learners have learned so far, by name: all that goes on from there needs."""


def episodes_done(training: Training) -> int:
    """Each learner's episodes so far, of a training whose `episodes` (k,) counts them after each of
    k batches."""
    return int(training["episodes"][-1]) if len(training["episodes"]) else 0


def with_row(array: np.ndarray, i: int, row: np.ndarray | float) -> np.ndarray:
    """A copy of the array with another row, or entry, i."""
    changed = array.copy()
    changed[i] = row
    return changed


def clip_norm(vector: np.ndarray, longest: float) -> np.ndarray:
    """`vector`, scaled down where its length exceeds `longest`."""
    length = float(np.linalg.norm(vector))
    return vector if length <= longest else vector * (longest / length)
