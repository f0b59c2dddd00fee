"""All live sessions: bounded in number and in idle time, and brought back when a worker dies."""

import asyncio
import contextlib

from labs.engine.catalog import CatalogEntry
from labs.engine.links import read_link
from labs.errors import LabError
from labs.params import Params
from server.messages import NewSession
from server.session import CRASHES, Session, Unavailable
from server.settings import Settings
from server.supervisor import Supervisor, WorkerGone
from server.tasks import Tasks

LAST_WORDS = 0.5
"""[s] Viewers are given to hear that the server stops."""
STOPS = "the server stops: start it again, and open the lab anew"
STOPPED = "The server was stopped. Once it is started again, this page goes on by itself."


class SessionsFull(LabError):
    """The limit of live sessions is reached."""


class NoSession(LabError):
    """No session has this id (any more)."""


class Sessions:
    """All sessions: bounded in number and in idle time."""

    def __init__(self, settings: Settings, supervisor: Supervisor) -> None:
        self._settings, self._supervisor = settings, supervisor
        self._sessions: dict[str, Session] = {}
        self._tasks = Tasks()
        self._stopping = False

    def __len__(self) -> int:
        return len(self._sessions)

    def start(self) -> None:
        self._tasks.spawn(self._reap())

    async def stop(self) -> None:
        """Ends all sessions, and waits until their viewers have heard it, but not for long."""
        self._stopping = True
        self._tasks.cancel()
        sessions = tuple(self._sessions.values())
        for session in sessions:
            self._close(session, "recovering", STOPPED)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(LAST_WORDS):
                while any(session.viewers for session in sessions):
                    await asyncio.sleep(0.01)

    async def create(self, entry: CatalogEntry, new: NewSession) -> Session:
        """A new session. Raises SessionsFull, ParameterError."""
        # Texts are read by the lab's own code: not on the event loop.
        params, seed, remarks = await asyncio.to_thread(_read, entry.lab.Params(), new)
        if self._stopping:
            raise Unavailable(STOPS)
        if len(self) >= self._settings.max_sessions:
            raise SessionsFull(
                f"all {self._settings.max_sessions} places are taken: close another lab's page, "
                "or wait until one falls idle"
            )
        session = Session(entry, params, seed, new.view, remarks, self._supervisor.clock)
        self._sessions[session.id] = session
        try:
            await session.open(self._supervisor)
        except BaseException as error:
            # Whatever it was: a session that never lived takes no place.
            self._close(session, "failed", str(error))
            if isinstance(error, WorkerGone):
                raise Unavailable(f"the lab could not be opened ({error}): try again") from None
            raise
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
            if self._stopping:
                raise Unavailable(STOPS) from None
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
            now = self._supervisor.clock.now
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


def _read(defaults: Params, new: NewSession) -> tuple[Params, int, list[str]]:
    """Parameters, seed, and remarks on the link. Raises ParameterError."""
    params, seed, remarks = read_link(defaults, new.link)
    return params.change(new.params), new.seed if seed is None else seed, remarks
