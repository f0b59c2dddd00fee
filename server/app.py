"""The web application: the API, the pages, the stream and the scenes."""

import asyncio
import contextlib
import tempfile
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Body, FastAPI, Query, Request
from fastapi.responses import FileResponse
from starlette.background import BackgroundTask

from labs.engine.catalog import catalog, find_lab
from labs.engine.plot_data import file_name
from labs.engine.record import versions
from server import error_responses, pages, proxy, stream
from server.commands import Command, execute
from server.guard import Guard
from server.messages import (
    Changes,
    CommandLine,
    Health,
    LabInfo,
    NewSession,
    ParamValues,
    SessionInfo,
)
from server.scratch import scratch_folder
from server.session import Session, SessionUnavailable
from server.sessions import Sessions
from server.settings import Settings
from server.supervisor import Supervisor

MEDIA = {
    "json": "application/json",
    "csv": "text/csv",
    "npz": "application/octet-stream",
    "zip": "application/zip",
}
api = APIRouter(prefix="/api", responses=error_responses.ERROR_RESPONSES)


def create_app(settings: Settings | None = None) -> FastAPI:
    """The application; its workers live as long as it runs."""
    settings = settings or Settings()
    catalog()  # a broken lab shows now, not at the first request

    @contextlib.asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        supervisor = Supervisor(settings)
        sessions = Sessions(settings, supervisor)
        with scratch_folder() as folder:
            app.state.supervisor, app.state.sessions = supervisor, sessions
            app.state.folder = folder
            supervisor.start()
            sessions.start()
            yield
            await sessions.stop()
            await supervisor.stop()

    app = FastAPI(
        title="orclab",
        version=versions()["orclab"],
        summary="An interactive lab for optimization-based robot control.",
        lifespan=lifespan,
        docs_url=None,  # its pages load scripts from elsewhere; ours does not
        redoc_url=None,
        redirect_slashes=False,  # it would name an address as seen behind a proxy
    )
    app.state.settings = settings
    app.add_middleware(Guard, settings=settings)
    app.include_router(api)
    app.include_router(health)
    app.include_router(stream.router)
    app.include_router(proxy.router)
    pages.install_pages(app)
    error_responses.install_handlers(app)
    return app


health = APIRouter()


@health.get("/healthz")
async def healthz(request: Request) -> Health:
    """Whether the server is well, and how busy."""
    state = request.app.state
    return Health(
        status="ok",
        version=versions()["orclab"],
        sessions=len(state.sessions),
        workers=state.supervisor.count,
        spares=state.supervisor.spares,
        preparing=state.supervisor.preparing,
    )


@api.get("/labs")
async def list_labs() -> list[LabInfo]:
    """All labs in the order of the course, with their parameters."""
    return [
        LabInfo(
            slug=slug,
            title=entry.lab.title,
            section=entry.lab.section,
            summary=entry.lab.summary,
            chapter=f"{entry.chapter} {entry.chapter_title}",
            params=entry.lab.Params.describe(),
            presets={name: dict(values) for name, values in entry.lab.presets.items()},
            actions=[action.name for action in entry.lab.actions],
        )
        for slug, entry in catalog().items()
    ]


@api.post("/sessions", status_code=201)
async def create_session(request: Request, new: NewSession) -> SessionInfo:
    """Opens a lab."""
    try:
        session = await _sessions(request).create(find_lab(new.lab), new)
    except asyncio.CancelledError:
        raise SessionUnavailable(
            "the server stops: start it again, and open the lab anew"
        ) from None
    return session.info()


@api.get("/sessions/{session_id}")
async def get_session(request: Request, session_id: str) -> SessionInfo:
    """Where a session stands."""
    return _session(request, session_id).info()


@api.delete("/sessions/{session_id}", status_code=204)
async def delete_session(request: Request, session_id: str) -> None:
    """Ends a session."""
    await _sessions(request).delete(session_id)


