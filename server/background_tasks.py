"""Work that goes on in the background of the web process."""

import asyncio
import logging
from collections.abc import Coroutine
from typing import Any

log = logging.getLogger("orclab.tasks")


class BackgroundTasks:
    """Keeps what it was given to do alive until it is done, and tells what failed."""

    def __init__(self) -> None:
        self._running: set[asyncio.Task[Any]] = set()

    def spawn(self, work: Coroutine[Any, Any, Any]) -> None:
        """Begins `work`; nobody waits for it."""
        task = asyncio.create_task(work)
        self._running.add(task)
        task.add_done_callback(self._log_failure)

    def cancel(self) -> None:
        """Cancels all that still runs."""
        for task in self._running:
            task.cancel()

    def _log_failure(self, task: asyncio.Task[Any]) -> None:
        self._running.discard(task)
        if not task.cancelled() and (error := task.exception()):
            log.error("a task in the background failed", exc_info=error)
