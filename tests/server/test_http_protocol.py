"""Connections that never finish what they begin."""

import asyncio
import contextlib
from collections.abc import AsyncIterator

import uvicorn
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket
from websockets.asyncio.client import connect

from server.http_protocol import HttpProtocol
from tests.server_process import run_in_thread

SECONDS = 0.3
HEAD = b"POST / HTTP/1.1\r\nHost: here\r\n"


class ShortTimeoutProtocol(HttpProtocol):
    request_seconds = SECONDS


async def slow(scope: Scope, receive: Receive, send: Send) -> None:
    """Reads the body, and thinks for longer than a request may take; so over a WebSocket."""
    if scope["type"] == "websocket":
        socket = WebSocket(scope, receive, send)
        await socket.accept()
        await asyncio.sleep(2 * SECONDS)
        return await socket.send_text("still here")
    assert scope["type"] == "http"
    body = await Request(scope, receive).body()
    await asyncio.sleep(2 * SECONDS)
    await PlainTextResponse(body)(scope, receive, send)


@contextlib.asynccontextmanager
async def serving() -> AsyncIterator[int]:
    config = uvicorn.Config(
        slow,
        http=ShortTimeoutProtocol,
        port=0,
        lifespan="off",
        log_level="critical",
        timeout_keep_alive=1,
    )
    server = uvicorn.Server(config)
    task = asyncio.create_task(server.serve())
    while not server.started:
        await asyncio.sleep(0.01)
    try:
        yield server.servers[0].sockets[0].getsockname()[1]
    finally:
        server.should_exit = True
        await task


async def read_to_end(port: int, *parts: bytes) -> bytes:
    """All that comes until the server closes, though nobody here does."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    for part in parts:
        writer.write(part)
        await writer.drain()
        await asyncio.sleep(SECONDS / 10)
    try:
        return await asyncio.wait_for(reader.read(), 20)
    except ConnectionError:
        return b""
    finally:
        writer.close()


def test_unfinished_requests_time_out_and_slow_answers_do_not() -> None:
    """Nothing said; half a head; half a body; and after a whole request half of another, later or
    with it."""
    whole = HEAD + b"Content-Length: 2\r\n\r\nhi"
    part = HEAD + b"Content-Length: 9\r\n\r\nhi"

    async def speak() -> list[bytes]:
        async with serving() as port:
            unfinished = [(), (HEAD,), (HEAD, b"Content-Length: 9\r\n\r\n", b"hi")]
            answered = [(whole,), (HEAD, whole.removeprefix(HEAD)), (whole, HEAD), (whole + part,)]
            sayings = [*unfinished, *answered]
            return await asyncio.gather(*(read_to_end(port, *parts) for parts in sayings))

    *ended, once, in_parts, twice, at_once = run_in_thread(speak())
    assert not any(said.startswith(b"HTTP/1.1 200") for said in ended)
    for said in (once, in_parts, twice, at_once):
        assert said.startswith(b"HTTP/1.1 200")
        assert said.endswith(b"hi")
        assert said.count(b"HTTP/1.1") == 1


def test_a_websocket_lives_on() -> None:
    async def hear() -> str | bytes:
        async with serving() as port, connect(f"ws://127.0.0.1:{port}/") as socket:
            return await socket.recv()

    assert run_in_thread(hear()) == "still here"