@api.patch("/sessions/{session_id}/params")
async def change_params(
    request: Request, session_id: str, changes: Annotated[Changes, Body()]
) -> ParamValues:
    """Changes some parameters, all or nothing; answers all of them."""
    return ParamValues(params=await _session(request, session_id).change(changes))


@api.post("/sessions/{session_id}/commands", status_code=204)
async def command(request: Request, session_id: str, command: Annotated[Command, Body()]) -> None:
    """Run, pause, step, reset, speed, seed, apply, press, view; and of the solver run, pause,
    step, show, pace."""
    await execute(_session(request, session_id), command)


@api.get("/sessions/{session_id}/command")
async def command_line(request: Request, session_id: str) -> CommandLine:
    """The `orclab run` line that reproduces what was recorded."""
    return CommandLine(command=await _session(request, session_id).ask("command_line"))


@api.get(
    "/sessions/{session_id}/export.{form}",
    response_class=FileResponse,
    responses={200: {"content": {MEDIA[form]: {} for form in ("json", "csv", "npz")}}},
)
async def export(
    request: Request, session_id: str, form: Literal["json", "csv", "npz"]
) -> FileResponse:
    """The recorded run: channels, parameters and their changes, versions, what it covers."""
    session = _session(request, session_id)
    return await _file_response(request, session, "export", form, f"{session.entry.slug}.{form}")


@api.get(
    "/sessions/{session_id}/solution.{form}",
    response_class=FileResponse,
    responses={200: {"content": {MEDIA[form]: {} for form in ("json", "npz")}}},
)
async def save_solution(
    request: Request, session_id: str, form: Literal["json", "npz"]
) -> FileResponse:
    """What is shown of the solver, with the parameters and the seed it belongs to."""
    session = _session(request, session_id)
    return await _file_response(
        request, session, "solution", form, f"{session.entry.slug}-solution.{form}"
    )


@api.get(
    "/sessions/{session_id}/plots.{form}",
    response_class=FileResponse,
    responses={200: {"content": {MEDIA[form]: {} for form in ("csv", "json", "zip")}}},
)
async def plots(
    request: Request,
    session_id: str,
    form: Literal["csv", "json", "zip"],
    title: Annotated[str, Query(max_length=200)] = "",
) -> FileResponse:
    """What the plots show now, in full precision: the one of this title, or all; CSV is of one."""
    session = _session(request, session_id)
    name = "-".join(filter(None, (session.entry.slug, file_name(title) if title else "plots")))
    titles = [title] if title else []
    return await _file_response(request, session, "plots", form, f"{name}.{form}", titles=titles)


@api.put(
    "/sessions/{session_id}/solution",
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {
                media: {"schema": {"type": "string", "format": "binary"}}
                for media in (MEDIA["json"], MEDIA["npz"])
            },
        }
    },
)
async def load_solution(request: Request, session_id: str) -> ParamValues:
    """Begins anew with a saved solution (the file, JSON or NPZ) and its parameters, and pauses
    the solver, which goes on from there; answers all parameters."""
    session = _session(request, session_id)
    path = _temporary_path(request)
    try:
        with path.open("wb") as file:
            async for part in request.stream():
                file.write(part)
        return ParamValues(params=await session.load(str(path)))
    finally:
        path.unlink()


async def _file_response(
    request: Request, session: Session, what: str, form: str, name: str, **more: Any
) -> FileResponse:
    """A file that the session's worker writes."""
    path = _temporary_path(request)
    try:
        await session.write_file(what, form, str(path), **more)
    except BaseException:
        path.unlink()
        raise
    return FileResponse(
        path, media_type=MEDIA[form], filename=name, background=BackgroundTask(path.unlink)
    )


def _temporary_path(request: Request) -> Path:
    with tempfile.NamedTemporaryFile(dir=request.app.state.folder, delete=False) as file:
        return Path(file.name)


def _sessions(request: Request) -> Sessions:
    sessions: Sessions = request.app.state.sessions
    return sessions


def _session(request: Request, session_id: str) -> Session:
    return _sessions(request).find(session_id)
