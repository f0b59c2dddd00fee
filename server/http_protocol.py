"""HTTP as uvicorn speaks it, but not for ever with whom does not finish, nor on after a fault."""

import asyncio
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from server.guard import SECURITY_HEADERS

REQUEST_SECONDS = 30.0
"""From a request's first byte to its last: a student's upload over a slow network takes less."""


class HttpProtocol(H11Protocol):
    """A connection."""

    request_seconds = REQUEST_SECONDS
    _deadline: asyncio.TimerHandle | None = None
    _upgraded = False
    """To a WebSocket, which another protocol now speaks on this transport."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._start_deadline()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.conn.their_state in (h11.IDLE, h11.SEND_BODY):
            self._start_deadline()
        else:
            self._cancel_deadline()

    def connection_lost(self, exc: Exception | None) -> None:
        self._cancel_deadline()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        if self.conn.their_state is not h11.SEND_BODY:
            self._cancel_deadline()  # the next request's first byte begins it anew
        super().on_response_complete()
        if self.conn.their_state is h11.SEND_BODY:
            self._start_deadline()  # its first bytes came with those of the one now answered

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        self._upgraded = True
        self._cancel_deadline()
        super().handle_websocket_upgrade(event)

    def send_400_response(self, msg: str) -> None:
        """Of a request that is broken in the middle, the answer under way has nowhere to go."""
        cycle: Any = self.cycle
        if cycle and not cycle.response_complete:
            cycle.disconnected = True
            cycle.message_event.set()
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            headers = [("Content-Type", "text/plain; charset=utf-8"), ("Connection", "close")]
            response = h11.Response(status_code=400, headers=[*headers, *SECURITY_HEADERS.items()])
            for part in (response, h11.Data(data=msg.encode()), h11.EndOfMessage()):
                self.transport.write(self.conn.send(part))
        self.transport.close()

    def _start_deadline(self) -> None:
        if not (self._deadline or self._upgraded or self.transport.is_closing()):
            self._deadline = self.loop.call_later(self.request_seconds, self._close_on_timeout)

    def _cancel_deadline(self) -> None:
        if self._deadline:
            self._deadline.cancel()
            self._deadline = None

    def _close_on_timeout(self) -> None:
        self._deadline = None
        self.transport.close()
