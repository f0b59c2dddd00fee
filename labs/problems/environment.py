"""What deep Q-learning and Gymnasium's learners drive (notes, 3.8.3): states are continuous,
controls few.

    x_(t+1) = f(x_t, u_t),    l(x_t, u_t) is paid,    u_t one of u(0) ... u(nu - 1)

Many of a kind are driven at once. An episode is cut after `horizon` steps: that is no end of the
task, and the value of where it is cut still counts.
"""

from typing import Protocol

import numpy as np


class Environment(Protocol):
    """One task. All functions take many states at once, and keep nothing."""

    @property
    def nx(self) -> int: ...
    @property
    def observation_size(self) -> int:
        """How many numbers an observation has."""
        ...

    @property
    def control_count(self) -> int:
        """How many controls there are to choose from."""
        ...

    @property
    def horizon(self) -> int:
        """Steps of an episode."""
        ...

    @property
    def substeps(self) -> int:
        """Into how many parts a step is divided, to be seen one by one."""
        ...

    def initial_states(self, random: np.ndarray, many: int) -> np.ndarray:
        """States (many, nx) that episodes begin in, drawn by `random` (4,) uint64, a state of
        `labs.random_numbers` that is advanced."""
        ...

    def observe(self, X: np.ndarray) -> np.ndarray:
        """(k, observation_size) float32: what a network is told of X (k, nx), numbers of about
        one."""
        ...

    def substep(self, X: np.ndarray, U: np.ndarray) -> np.ndarray:
        """X (k, nx) one part of a step later, under the controls of indices U (k,)."""
        ...

    def step(self, X: np.ndarray, U: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """From X (k, nx) under the controls of indices U (k,): the next states (k, nx), what is
        paid (k,), and whether the task ends there for good (k,)."""
        ...
