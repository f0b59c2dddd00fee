"""What every request passes: where the server is (a path prefix), who may ask (Host, Origin), how
much (body size); and what every answer says to the browser."""

from urllib.parse import urlsplit

from starlette.datastructures import MutableHeaders
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.settings import Settings

LOOPBACK = {"127.0.0.1", "localhost", "::1"}
SAFE_METHODS = {"GET", "HEAD", "OPTIONS"}
START_MESSAGES = ("http.response.start", "websocket.accept", "websocket.http.response.start")
SECURITY_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    # Of what is no page: it loads nothing, should somebody open it as one.
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; "
    "frame-ancestors 'self'; base-uri 'none'; form-action 'none'",
}


class Guard:
    """ASGI middleware. A page of another origin may neither change anything nor open a
    WebSocket; a name that only pretends to be this machine (DNS rebinding) is refused; a body
    larger than allowed is not read. HEAD is answered as GET is, without the body."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._prefix = settings.root_path
        self._limits = settings.max_body_bytes, settings.max_solution_bytes
        self._origins = set(settings.origins)
        named = {_hostname(urlsplit(origin).netloc) for origin in settings.origins}
        self._hosts = LOOPBACK | named if settings.host in LOOPBACK else None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {k.decode("latin-1"): v.decode("latin-1") for k, v in scope["headers"]}
        refusal = self._refusal(scope, headers)
        sending = _add_headers(scope, receive, send)
        if refusal is None:
            inside = self._inner_scope(scope)
            await self._app(inside, _limit_body(receive, self._body_limit(inside)), sending)
        else:
            status, sentence, code = refusal
            response = JSONResponse({"error": sentence, "code": code}, status)
            await response(scope, receive, sending)

    def _inner_scope(self, scope: Scope) -> Scope:
        """As the application sees it: without the prefix, which some proxies take away and others
        leave there; and a HEAD as the GET whose body uvicorn keeps back."""
        path, raw = scope["path"], scope.get("raw_path") or b""
        prefix = self._prefix.encode()
        if self._prefix and path.startswith(f"{self._prefix}/"):
            path = path.removeprefix(self._prefix)
            raw = raw.removeprefix(prefix) if raw.startswith(prefix) else path.encode()
        method = {"method": "GET"} if scope.get("method") == "HEAD" else {}
        return {**scope, "path": path, "raw_path": raw, **method}

    def _refusal(self, scope: Scope, headers: dict[str, str]) -> tuple[int, str, str] | None:
        host = headers.get("host", "")
        if self._hosts is not None and _hostname(host) not in self._hosts:
            sentence = f"this server answers to localhost, not to {host[:80]!r}: behind a proxy, "
            sentence += "ORCLAB_ORIGINS names the address it has there"
            return 403, sentence, "wrong-host"
        origin = headers.get("origin")
        changes = scope["type"] == "websocket" or scope["method"] not in SAFE_METHODS
        if origin and changes and not self._is_allowed_origin(origin, host):
            sentence = f"pages of {origin[:80]!r} may not use this server, unless ORCLAB_ORIGINS "
            return 403, sentence + "names them", "wrong-origin"
        length = headers.get("content-length", "0")
        bounded = length.isascii() and length.isdecimal() and len(length) < 16
        if not bounded or int(length) > self._body_limit(scope):
            return 413, _too_large(self._body_limit(scope)), "too-large"
        return None

    def _body_limit(self, scope: Scope) -> int:
        """[bytes] Of a body: a solution may be larger than all else."""
        usual, solution = self._limits
        is_solution = scope.get("method") == "PUT" and scope["path"].endswith("/solution")
        return solution if is_solution else usual

    def _is_allowed_origin(self, origin: str, host: str) -> bool:
        try:
            return origin in self._origins or urlsplit(origin).netloc == host
        except ValueError:  # http://[
            return False


def _add_headers(scope: Scope, receive: Receive, send: Send) -> Send:
    """Sends with our headers, and says why a WebSocket is closed that was not yet open."""
    is_open = scope["type"] != "websocket"

    async def sending(message: Message) -> None:
        nonlocal is_open
        if message["type"] == "websocket.close" and not is_open:
            why = message.get("reason") or "there is no WebSocket at this address"
            refusal = JSONResponse({"error": why, "code": "no-websocket"}, 403)
            await refusal(scope, receive, sending)
            return
        if message["type"] in START_MESSAGES:
            is_open = True
            headers = MutableHeaders(scope={"headers": message.get("headers", [])})
            for name, value in SECURITY_HEADERS.items():
                headers.setdefault(name, value)
            message = {**message, "headers": headers.raw}
        await send(message)

    return sending


def _limit_body(receive: Receive, limit: int) -> Receive:
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
