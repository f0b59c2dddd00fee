"""WebSockets as uvicorn speaks them; whom it refuses hears as much as from every other answer."""

import logging
from http import HTTPStatus
from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.http11 import Response
from websockets.server import ServerProtocol
from websockets.typing import StatusLike

from server.guard import SECURITY_HEADERS


class _Handshake(ServerProtocol):
    def reject(self, status: StatusLike, text: str) -> Response:
        response = super().reject(status, text)
        response.headers.update(SECURITY_HEADERS)
        return response


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """A connection."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.conn = _Handshake(
            max_size=self.config.ws_max_size, logger=logging.getLogger("uvicorn.error")
        )

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.conn.handshake_exc and not self.handshake_initiated:
            # Sound HTTP, but no handshake: uvicorn would wait for ever.
            self.handshake_initiated = self.handshake_complete = self.close_sent = True
            why = f"{self.conn.handshake_exc.__cause__ or self.conn.handshake_exc}\n"
            response = self.conn.reject(HTTPStatus.BAD_REQUEST, f"no WebSocket begins so: {why}")
            self.transport.write(response.serialize())
            self.transport.close()

    async def send(self, message: Any) -> None:
        await super().send(message)
        if self.close_sent:
            self.handshake_complete = True  # by a refusal, which uvicorn takes for a defect
