"""A small proxy that shows a server under a path, as JupyterHub does, and takes the path away."""

import asyncio
import contextlib
import threading
from collections.abc import Iterator
from urllib.parse import urlsplit

NOT_FOUND = b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"


class PathProxy:
    """Relays what comes under `prefix` to a server, WebSockets too: a connection a request."""

    def __init__(self, prefix: str, server: str) -> None:
        self.prefix = prefix
        self.stray: list[str] = []
        """What was asked for outside of the prefix."""
        self._there = urlsplit(server)

    @contextlib.contextmanager
    def running(self) -> Iterator[str]:
        """Yields the address of the prefix."""
        loop = asyncio.new_event_loop()
        thread = threading.Thread(target=loop.run_forever, daemon=True)
        thread.start()
        starting = asyncio.start_server(self._serve, "127.0.0.1", 0)
        listening = asyncio.run_coroutine_threadsafe(starting, loop).result()
        port = listening.sockets[0].getsockname()[1]
        try:
            yield f"http://127.0.0.1:{port}{self.prefix}"
        finally:
            loop.call_soon_threadsafe(loop.stop)
            thread.join()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, asyncio.IncompleteReadError):
            head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
            method, target, rest = head.split(" ", 2)
            if target.startswith(f"{self.prefix}/"):
                head = f"{method} {target.removeprefix(self.prefix)} {rest}"
                if "\r\nupgrade:" not in head.lower():
                    head = head.replace("Connection: keep-alive", "Connection: close")
                there = await asyncio.open_connection(self._there.hostname, self._there.port)
                there[1].write(head.encode("latin-1"))
                await asyncio.gather(_relay(reader, there[1]), _relay(there[0], writer))
            else:
                self.stray.append(target)
                writer.write(NOT_FOUND)
        writer.close()


async def _relay(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while part := await reader.read(65536):
            writer.write(part)
            await writer.drain()
        writer.close()
