"""Time as this process lived through it."""

import asyncio

TICK = 0.25
"""[s] Between two ticks."""
LONGEST = 4 * TICK
"""[s] What a tick that came late counts at most."""


class WakingClock:
    """Seconds that passed while this process ran: a laptop's lid was closed, or the process was
    stopped, and nobody fell silent or idle in between."""

    def __init__(self) -> None:
        self.now = 0.0
        """[s]"""
        self._last = asyncio.get_running_loop().time()

    async def tick(self) -> None:
        """Waits for the next tick, and counts it."""
        await asyncio.sleep(TICK)
        time = asyncio.get_running_loop().time()
        self.now += min(time - self._last, LONGEST)
        self._last = time
