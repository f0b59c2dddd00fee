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
from server.guard import SECURITY_HEADERS
from server.messages import ErrorBody
from server.session import SessionUnavailable
from server.sessions import SessionsFull, UnknownSession

log = logging.getLogger("orclab.requests")

RESOURCE_ERRNOS = {
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EFBIG,
    errno.EMFILE,
    errno.ENFILE,
    errno.ENOMEM,
}
STATUS_BY_ERROR: dict[type[LabError], tuple[int, str]] = {
    UnknownLab: (404, "unknown-lab"),
    UnknownSession: (404, "no-session"),
    SessionsFull: (503, "full"),
    SessionUnavailable: (503, "not-now"),
    LabError: (422, "invalid"),
}
ERROR_RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"model": ErrorBody, "description": text}
    for status, text in (
        (400, "The body is not JSON"),
        (403, "Wrong Host or Origin"),
        (404, "No such lab or session"),
        (413, "The body is too large"),
        (422, "Refused, and why"),
        (503, "No place, or not now"),
    )
}


def install_handlers(app: FastAPI) -> None:
    """Answers errors of the labs, of validation and of HTTP alike."""
    app.add_exception_handler(LabError, _lab_error)
    app.add_exception_handler(RequestValidationError, _validation_error)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(ClientDisconnect, _client_left)
    app.add_exception_handler(OSError, _out_of_resources)
    app.add_exception_handler(Exception, _server_error)


async def _lab_error(_: Request, error: Exception) -> Response:
    for kind in type(error).__mro__:
        if kind in STATUS_BY_ERROR:
            status, code = STATUS_BY_ERROR[kind]
            return _error_response(status, str(error), code)
    raise error


async def _validation_error(_: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    return _error_response(422, describe_errors(error.errors()), "invalid")


def describe_errors(errors: Sequence[Any]) -> str:
    """What a validation found wrong, in sentences for people."""
    sentences = [
        f"{'.'.join(str(part) for part in e['loc'][1:]) or 'body'}: {e['msg']}" for e in errors[:5]
    ]
    return "; ".join(sentences)


async def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    if error.status_code == 404 and "text/html" in request.headers.get("accept", ""):
        return pages.not_found_page(request, "There is nothing at this address")
    sentence = f"{request.method} {request.url.path[:200]}: {error.detail}"
    return _error_response(error.status_code, sentence, "http", error.headers)


async def _client_left(request: Request, _: Exception) -> Response:
    log.warning("%s %s was broken off", request.method, request.url.path[:200])
    return Response(status_code=400)  # nobody reads it


async def _out_of_resources(_: Request, error: Exception) -> Response:
    assert isinstance(error, OSError)
    if error.errno not in RESOURCE_ERRNOS:
        raise error
    log.warning("no room: %s", error)
    sentence = f"the server has no room for this ({error.strerror}): free some, and try again"
    return _error_response(503, sentence, "no-room")


async def _server_error(request: Request, error: Exception) -> Response:
    sentence = f"{request.method} {request.url.path[:200]} met a defect of the server"
    return _error_response(500, f"{sentence} ({type(error).__name__})", "defect", SECURITY_HEADERS)


def _error_response(status: int, error: str, code: str, headers: Any = None) -> Response:
    return JSONResponse({"error": error, "code": code}, status, headers)
