"""What a refused request answers: a sentence for people, a code for programs."""

import errno
import logging
from collections.abc import Sequence
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from labs.errors import LabError, UnknownLab
from server import pages
from server.guard import HEADERS
from server.messages import Problem
from server.session import Unavailable
from server.sessions import NoSession, SessionsFull

log = logging.getLogger("orclab.requests")

NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EMFILE, errno.ENFILE, errno.ENOMEM}
STATUS_OF: dict[type[LabError], tuple[int, str]] = {
    UnknownLab: (404, "unknown-lab"),
    NoSession: (404, "no-session"),
    SessionsFull: (503, "full"),
    Unavailable: (503, "not-now"),
    LabError: (422, "invalid"),
}
RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"model": Problem, "description": text}
    for status, text in (
        (400, "The body is not JSON"),
        (403, "Wrong Host or Origin"),
        (404, "No such lab or session"),
        (413, "The body is too large"),
        (422, "Refused, and why"),
        (503, "No place, or not now"),
    )
}


def install(app: FastAPI) -> None:
    """Answers errors of the labs, of validation and of HTTP alike."""
    app.add_exception_handler(LabError, _lab_error)
    app.add_exception_handler(RequestValidationError, _validation_error)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(ClientDisconnect, _left)
    app.add_exception_handler(OSError, _no_room)
    app.add_exception_handler(Exception, _defect)


async def _lab_error(_: Request, error: Exception) -> Response:
    for kind in type(error).__mro__:
        if kind in STATUS_OF:
            status, code = STATUS_OF[kind]
            return _problem(status, str(error), code)
    raise error


async def _validation_error(_: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    return _problem(422, describe(error.errors()), "invalid")


def describe(errors: Sequence[Any]) -> str:
    """What a validation found wrong, in sentences for people."""
    sentences = [
        f"{'.'.join(str(part) for part in e['loc'][1:]) or 'body'}: {e['msg']}" for e in errors[:5]
    ]
    return "; ".join(sentences)


async def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    if error.status_code == 404 and "text/html" in request.headers.get("accept", ""):
        return pages.missing(request, "There is nothing at this address")
    sentence = f"{request.method} {request.url.path[:200]}: {error.detail}"
    return _problem(error.status_code, sentence, "http", error.headers)


async def _left(request: Request, _: Exception) -> Response:
    log.warning("%s %s was broken off", request.method, request.url.path[:200])
    return Response(status_code=400)  # nobody reads it


async def _no_room(_: Request, error: Exception) -> Response:
    assert isinstance(error, OSError)
    if error.errno not in NO_ROOM:
        raise error
    log.warning("no room: %s", error)
    sentence = f"the server has no room for this ({error.strerror}): free some, and try again"
    return _problem(503, sentence, "no-room")


async def _defect(request: Request, error: Exception) -> Response:
    sentence = f"{request.method} {request.url.path[:200]} met a defect of the server"
    return _problem(500, f"{sentence} ({type(error).__name__})", "defect", HEADERS)


def _problem(status: int, error: str, code: str, headers: Any = None) -> Response:
    return JSONResponse({"error": error, "code": code}, status, headers)
