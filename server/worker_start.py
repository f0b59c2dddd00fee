"""How a worker's process begins: the web process asks the fork server for it, on a thread."""

import asyncio
import contextlib
import errno
import functools
import socket
import threading
import time
from collections.abc import Callable
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess

from server import worker_entry
from server.uptime_clock import UptimeClock

START_SECONDS = 600.0
"""The first waits until the fork server has loaded and compiled what all workers share, on any
machine. A fork server that is stuck, or stopped, is not waited for longer."""
REFUSALS, REFUSAL_SECONDS = 10, 0.5


async def start_worker(
    context: ForkServerContext, clock: UptimeClock
) -> tuple[BaseProcess, socket.socket]:
    """A process that has begun, and our end of its pipe. Raises OSError (of descriptors,
    processes, time), EOFError, RuntimeError."""
    ours, theirs = socket.socketpair()
    try:
        process = context.Process(
            target=worker_entry.main, args=(theirs,), daemon=True, name="orclab-worker"
        )
        async with clock.timeout(START_SECONDS):
            await _run_in_thread(functools.partial(_start_process, process, theirs))
    except BaseException as error:
        ours.close()  # a process that begins all the same finds its pipe closed, and ends
        if isinstance(error, TimeoutError):
            why = f"none began within {START_SECONDS:g} s; if it stays so, start the server anew"
            raise TimeoutError(errno.ETIMEDOUT, why) from None
        raise
    return process, ours


def _start_process(process: BaseProcess, theirs: socket.socket) -> None:
    """Starts a process with its end of the pipe. A fork server that was killed refuses requests
    until it is gone; then `start` begins another."""
    with theirs:
        for _ in range(REFUSALS):
            with contextlib.suppress(ConnectionError, EOFError):
                return process.start()
            time.sleep(REFUSAL_SECONDS)
        process.start()


async def _run_in_thread(work: Callable[[], None]) -> None:
    """As `asyncio.to_thread`, but the end of the server does not wait for it."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[None] = loop.create_future()

    def finish(error: BaseException | None) -> None:
        if done.done():
            return
        if error:
            done.set_exception(error)
        else:
            done.set_result(None)

    def run() -> None:
        error: BaseException | None = None
        try:
            work()
        except BaseException as problem:
            error = problem
        with contextlib.suppress(RuntimeError):  # the loop has ended: nobody waits any more
            loop.call_soon_threadsafe(finish, error)

    threading.Thread(target=run, daemon=True).start()
    await done
