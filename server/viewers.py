"""The pages that watch a session, each with a bounded queue."""

import asyncio
from collections.abc import AsyncIterator

QUEUE = 64
"""Messages a slow viewer may be behind: two seconds. Then it starts afresh."""


class Viewer:
    """One page that watches. Too slow, it loses old telemetry; nobody waits for it."""

    def __init__(self) -> None:
        self._queue: asyncio.Queue[bytes | None] = asyncio.Queue(QUEUE + 4)

    def push(self, payload: bytes, latest: list[bytes]) -> None:
        """Queues a message. A viewer too far behind skips to the `latest` frames, and this one."""
        if self._queue.qsize() >= QUEUE:
            while not self._queue.empty():
                self._queue.get_nowait()
            for message in latest:
                self._queue.put_nowait(message)
        self._queue.put_nowait(payload)

    def close(self) -> None:
        """Ends the stream after what is queued."""
        if self._queue.full():
            self._queue.get_nowait()
        self._queue.put_nowait(None)

    async def messages(self) -> AsyncIterator[bytes]:
        """What to send, until the session ends."""
        while (payload := await self._queue.get()) is not None:
            yield payload
