"""Simulated time paced against the wall clock. What is computed never depends on it."""

import time
from collections import deque

from labs.engine.run import World

MAX_LAG = 0.2
"""[s] Wall-clock time the simulation may lag and still catch up; what is beyond is given up."""
MEASURE_EVERY = 0.5
"""[s] Between two looks at how fast simulated time goes."""


class Pacer:
    """Makes the steps of a world that are due at the chosen speed."""

    def __init__(self, world: World, speed: float) -> None:
        self.speed = speed
        """Simulated seconds per second of the wall clock that are wanted."""
        self.hold: float | None = None
        """[s] The simulated time at which the world stops for its viewers, if any."""
        self._world = world
        self._samples: deque[tuple[float, float]] = deque(maxlen=4)
        self.resync()

    def resync(self) -> None:
        """Simulated time follows the wall clock from here on."""
        self._wall0, self._steps0 = time.perf_counter(), self._world.steps
        self._samples.clear()
        self._spent, self._taken = 0.0, 0  # [s] of the wall clock, steps

    def next_step_time(self, now: float) -> float:
        """[s] When the next step is due."""
        missing = max(0.0, 1.0 - self._steps_due(now))
        return now + missing * self._world.lab.period / self.speed

    def advance(self, now: float, until: float) -> None:
        """The steps that are due; none begins after `until` [s]."""
        before = self._world.steps
        # Given up first: a machine that slept does not rush through the night.
        lag = self._steps_due(now) * self._world.lab.period / self.speed
        self._wall0 += max(0.0, lag - MAX_LAG)
        for _ in range(int(self._steps_due(now))):
            if self._world.trouble or self.is_hold_due() or time.perf_counter() > until:
                break
            self._world.advance()
        self._spent += time.perf_counter() - now
        self._taken += self._world.steps - before

    def is_hold_due(self) -> bool:
        """Whether the time to hold has come: exactly, however fast it went."""
        steps = None if self.hold is None else round(self.hold / self._world.lab.period)
        return self._world.steps == steps

    def real_time_factor(self, now: float) -> float | None:
        """The real-time factor over the last seconds; None while it is not known."""
        if not self._samples or now - self._samples[-1][0] > 0.9 * MEASURE_EVERY:
            self._samples.append((now, self._world.t))
        (w0, t0), (w1, t1) = self._samples[0], self._samples[-1]
        return (t1 - t0) / (w1 - w0) if w1 - w0 >= 2 * MEASURE_EVERY else None

    def pop_step_seconds(self) -> float:
        """[s] The mean wall-clock time of a step since this was last asked."""
        mean = self._spent / self._taken if self._taken else 0.0
        self._spent, self._taken = 0.0, 0
        return mean

    def _steps_due(self, now: float) -> float:
        elapsed = (now - self._wall0) * self.speed
        return elapsed / self._world.lab.period - (self._world.steps - self._steps0)
