"""Live sessions: who watches, what their parameters are, and what happens when a worker dies."""

import asyncio
import contextlib
import secrets
from collections import deque
from typing import Any

import orjson

from labs.engine.catalog import Entry
from labs.errors import LabError
from labs.params import Params
from server.messages import NewSession, Notice, SessionInfo
from server.pipe import HELLO, STATUS
from server.settings import Settings
from server.supervisor import Supervisor, Worker, WorkerGone
from server.tasks import Tasks
from server.viewers import Viewer

CRASHES, CRASH_SECONDS = 3, 60.0


class SessionsFull(LabError):
    """The limit of live sessions is reached."""


class NoSession(LabError):
    """No session has this id (any more)."""


class Unavailable(LabError):
    """The session's worker is being replaced."""


class Session:
    """One user's lab."""

    def __init__(self, entry: Entry, params: Params, new: NewSession) -> None:
        self.id = secrets.token_urlsafe(18)
        self.entry = entry
        self.state = "starting"
        self.worker: Worker | None = None
        self.viewers: set[Viewer] = set()
        # What a new worker needs to go on where the last one ended.
        self._latest: dict[str, Any] = {
            "params": params.model_dump(),
            "seed": new.seed,
            "view": new.view.model_dump(),
            "running": True,
            "speed": 1.0,
            "solver": None,
        }
        self._latest_frames: dict[int, bytes] = {}
        self._crashes: deque[float] = deque(maxlen=CRASHES)
        now = asyncio.get_running_loop().time()
        self.watched = self.touched = now
        """When somebody last watched, and last did something [s, loop's clock]."""

    def info(self) -> SessionInfo:
        return SessionInfo.model_validate(
            {
                "id": self.id,
                "lab": self.entry.slug,
                "params": self._latest["params"],
                "seed": self._latest["seed"],
                "state": self.state,
                "scene": f"/scene/{self.id}/",
                "stream": f"/api/sessions/{self.id}/stream",
            }
        )

    async def open(self, supervisor: Supervisor) -> None:
        """Takes a worker and sets it to work where the last one ended."""
        worker = await supervisor.take()
        worker.on_frame = self._on_frame
        self.worker = worker
        self.state = "live"
        worker.send("open", lab=self.entry.slug, **self._latest)
        worker.send("viewers", count=len(self.viewers))

    async def change(self, changes: dict[str, Any]) -> dict[str, Any]:
        """New parameters; answers all of them. Raises ParameterError, Unavailable."""
        self.entry.lab.Params().change(changes)
        params: dict[str, Any] = await self.ask("params", changes=changes)
        self._latest["params"] = params
        return params

    async def ask(self, do: str, **arguments: Any) -> Any:
        """What the worker answers. Raises LabError, Unavailable."""
        self.touched = asyncio.get_running_loop().time()
        try:
            return await self._live_worker().ask(do, **arguments)
        except WorkerGone:
            raise self._unavailable() from None

    async def load(self, path: str) -> dict[str, Any]:
        """Takes up a solution from a file; answers all parameters. Raises LabError, Unavailable."""
        params: dict[str, Any] = await self.ask("load", path=path)
        self._latest["params"] = params
        return params

    async def write(self, what: str, form: str, path: str) -> None:
        """Writes the recording ("export") or the solution to a file. Raises as `ask`."""
        try:
            await self._live_worker().ask_for_file(what, form, path)
        except WorkerGone:
            raise self._unavailable() from None

    def _live_worker(self) -> Worker:
        if self.worker is None or self.worker.gone:
            raise self._unavailable()
        return self.worker

    def _unavailable(self) -> Unavailable:
        if self.state == "failed":
            return Unavailable("this session has ended after repeated crashes: open the lab anew")
        return Unavailable("the simulation is being restarted: try again in a moment")

    # Viewers ------------------------------------------------------------------------------------

    def join(self) -> Viewer:
        """A page begins to watch."""
        viewer = Viewer()
        for payload in self._latest_frames.values():
            viewer.push(payload, [])
        self.viewers.add(viewer)
        self._count()
        return viewer

    def leave(self, viewer: Viewer) -> None:
        """A page no longer watches."""
        self.viewers.discard(viewer)
        self.watched = asyncio.get_running_loop().time()
        self._count()

    def notify(self, state: str, text: str) -> None:
        """Says something to every viewer."""
        notice = Notice.model_validate({"state": state, "text": text})
        self._broadcast(notice.model_dump_json().encode())

    def reply(self, viewer: Viewer, payload: bytes) -> None:
        """Says something to one viewer."""
        viewer.push(payload, list(self._latest_frames.values()))

    def _count(self) -> None:
        with contextlib.suppress(WorkerGone):
            if self.worker:
                self.worker.send("viewers", count=len(self.viewers))

    def _broadcast(self, payload: bytes) -> None:
        latest = list(self._latest_frames.values())
        for viewer in self.viewers:
            viewer.push(payload, latest)

    def _on_frame(self, kind: int, payload: bytes) -> None:
        if kind in (HELLO, STATUS):
            self._latest_frames[kind] = payload
        if kind == STATUS:
            status = orjson.loads(payload)
            for name in self._latest:
                if name in ("params", "seed") and status[name] != self._latest[name]:
                    self.touched = asyncio.get_running_loop().time()
                self._latest[name] = status[name]
        self._broadcast(payload)

    def crashed(self) -> bool:
        """Notes a crash; True when there were too many of late."""
        now = asyncio.get_running_loop().time()
        self._crashes.append(now)
        return len(self._crashes) == CRASHES and now - self._crashes[0] < CRASH_SECONDS


