"""A worker process: it waits for a session to open, and then runs its loop."""

import os
import signal
import socket
import threading
from typing import Any

from server.live_session import LiveSession
from server.mailbox import Mailbox
from server.pipe import CONTROL, WorkerPipe
from server.process import die_with_parent, viser_server

HEARTBEAT = 0.5
"""[s] Between two signs of life of a worker without a session."""


def main(sock: socket.socket) -> None:
    """Runs until the web process closes the pipe."""
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    link, mailbox = WorkerPipe(sock), Mailbox()
    threading.Thread(target=_listen, args=(link, mailbox), daemon=True).start()
    server = viser_server()
    try:
        link.send(CONTROL, {"ready": True, "port": server.get_port()})
        opening = _wait_for_opening(link, mailbox)
        LiveSession(link, mailbox, server, opening).loop()
    except OSError:
        os._exit(0)  # The web process is gone: nobody is left to hear.


def _listen(link: WorkerPipe, mailbox: Mailbox) -> None:
    while (message := link.receive()) is not None:
        mailbox.put(message["do"], message.get("ref"), **message.get("with", {}))
    # The web process is gone or wants us gone; the loop may be hung, so do not ask it.
    os._exit(0)


def _wait_for_opening(link: WorkerPipe, mailbox: Mailbox) -> dict[str, Any]:
    while not (items := mailbox.take(HEARTBEAT)):
        link.send(CONTROL, {"idle": True})
    opening = items[0]
    for item in items[1:]:
        mailbox.put(item.do, item.ref, **item.arguments)
    return opening.arguments
