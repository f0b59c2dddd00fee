"""The process that workers are forked from. Imports nothing heavy: it is started first of all, and
loads what workers need while the web process loads what it needs itself."""

import errno
import multiprocessing
import multiprocessing.forkserver
import os
import socket
from multiprocessing import reduction
from multiprocessing.context import ForkServerContext

PRELOADED = "server.preload"


def fork_context() -> ForkServerContext:
    """What starts processes there."""
    # Inherited by the fork server: threads hurt at these sizes.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    found = multiprocessing.get_context("forkserver")
    found.set_forkserver_preload([PRELOADED])
    return found


def start_fork_server() -> None:
    """Begins to load, and does not wait."""
    fork_context()
    multiprocessing.forkserver.ensure_running()


def tolerate_broken_requests() -> None:
    """To be called in the fork server. A client that is out of descriptors connects and hangs up
    before it has asked; the loop of the standard library (up to 3.13) ends of that, and with it
    every worker. It does go on after a connection that was aborted, so that is what it is told."""
    receive = reduction.recvfds

    def receive_or_abort(sock: socket.socket, size: int) -> list[int]:
        try:
            return receive(sock, size)
        except (EOFError, ConnectionError) as error:
            raise ConnectionAbortedError(errno.ECONNABORTED, "no request came") from error

    reduction.recvfds = receive_or_abort
