"""How good a response to a step is: overshoot and settling time, kept while it happens.

A step of the reference leaves the error e0 = q_ref - q (nv,) [rad]; its size is max |e0_i|.

    overshoot       the farthest any joint goes beyond its reference, as a share of the size
    settling time   when the largest error last came within SETTLING_BAND of the size

Both are what samples at the times of `update` show.
"""

from dataclasses import dataclass

import numpy as np

SETTLING_BAND = 0.02
"""Share of the step's size within which the response counts as settled."""

SMALLEST_STEP = 1e-6
"""[rad] a smaller error is no step."""


@dataclass(frozen=True)
class StepResponse:
    """A step and how the response has done so far."""

    time: float
    """[s] when the step was."""
    error: np.ndarray
    """e0, (nv,) [rad], read-only: the response keeps it from state to state."""
    size: float
    overshoot: float = 0.0
    """Share of the size."""
    settled: float = -1.0
    """[s] since the step; negative while not settled."""

    @classmethod
    def begin(cls, time: float, error: np.ndarray) -> "StepResponse | None":
        """The response to a step that leaves this error; None when there is no step."""
        size = float(np.abs(error).max())
        error = error.copy()
        error.flags.writeable = False
        return cls(time, error, size) if size > SMALLEST_STEP else None

    def update(self, time: float, error: np.ndarray) -> "StepResponse":
        """With the error e (nv,) [rad] at this time [s] taken into account."""
        beyond = float((-np.sign(self.error) * error).max()) / self.size
        inside = float(np.abs(error).max()) <= SETTLING_BAND * self.size
        settled = self.settled if self.settled >= 0.0 else time - self.time
        return StepResponse(
            self.time,
            self.error,
            self.size,
            max(self.overshoot, beyond),
            settled if inside else -1.0,
        )
