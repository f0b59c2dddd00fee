"""Where a worker process begins. Imports nothing heavy: the web process imports this too."""

import socket


def main(sock: socket.socket) -> None:
    """Runs one worker until its pipe closes."""
    from server import worker  # already loaded in the process this one was forked from

    worker.main(sock)
