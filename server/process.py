"""What a worker is as a process: it dies with its parent, and its Viser server is its own."""

import contextlib
import ctypes
import functools
import os
import signal
import sys
from pathlib import Path

import viser
import websockets.asyncio.server


def viser_server() -> viser.ViserServer:
    """A Viser server on a free loopback port that no web page can reach past the proxy: browsers
    always send an Origin, the proxy never does."""
    websockets.asyncio.server.serve = functools.partial(  # type: ignore[assignment,misc]
        websockets.asyncio.server.serve, origins=[None]
    )
    with Path(os.devnull).open("w") as silence, contextlib.redirect_stdout(silence):
        return viser.ViserServer(host="127.0.0.1", port=0, verbose=False)


def die_with_parent() -> None:
    """On Linux the kernel ends a worker whose parent dies, even one stuck in native code.
    Elsewhere the closing pipe does."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
