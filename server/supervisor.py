"""Spawns workers, keeps a warm spare, hears their hearts, and kills those that fell silent."""

import asyncio
import contextlib
import logging
import signal
import socket
from collections.abc import Callable
from typing import Any

import orjson

from labs.errors import LabError
from server import fork_server
from server.background_tasks import BackgroundTasks
from server.pipe import CONTROL, HEADER, encode_frame, encode_json
from server.settings import Settings
from server.uptime_clock import UptimeClock
from server.worker_start import start_worker

log = logging.getLogger("orclab.supervisor")

REQUEST_SECONDS = 10.0
SPAWN_SECONDS = 60.0
"""Until a process that has begun is ready."""
RETRY_SECONDS = 1.0
"""Until a spare is tried again that could not be had."""

FrameHandler = Callable[[int, bytes], None]
GoneHandler = Callable[[str], None]


class WorkerGone(Exception):
    """The worker ended before it answered."""


class Worker:
    """One worker process as the web process sees it."""

    def __init__(self, process: Any, sock: socket.socket, clock: UptimeClock) -> None:
        self.process = process
        self.port = 0
        """Of its Viser server, on loopback."""
        self.on_frame: FrameHandler = lambda kind, payload: None
        self.on_gone: GoneHandler = lambda reason: None
        self.gone = ""
        """Why it ended, in words; empty while it lives."""
        self._socket = sock
        self._answers: dict[int, asyncio.Future[Any]] = {}
        self._references = 0
        self._ready = asyncio.get_running_loop().create_future()
        self._writer: asyncio.StreamWriter | None = None
        self._clock = clock
        self._heard = clock.now

    async def wait_until_ready(self) -> None:
        """Waits until the worker has said that it is ready."""
        self._reader, self._writer = await asyncio.open_connection(sock=self._socket)
        self._listening = asyncio.create_task(self._listen())
        async with self._clock.timeout(SPAWN_SECONDS):
            self.port = await self._ready

    def send(self, do: str, **arguments: Any) -> None:
        """Says what to do; expects no answer."""
        self._write({"do": do, "with": arguments})

    async def ask(self, do: str, **arguments: Any) -> Any:
        """What the worker answers. Raises LabError if it refuses, WorkerGone if it is gone or
        does not answer in time."""
        return await self._request(do, self._register_answer(), arguments)

    async def ask_for_file(self, do: str, **arguments: Any) -> None:
        """Waits until the worker has written a file. Raises as `ask` does."""
        done = self._register_answer()
        try:
            await self.ask(do, done=done, **arguments)
            await self._await_answer(done)
        finally:
            self._answers.pop(done, None)

    @property
    def seconds_silent(self) -> float:
        """[s] since the loop was last heard."""
        return self._clock.now - self._heard

    async def terminate(self, reason: str) -> None:
        """Terminates, then kills."""
        self._mark_gone(reason)
        with contextlib.suppress(ProcessLookupError):
            self.process.terminate()
            await asyncio.to_thread(self.process.join, 0.5)
            self.process.kill()
        await asyncio.to_thread(self.process.join, 5)

    async def _request(self, do: str, reference: int, arguments: dict[str, Any]) -> Any:
        self._write({"do": do, "ref": reference, "with": arguments})
        return await self._await_answer(reference)

    def _register_answer(self) -> int:
        self._references += 1
        self._answers[self._references] = asyncio.get_running_loop().create_future()
        return self._references

    async def _await_answer(self, reference: int) -> Any:
        try:
            async with self._clock.timeout(REQUEST_SECONDS):
                return await self._answers[reference]
        except TimeoutError:
            raise WorkerGone("the simulation does not answer") from None
        finally:
            self._answers.pop(reference, None)

    def _write(self, message: dict[str, Any]) -> None:
        if self.gone or not self._writer:
            raise WorkerGone(self.gone)
        self._writer.write(encode_frame(CONTROL, encode_json(message)))

    async def _listen(self) -> None:
        try:
            while True:
                size, kind = HEADER.unpack(await self._reader.readexactly(HEADER.size))
                payload = await self._reader.readexactly(size)
                self._heard = self._clock.now
                if kind == CONTROL:
                    self._on_control(orjson.loads(payload))
                else:
                    self.on_frame(kind, payload)
        except (asyncio.IncompleteReadError, OSError):
            await asyncio.to_thread(self.process.join, 1)
            self._mark_gone(_describe_exit(self.process.exitcode))

    def _on_control(self, message: dict[str, Any]) -> None:
        if message.get("ready") and not self._ready.done():
            self._ready.set_result(message["port"])
        answer = self._answers.get(message.get("ref", 0))
        if answer and not answer.done():
            if message["error"]:
                answer.set_exception(LabError(message["error"]))
            else:
                answer.set_result(message["answer"])

    def _mark_gone(self, reason: str) -> None:
        if self.gone:
            return
        self.gone = reason
        (self._writer or self._socket).close()
        for answer in self._answers.values():
            if not answer.done():
                answer.set_exception(WorkerGone(reason))
        if not self._ready.done():
            self._ready.set_exception(WorkerGone(reason))
        self.on_gone(reason)


