"""What every request passes: who may ask (Host, Origin), and how much (body size)."""

from urllib.parse import urlsplit

from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.settings import Settings

LOOPBACK = {"127.0.0.1", "localhost", "::1"}
SAFE = {"GET", "HEAD", "OPTIONS"}


class Guard:
    """ASGI middleware. A page of another origin may neither change anything nor open a
    WebSocket; a name that only pretends to be this machine (DNS rebinding) is refused; a body
    larger than allowed is not read."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._limits = settings.max_body_bytes, settings.max_solution_bytes
        self._origins = set(settings.origins)
        self._hosts = LOOPBACK if settings.host in LOOPBACK else None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {k.decode("latin-1"): v.decode("latin-1") for k, v in scope["headers"]}
        refusal = self._refusal(scope, headers)
        if refusal is None:
            await self._app(scope, _bounded(receive, self._limit(scope)), send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": refusal[1][:120]})
        else:
            status, sentence, code = refusal
            response = JSONResponse({"error": sentence, "code": code}, status)
            await response(scope, receive, send)

    def _refusal(self, scope: Scope, headers: dict[str, str]) -> tuple[int, str, str] | None:
        host = headers.get("host", "")
        if self._hosts is not None and _hostname(host) not in self._hosts:
            return 403, f"this server answers to localhost, not to {host[:80]!r}", "wrong-host"
        origin = headers.get("origin")
        changes = scope["type"] == "websocket" or scope["method"] not in SAFE
        if origin and changes and not self._allowed(origin, host):
            return 403, f"pages of {origin[:80]!r} may not use this server", "wrong-origin"
        length = headers.get("content-length", "0")
        if not length.isdigit() or int(length) > self._limit(scope):
            return 413, _too_large(self._limit(scope)), "too-large"
        return None

    def _limit(self, scope: Scope) -> int:
        """[bytes] Of a body: a solution may be larger than all else."""
        usual, solution = self._limits
        is_solution = scope.get("method") == "PUT" and scope["path"].endswith("/solution")
        return solution if is_solution else usual

    def _allowed(self, origin: str, host: str) -> bool:
        return origin in self._origins or urlsplit(origin).netloc == host


def _bounded(receive: Receive, limit: int) -> Receive:
    read = 0

    async def bounded() -> Message:
        nonlocal read
        message = await receive()
        if message["type"] == "http.request":
            read += len(message.get("body", b""))
            if read > limit:
                raise HTTPException(413, _too_large(limit))
        return message

    return bounded


def _too_large(limit: int) -> str:
    return f"a request body may have {limit} bytes at most"


def _hostname(host: str) -> str:
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""
