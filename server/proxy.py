"""The way to a session's 3D scene: Viser's page, and its WebSocket relayed to the worker.

One message in, one out, and no queue in between: a viewer that reads slowly slows only the
stream it reads, and Viser merges what waits there."""

import asyncio
import contextlib
import gzip
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import websockets
from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from server.pages import websocket_sources
from server.sessions import Sessions, UnknownSession

router = APIRouter(include_in_schema=False)

GONE, TRY_AGAIN = 4404, 1013
RESTARTING = "the scene is being restarted: try again in a moment"
CLOSE_SECONDS = 0.5
"""A worker, which may be busy or gone, is not waited for longer: nobody is at that end."""
HEAD_INSERT = (
    b'<link rel="stylesheet" href="../../static/css/scene.css">'
    b'<script type="module" src="../../static/js/scene.js"></script>'
)
"""Put into its head."""
SCRIPT_END = b"</script>"


@cache
def viser_page() -> tuple[bytes, bytes]:
    """Viser's client, one HTML file, with our style and script: plain, and compressed.

    Its script stands in the head and asks for `<div id="root">` once the page is parsed, or the
    load was broken off: a frame that is sent elsewhere while it loads would run it without a body
    (React's error 299). Here it comes after the element it draws in."""
    spec = find_spec("viser")
    assert spec is not None
    assert spec.origin is not None
    page = (Path(spec.origin).parent / "client" / "build" / "index.html").read_bytes()
    start, end = page.index(b"<script"), page.index(SCRIPT_END) + len(SCRIPT_END)
    script, page = page[start:end], page[:start] + page[end:]
    page = page.replace(b"</head>", HEAD_INSERT + b"</head>", 1)
    page = page.replace(b"</body>", script + b"</body>", 1)
    return page, gzip.compress(page)


@router.get("/scene/{session_id}/")
async def scene_page(request: Request, session_id: str) -> Response:
    """The scene's page, for an iframe. It finds its WebSocket from its own address."""
    sessions: Sessions = request.app.state.sessions
    try:
        sessions.find(session_id)
    except UnknownSession as error:
        return HTMLResponse(f"<!doctype html><title>No scene</title><p>{error}</p>", 404)
    plain, compressed = viser_page()
    policy = (
        # Viser's client is one page with its script in it, which compiles and decodes in workers.
        "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
        "worker-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; font-src 'self' data:; "
        f"img-src 'self' data: blob:; connect-src 'self' data: blob:{websocket_sources(request)}; "
        "frame-ancestors 'self'; object-src 'none'; base-uri 'none'; form-action 'none'"
    )
    headers = {
        "Cache-Control": "no-cache",
        "X-Frame-Options": "SAMEORIGIN",
        "Content-Security-Policy": policy,
    }
    if "gzip" in request.headers.get("accept-encoding", ""):
        return HTMLResponse(compressed, headers=headers | {"Content-Encoding": "gzip"})
    return HTMLResponse(plain, headers=headers)


@router.websocket("/scene/{session_id}")
async def scene_socket(socket: WebSocket, session_id: str) -> None:
    """Relays Viser's protocol between a browser and the session's worker."""
    sessions: Sessions = socket.app.state.sessions
    offered = [p for p in socket.scope["subprotocols"] if p.startswith("viser-v")]
    try:
        worker = sessions.find(session_id).worker
    except UnknownSession as error:
        await socket.accept(offered[0] if offered else None)
        await socket.close(GONE, str(error)[:120])
        return
    if not offered:
        await socket.close(TRY_AGAIN, "a scene speaks Viser's protocol alone: open its page")
        return
    if worker is None or worker.gone:
        await socket.close(TRY_AGAIN, RESTARTING)
        return
    try:
        async with connect(
            f"ws://127.0.0.1:{worker.port}",
            subprotocols=[Subprotocol(offered[0])],
            max_size=None,
            max_queue=4,
            compression=None,
            close_timeout=CLOSE_SECONDS,
            ping_interval=None,
            proxy=None,
        ) as upstream:
            await socket.accept(offered[0])
            await _relay(socket, upstream)
    except (OSError, websockets.InvalidHandshake):
        with contextlib.suppress(WebSocketDisconnect):  # the browser may have left as well
            await socket.close(TRY_AGAIN, RESTARTING)
    except asyncio.CancelledError:
        pass  # The server stops and waits no longer; what was open is closed.


async def _relay(socket: WebSocket, upstream: ClientConnection) -> None:
    """Both directions until either ends, then the other is ended too."""
    directions = [
        asyncio.create_task(_to_worker(socket, upstream)),
        asyncio.create_task(_to_browser(socket, upstream)),
    ]
    try:
        await asyncio.wait(directions, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for direction in directions:
            direction.cancel()
        results = await asyncio.gather(*directions, return_exceptions=True)
    for result in results:
        expected = (WebSocketDisconnect, websockets.ConnectionClosed, asyncio.CancelledError)
        if isinstance(result, BaseException) and not isinstance(result, expected):
            raise result


async def _to_worker(socket: WebSocket, upstream: ClientConnection) -> None:
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            return
        await upstream.send(message.get("bytes") or message.get("text") or b"")


async def _to_browser(socket: WebSocket, upstream: ClientConnection) -> None:
    async for message in upstream:
        if isinstance(message, str):
            await socket.send_text(message)
        else:
            await socket.send_bytes(message)
    await socket.close(TRY_AGAIN)
