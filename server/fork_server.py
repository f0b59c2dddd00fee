"""The process that workers are forked from. Imports nothing heavy: it is started first of all, and
loads what workers need while the web process loads what it needs itself."""

import multiprocessing
import multiprocessing.forkserver
import os
from multiprocessing.context import ForkServerContext

PRELOADED = "server.preload"


def context() -> ForkServerContext:
    """What starts processes there."""
    # Inherited by the fork server: threads hurt at these sizes.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    found = multiprocessing.get_context("forkserver")
    found.set_forkserver_preload([PRELOADED])
    return found


def start() -> None:
    """Begins to load, and does not wait."""
    context()
    multiprocessing.forkserver.ensure_running()
