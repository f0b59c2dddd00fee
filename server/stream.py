"""A session's WebSocket: tells its page what happens, and does what the page asks for.

A knob that is dragged sends a message a frame: a request of HTTP each would cost more than the
simulation's own step. Requests are done in their order; the status that a request has changed is
told before its answer."""

import asyncio
import contextlib
from typing import Annotated, Literal

from fastapi import APIRouter
from pydantic import BaseModel, Field, TypeAdapter, ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from labs.errors import LabError
from server.commands import Command, execute
from server.error_responses import describe_errors
from server.messages import Answer, Changes, Message
from server.session import Session
from server.sessions import Sessions, UnknownSession
from server.uptime_clock import UptimeClock
from server.viewers import Viewer

SEND_SECONDS = 20.0
"""A viewer that takes this long for one message has left."""
ENDED, TOO_LARGE = 4404, 1009

router = APIRouter()

RequestNumber = Annotated[int, Field(ge=0, le=2**53)]
"""Comes back with the answer."""


class ParamsRequest(Message):
    """New values of some parameters, all or none."""

    type: Literal["params"]
    ref: RequestNumber
    changes: Changes


class CommandRequest(Message):
    """A command."""

    type: Literal["command"]
    ref: RequestNumber
    command: Command


class _RequestReference(BaseModel):
    """Of a message that is otherwise wrong, what its answer belongs to."""

    ref: RequestNumber = 0


_request: TypeAdapter[ParamsRequest | CommandRequest] = TypeAdapter(
    Annotated[ParamsRequest | CommandRequest, Field(discriminator="type")]
)


@router.websocket("/api/sessions/{session_id}/stream")
async def stream(socket: WebSocket, session_id: str) -> None:
    """Out: hello, telemetry, status, notices, answers. In: params, commands."""
    await socket.accept()
    sessions: Sessions = socket.app.state.sessions
    try:
        session = sessions.find(session_id)
    except UnknownSession as error:
        await socket.close(ENDED, str(error)[:120])
        return
    viewer = session.add_viewer()
    sending = asyncio.create_task(_send(socket, viewer))
    try:
        await _receive(socket, session, viewer)
    except (WebSocketDisconnect, RuntimeError):
        pass  # It left in the middle of a message.
    except asyncio.CancelledError:
        pass  # The server stops and waits no longer.
    finally:
        session.remove_viewer(viewer)
        sending.cancel()


async def _receive(socket: WebSocket, session: Session, viewer: Viewer) -> None:
    limit = socket.app.state.settings.max_body_bytes
    while (message := await socket.receive())["type"] != "websocket.disconnect":
        text = message.get("text") or ""
        if len(text) > limit:
            await socket.close(TOO_LARGE, f"a message may have {limit} characters at most")
            return
        answer = await answer_request(session, text)
        session.reply(viewer, answer.model_dump_json().encode())


async def answer_request(session: Session, text: str) -> Answer:
    """Does what a message asks for, whatever it is."""
    try:
        request = _request.validate_json(text)
    except ValidationError as error:
        try:
            ref = _RequestReference.model_validate_json(text).ref
        except ValidationError:
            ref = 0
        return Answer(ref=ref, error=describe_errors(error.errors()))
    try:
        if isinstance(request, ParamsRequest):
            await session.change(request.changes)
        else:
            await execute(session, request.command)
    except LabError as error:
        return Answer(ref=request.ref, error=str(error))
    return Answer(ref=request.ref)


async def _send(socket: WebSocket, viewer: Viewer) -> None:
    clock: UptimeClock = socket.app.state.supervisor.clock
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, TimeoutError):
        async for payload in viewer.messages():
            async with clock.timeout(SEND_SECONDS):
                await socket.send_text(payload.decode())
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        await socket.close(ENDED)
