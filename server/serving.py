"""`orclab serve`: where it listens, what it says on the terminal, and how it ends."""

import argparse
import asyncio
import ipaddress
import logging
import socket
import tempfile

import h11
import uvicorn
from pydantic import ValidationError
from pydantic_settings import SettingsError
from starlette.requests import ClientDisconnect

from labs.errors import LabError
from server import fork_server
from server.http_protocol import HttpProtocol
from server.settings import Settings
from server.websocket_protocol import WebSocketProtocol

MAX_MESSAGE = 2**20
"""[bytes] Of a WebSocket's message from a browser, whose slider or camera was moved."""
PEER_ERRORS = (UnicodeDecodeError, ClientDisconnect, ConnectionError, h11.LocalProtocolError)


def serve(options: argparse.Namespace) -> int:
    """Serves until it is interrupted. Raises LabError."""
    given = {name: getattr(options, name) for name in ("host", "port") if name in options}
    try:
        settings = Settings(**given)
    except (ValidationError, SettingsError) as error:
        raise LabError(_settings_error(error)) from None
    try:
        tempfile.gettempdir()
    except FileNotFoundError:
        raise LabError(
            "serving needs a folder for temporary files, and none can be written: TMPDIR may name "
            "one, such as /dev/shm"
        ) from None
    listener = _listen(settings.host, settings.port)
    fork_server.start_fork_server()
    from server.app import create_app  # loads all labs, beside the fork server

    host, port = listener.getsockname()[:2]
    app = create_app(settings)
    config = uvicorn.Config(
        app,
        loop="uvloop",
        http=HttpProtocol,
        ws=WebSocketProtocol,
        ws_max_size=MAX_MESSAGE,
        ws_per_message_deflate=False,
        log_level="warning",
        timeout_graceful_shutdown=2,
        server_header=False,
    )
    logging.getLogger("uvicorn.error").addFilter(_shorten_peer_errors)
    server = _Server(config)

    async def announce() -> None:
        while not server.started:
            await asyncio.sleep(0.02)
        own, *others = host_addresses(host)
        own = f"http://{own}:{port}{settings.root_path}"
        print(f"orclab is at {own}  (Ctrl+C ends it)", flush=True)
        for other in others:
            print(f"  for others: http://{other}:{port}{settings.root_path}", flush=True)
        if getattr(options, "open", False):
            import webbrowser

            await asyncio.to_thread(webbrowser.open, own)

    async def run() -> None:
        announcing = asyncio.create_task(announce())
        await server.serve([listener])
        announcing.cancel()

    with asyncio.Runner(loop_factory=config.get_loop_factory()) as runner:
        runner.run(run())
    return 0


def host_addresses(host: str) -> list[str]:
    """Names for `host` in an address: first what this machine opens, then, where it listens to
    all, what others open: its addresses in the network."""
    if host not in ("0.0.0.0", "::"):
        return [f"[{host}]" if ":" in host else host]
    found = []
    for family, far in ((socket.AF_INET, "192.0.2.1"), (socket.AF_INET6, "2001:db8::1")):
        if family == socket.AF_INET6 and host != "::":
            continue
        try:
            # Which of our addresses would be used to reach far away; nothing is sent.
            with socket.socket(family, socket.SOCK_DGRAM) as probe:
                probe.connect((far, 9))
                own = ipaddress.ip_address(probe.getsockname()[0])
        except (OSError, ValueError):
            continue
        if not own.is_loopback and not own.is_unspecified:
            found.append(f"[{own}]" if own.version == 6 else str(own))
    return ["127.0.0.1" if host == "0.0.0.0" else "[::1]", *found, socket.gethostname()]


class _Server(uvicorn.Server):
    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Tells the viewers first: uvicorn closes their connections before the application hears
        that it ends."""
        for server in self.servers:
            server.close()
        await self.config.app.state.sessions.stop()  # type: ignore[union-attr]
        await super().shutdown(sockets)


def _shorten_peer_errors(record: logging.LogRecord) -> bool:
    """What somebody at the other end did wrong, or left unfinished, is no defect with a trace."""
    error = record.exc_info[1] if record.exc_info else None
    if isinstance(error, PEER_ERRORS):
        record.msg = f"a connection was broken off or broken: {type(error).__name__}"
        record.args, record.exc_info, record.levelno = (), None, logging.WARNING
        record.levelname = "WARNING"
    return True


def _settings_error(error: Exception) -> str:
    if not isinstance(error, ValidationError):
        return f"ORCLAB_ORIGINS takes a JSON list of addresses ({error})"
    return "; ".join(
        f"ORCLAB_{str(e['loc'][0]).upper()} = {str(e['input'])[:80]}: {e['msg']}"
        for e in error.errors()
    )


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise LabError(
            f"cannot listen on {host} port {port} ({error.strerror}): "
            "choose another with --port, or --port 0 for any free one"
        ) from None
    return listener
