"""A live session: who watches, what its parameters are, and which worker runs it."""

import contextlib
import secrets
from collections import deque
from collections.abc import Sequence
from typing import Any

import orjson

from labs.engine.catalog import CatalogEntry
from labs.errors import LabError
from labs.params import Params
from server.messages import Notice, SessionInfo, View
from server.pipe import HELLO, STATUS
from server.supervisor import Supervisor, Worker, WorkerGone
from server.uptime_clock import UptimeClock
from server.viewers import Viewer

CRASHES, CRASH_SECONDS = 3, 60.0


class SessionUnavailable(LabError):
    """The session's worker is being replaced."""


class Session:
    """One user's lab."""

    def __init__(
        self,
        entry: CatalogEntry,
        params: Params,
        seed: int,
        view: View,
        remarks: Sequence[str],
        clock: UptimeClock,
    ) -> None:
        """`remarks` are on the link it was opened by."""
        self._clock = clock
        self._remarks = list(remarks)
        self.id = secrets.token_urlsafe(18)
        self.entry = entry
        self.state = "starting"
        self.worker: Worker | None = None
        self.viewers: set[Viewer] = set()
        # What a new worker needs to go on where the last one ended.
        self._latest: dict[str, Any] = {
            "params": params.model_dump(),
            "seed": seed,
            "view": view.model_dump(),
            "running": True,
            "speed": 1.0,
            "solver": None,
        }
        self._latest_frames: dict[int, bytes] = {}
        self._crashes: deque[float] = deque(maxlen=CRASHES)
        self.watched = self.touched = clock.now
        """When somebody last watched, and last did something [s]."""

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
                "remarks": self._remarks,
            }
        )

    async def open(self, supervisor: Supervisor) -> None:
        """Takes a worker and sets it to work where the last one ended."""
        worker = await supervisor.take_worker()
        worker.on_frame = self._on_frame
        self.worker = worker
        self.state = "live"
        worker.send("open", lab=self.entry.slug, **self._latest)
        worker.send("viewers", count=len(self.viewers))

    async def change(self, changes: dict[str, Any]) -> dict[str, Any]:
        """New parameters; answers all of them. Raises ParameterError, Unavailable."""
        params: dict[str, Any] = await self.ask("params", changes=changes)
        self._latest["params"] = params
        return params

    async def ask(self, do: str, **arguments: Any) -> Any:
        """What the worker answers. Raises LabError, Unavailable."""
        self.touched = self._clock.now
        try:
            return await self._live_worker().ask(do, **arguments)
        except WorkerGone:
            raise self._unavailable_error() from None

    async def load(self, path: str) -> dict[str, Any]:
        """Takes up a solution from a file; answers all parameters. Raises LabError, Unavailable."""
        params: dict[str, Any] = await self.ask("load", path=path)
        self._latest["params"] = params
        return params

    async def write_file(self, what: str, form: str, path: str, **more: Any) -> None:
        """Writes the recording ("export"), the solution or plots to a file. Raises as `ask`."""
        try:
            await self._live_worker().ask_for_file(what, form=form, path=path, **more)
        except WorkerGone:
            raise self._unavailable_error() from None

    def _live_worker(self) -> Worker:
        if self.worker is None or self.worker.gone:
            raise self._unavailable_error()
        return self.worker

    def _unavailable_error(self) -> SessionUnavailable:
        if self.state == "failed":
            return SessionUnavailable(
                "this session has ended after repeated crashes: open the lab anew"
            )
        if self.worker and not self.worker.gone:
            return SessionUnavailable(
                "the simulation is busy and does not answer: try again in a moment"
            )
        return SessionUnavailable("the simulation is being restarted: try again in a moment")

    # Viewers ------------------------------------------------------------------------------------

    def add_viewer(self) -> Viewer:
        """A page begins to watch."""
        viewer = Viewer()
        for payload in self._latest_frames.values():
            viewer.push(payload, [])
        self.viewers.add(viewer)
        self._send_viewer_count()
        return viewer

    def remove_viewer(self, viewer: Viewer) -> None:
        """A page no longer watches."""
        self.viewers.discard(viewer)
        self.watched = self._clock.now
        self._send_viewer_count()

    def notify(self, state: str, text: str) -> None:
        """Says something to every viewer."""
        notice = Notice.model_validate({"state": state, "text": text})
        self._broadcast(notice.model_dump_json().encode())

    def reply(self, viewer: Viewer, payload: bytes) -> None:
        """Says something to one viewer."""
        viewer.push(payload, list(self._latest_frames.values()))

    def _send_viewer_count(self) -> None:
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
                    self.touched = self._clock.now
                self._latest[name] = status[name]
        self._broadcast(payload)

    def record_crash(self) -> bool:
        """Notes a crash; True when there were too many of late."""
        now = self._clock.now
        self._crashes.append(now)
        return len(self._crashes) == CRASHES and now - self._crashes[0] < CRASH_SECONDS
