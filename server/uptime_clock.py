"""Time as this process lived through it."""

import asyncio
import contextlib
from collections.abc import AsyncIterator

TICK = 0.25
"""[s] Between two ticks."""
MAX_TICK = 4 * TICK
"""[s] What a tick that came late counts at most."""


class UptimeClock:
    """Seconds that passed while this process ran: a laptop's lid was closed, or the process was
    stopped, and nobody fell silent or idle in between."""

    def __init__(self) -> None:
        self.now = 0.0
        """[s]"""
        self._last = asyncio.get_running_loop().time()
        self._ends: dict[asyncio.Timeout, float] = {}

    @contextlib.asynccontextmanager
    async def timeout(self, seconds: float) -> AsyncIterator[None]:
        """As `asyncio.timeout`, by this clock."""
        async with asyncio.timeout(None) as limit:
            self._ends[limit] = self.now + seconds
            try:
                yield
            finally:
                self._ends.pop(limit, None)

    async def tick(self) -> None:
        """Waits for the next tick, and counts it."""
        await asyncio.sleep(TICK)
        time = asyncio.get_running_loop().time()
        self.now += min(time - self._last, MAX_TICK)
        self._last = time
        for limit in [limit for limit, end in self._ends.items() if end <= self.now]:
            del self._ends[limit]
            limit.reschedule(time)
