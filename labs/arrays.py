"""Arrays that are never written into."""

from collections.abc import Mapping

import numpy as np

Training = Mapping[str, np.ndarray]
"""What learners have learned so far, by name: all that goes on from there needs."""


def with_row(array: np.ndarray, i: int, row: np.ndarray | float) -> np.ndarray:
    """A copy of the array with another row, or entry, i."""
    changed = array.copy()
    changed[i] = row
    return changed
