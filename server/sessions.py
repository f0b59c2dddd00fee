"""All live sessions: bounded in number and in idle time, and brought back when a worker dies."""

import asyncio
import contextlib

from labs.engine.catalog import CatalogEntry
from labs.engine.links import read_link
from labs.errors import LabError
from labs.params import Params
from server.background_tasks import BackgroundTasks
from server.messages import NewSession
from server.session import CRASHES, Session, SessionUnavailable
from server.settings import Settings
from server.supervisor import Supervisor, WorkerGone

STOP_NOTICE_SECONDS = 0.5
"""[s] Viewers are given to hear that the server stops."""
STOPPING_MESSAGE = "the server stops: start it again, and open the lab anew"
STOPPED_MESSAGE = "The server was stopped. Once it is started again, this page goes on by itself."


class SessionsFull(LabError):
    """The limit of live sessions is reached."""


class UnknownSession(LabError):
    """No session has this id (any more)."""


class Sessions:
    """All sessions: bounded in number and in idle time."""

    def __init__(self, settings: Settings, supervisor: Supervisor) -> None:
        self._settings, self._supervisor = settings, supervisor
        self._sessions: dict[str, Session] = {}
        self._tasks = BackgroundTasks()
        self._stopping = False

    def __len__(self) -> int:
        return len(self._sessions)

    def start(self) -> None:
        self._tasks.spawn(self._close_idle())

    async def stop(self) -> None:
        """Ends all sessions, and waits until their viewers have heard it, but not for long."""
        self._stopping = True
        self._tasks.cancel()
        sessions = tuple(self._sessions.values())
        for session in sessions:
            self._close(session, "recovering", STOPPED_MESSAGE)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(STOP_NOTICE_SECONDS):
                while any(session.viewers for session in sessions):
                    await asyncio.sleep(0.01)

    async def create(self, entry: CatalogEntry, new: NewSession) -> Session:
        """A new session. Raises SessionsFull, ParameterError."""
        # Texts are read by the lab's own code: not on the event loop.
        params, seed, remarks = await asyncio.to_thread(_read_params, entry.lab.Params(), new)
        if self._stopping:
            raise SessionUnavailable(STOPPING_MESSAGE)
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
                raise SessionUnavailable(
                    f"the lab could not be opened ({error}): try again"
                ) from None
            raise
        if session.id not in self._sessions:
            self._close(session, "ended", "")
            raise SessionUnavailable("the session was closed before it opened: open the lab anew")
        self._recover_when_gone(session)
        return session

    def find(self, session_id: str) -> Session:
        """Raises NoSession."""
        try:
            return self._sessions[session_id]
        except KeyError:
            if self._stopping:
                raise SessionUnavailable(STOPPING_MESSAGE) from None
            raise UnknownSession(
                "no session has this id: it ended, or the server was restarted; open the lab anew"
            ) from None

    async def delete(self, session_id: str) -> None:
        """Ends a session. Raises NoSession."""
        self._close(self.find(session_id), "ended", "This session was closed.")

    def _recover_when_gone(self, session: Session) -> None:
        worker = session.worker
        assert worker is not None
        worker.on_gone = lambda reason: self._tasks.spawn(self._recover(session, reason))
        if worker.gone:
            worker.on_gone(worker.gone)

    async def _recover(self, session: Session, reason: str) -> None:
        if session.id not in self._sessions:
            return
        session.worker = None
        if session.record_crash():
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
        self._recover_when_gone(session)

    def _close(self, session: Session, state: str, text: str) -> None:
        self._sessions.pop(session.id, None)
        session.notify(state, text)
        for viewer in session.viewers:
            viewer.close()
        worker, session.worker = session.worker, None
        if worker:
            worker.on_gone = lambda reason: None
            self._tasks.spawn(self._supervisor.release_worker(worker, "its session ended"))

    async def _close_idle(self) -> None:
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


def _read_params(defaults: Params, new: NewSession) -> tuple[Params, int, list[str]]:
    """Parameters, seed, and remarks on the link. Raises ParameterError."""
    params, seed, remarks = read_link(defaults, new.link)
    return params.change(new.params), new.seed if seed is None else seed, remarks