class Sessions:
    """All sessions: bounded in number and in idle time."""

    def __init__(self, settings: Settings, supervisor: Supervisor) -> None:
        self._settings, self._supervisor = settings, supervisor
        self._sessions: dict[str, Session] = {}
        self._tasks = Tasks()

    def __len__(self) -> int:
        return len(self._sessions)

    def start(self) -> None:
        self._tasks.spawn(self._reap())

    async def stop(self) -> None:
        self._tasks.cancel()
        for session in tuple(self._sessions.values()):
            self._close(session, "ended", "The server stops.")

    async def create(self, entry: Entry, new: NewSession) -> Session:
        """A new session. Raises SessionsFull, ParameterError."""
        Params = entry.lab.Params
        params = Params().change(Params.read(new.link) | new.params)
        if len(self) >= self._settings.max_sessions:
            raise SessionsFull(
                f"all {self._settings.max_sessions} places are taken: close another lab's page, "
                "or wait until one falls idle"
            )
        session = Session(entry, params, new)
        self._sessions[session.id] = session
        try:
            await session.open(self._supervisor)
        except WorkerGone as error:
            self._close(session, "failed", str(error))
            raise Unavailable(f"the lab could not be opened ({error}): try again") from None
        if session.id not in self._sessions:
            self._close(session, "ended", "")
            raise Unavailable("the session was closed before it opened: open the lab anew")
        self._watch(session)
        return session

    def find(self, session_id: str) -> Session:
        """Raises NoSession."""
        try:
            return self._sessions[session_id]
        except KeyError:
            raise NoSession(
                "no session has this id: it ended, or the server was restarted; open the lab anew"
            ) from None

    async def delete(self, session_id: str) -> None:
        """Ends a session. Raises NoSession."""
        self._close(self.find(session_id), "ended", "This session was closed.")

    def _watch(self, session: Session) -> None:
        worker = session.worker
        assert worker is not None
        worker.on_gone = lambda reason: self._tasks.spawn(self._recover(session, reason))
        if worker.gone:
            worker.on_gone(worker.gone)

    async def _recover(self, session: Session, reason: str) -> None:
        if session.id not in self._sessions:
            return
        session.worker = None
        if session.crashed():
            session.state = "failed"
            session.notify(
                "failed",
                f"The simulation broke {CRASHES} times within a minute (last: {reason}). "
                "Change the parameters or go back to the defaults, and open the lab anew.",
            )
            return
        session.state = "recovering"
        session.notify(
            "recovering",
            f"The simulation's process broke: {reason}. A new one starts with your parameters.",
        )
        try:
            await session.open(self._supervisor)
        except WorkerGone as error:
            await self._recover(session, str(error))
            return
        if session.id not in self._sessions:
            self._close(session, "ended", "")
            return
        session.notify("live", f"The simulation was restarted with your parameters: {reason}.")
        self._watch(session)

    def _close(self, session: Session, state: str, text: str) -> None:
        self._sessions.pop(session.id, None)
        session.notify(state, text)
        for viewer in session.viewers:
            viewer.close()
        worker, session.worker = session.worker, None
        if worker:
            worker.on_gone = lambda reason: None
            self._tasks.spawn(self._supervisor.release(worker, "its session ended"))

    async def _reap(self) -> None:
        settings = self._settings
        while True:
            await asyncio.sleep(min(1.0, settings.viewerless_seconds / 2))
            now = asyncio.get_running_loop().time()
            for session in tuple(self._sessions.values()):
                if session.state == "starting":
                    session.watched = now  # its first worker may take a minute
                elif not session.viewers and now - session.watched > settings.viewerless_seconds:
                    self._close(session, "ended", "Nobody was watching.")
                elif now - session.touched > settings.untouched_seconds:
                    minutes = settings.untouched_seconds / 60
                    self._close(
                        session,
                        "ended",
                        f"Nobody touched this lab for {minutes:.0f} minutes, so it made room for "
                        "others. Reload the page to go on with the same parameters.",
                    )