class Supervisor:
    """All workers."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._context = fork_server.fork_context()
        self._spares: list[Worker] = []
        self._workers: set[Worker] = set()
        self._tasks = BackgroundTasks()
        self.clock = UptimeClock()
        self._filling = asyncio.Lock()
        self.preparing = True
        """Whether the first worker is still awaited, while all is loaded and compiled."""

    @property
    def count(self) -> int:
        """Workers alive, spares among them."""
        return len(self._workers)

    @property
    def spares(self) -> int:
        """Workers waiting for a session."""
        return len(self._spares)

    def start(self) -> None:
        """Begins to watch, and warms the first spare."""
        self._tasks.spawn(self._watch_workers())
        self._tasks.spawn(self._fill_spares())

    async def stop(self) -> None:
        """Ends every worker."""
        self._tasks.cancel()
        await asyncio.gather(*(w.terminate("the server stops") for w in tuple(self._workers)))

    async def take_worker(self) -> Worker:
        """A worker for a session: the warm spare, or a new one."""
        spare = next((w for w in self._spares if not w.gone), None)
        if spare:
            self._spares.remove(spare)
        worker = spare or await self._spawn()
        self._tasks.spawn(self._fill_spares())
        return worker

    async def release_worker(self, worker: Worker, reason: str) -> None:
        """Ends a worker that is no longer needed."""
        await worker.terminate(reason)
        self._workers.discard(worker)

    async def _spawn(self) -> Worker:
        try:
            process, ours = await start_worker(self._context, self.clock)
        except (EOFError, OSError, RuntimeError) as error:
            why = getattr(error, "strerror", None) or repr(error)
            raise WorkerGone(f"no process could be started: {why}") from None
        worker = Worker(process, ours, self.clock)
        self._workers.add(worker)
        try:
            await worker.wait_until_ready()
        except (WorkerGone, OSError) as error:  # of which TimeoutError is one
            why = str(error) or f"it was not ready within {SPAWN_SECONDS:g} s"
            await self.release_worker(worker, "it did not start")
            raise WorkerGone(f"a worker did not start: {why}") from None
        self.preparing = False
        return worker

    async def _fill_spares(self) -> None:
        async with self._filling:
            self._spares = [w for w in self._spares if not w.gone]
            told = False
            while len(self._spares) < self._settings.spares:
                try:
                    self._spares.append(await self._spawn())
                except WorkerGone as error:
                    if not told:
                        log.warning("no spare worker: %s", error)
                    told = True
                    await asyncio.sleep(RETRY_SECONDS)

    async def _watch_workers(self) -> None:
        while True:
            await self.clock.tick()
            for worker in tuple(self._workers):
                if worker.gone:
                    self._workers.discard(worker)
                    if worker in self._spares:
                        self._tasks.spawn(self._fill_spares())
                elif worker.port and worker.seconds_silent > self._settings.hang_seconds:
                    seconds = self._settings.hang_seconds
                    reason = f"it stopped answering for {seconds:g} s and was ended"
                    self._tasks.spawn(self.release_worker(worker, reason))


def _describe_exit(exitcode: int | None) -> str:
    if exitcode is not None and exitcode < 0:
        return f"it was ended by {signal.Signals(-exitcode).name}"
    return f"it ended unexpectedly (exit code {exitcode})"
