"""Processes that do not begin, and answers that do not come: how long they are waited for."""

import asyncio
import contextlib
import socket
import threading
import time
from collections.abc import AsyncIterator
from typing import Any

import pytest

from labs.engine.catalog import find_lab
from server import supervisor, uptime_clock, worker_start
from server.messages import NewSession
from server.pipe import CONTROL, HEADER, encode_frame, encode_json
from server.session import SessionUnavailable
from server.sessions import Sessions
from server.settings import Settings
from server.supervisor import Supervisor, Worker, WorkerGone
from server.uptime_clock import UptimeClock
from tests.server_process import run_in_thread

LIMIT = 0.2


@pytest.fixture(autouse=True)
def short_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock that ticks fast, and limits that are short."""
    monkeypatch.setattr(uptime_clock, "TICK", 0.01)
    monkeypatch.setattr(uptime_clock, "MAX_TICK", 0.05)
    monkeypatch.setattr(supervisor, "REQUEST_SECONDS", LIMIT)
    monkeypatch.setattr(worker_start, "START_SECONDS", LIMIT)


@contextlib.asynccontextmanager
async def ticking_clock(clock: UptimeClock) -> AsyncIterator[None]:
    async def tick() -> None:
        while True:
            await clock.tick()

    task = asyncio.create_task(tick())
    try:
        yield
    finally:
        task.cancel()


class Process:
    """A worker that lives, and one that does not begin before it is let go."""

    exitcode = 0

    def __init__(self, let_go: threading.Event | None = None, **how: Any) -> None:
        self.let_go = let_go
        self.pipe: Any = how["args"][0] if how else None
        self.begun = threading.Event()

    def start(self) -> None:
        assert self.let_go
        self.let_go.wait()
        assert self.pipe.fileno() >= 0, "its end of the pipe is still there"
        self.begun.set()

    def join(self, _: float) -> None:
        pass

    terminate = kill = start


def test_a_nap_uses_up_no_time_of_a_request() -> None:
    """The machine sleeps, here the loop, for longer than an answer may take, and then it comes."""

    async def work() -> Any:
        ours, theirs = socket.socketpair()
        reader, writer = await asyncio.open_connection(sock=theirs)
        clock = UptimeClock()
        worker = Worker(Process(), ours, clock)
        writer.write(encode_frame(CONTROL, encode_json({"ready": True, "port": 1})))
        async with ticking_clock(clock):
            await worker.wait_until_ready()
            asking = asyncio.create_task(worker.ask("params"))
            size, _ = HEADER.unpack(await reader.readexactly(HEADER.size))
            await reader.readexactly(size)
            time.sleep(2 * LIMIT)
            await clock.tick()
            await asyncio.sleep(0)
            writer.write(encode_frame(CONTROL, encode_json({"ref": 1, "answer": 7, "error": ""})))
            assert await asking == 7
            with pytest.raises(WorkerGone, match="does not answer"):
                await worker.ask("params")
        writer.close()
        ours.close()

    run_in_thread(work())


def test_a_start_that_does_not_end_frees_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fork server is stuck. Once it goes on, the process it starts finds its pipe closed."""
    let_go, processes = threading.Event(), list[Process]()

    async def work() -> None:
        stuck = Supervisor(Settings(spares=0))

        def process(**how: Any) -> Process:
            processes.append(Process(let_go, **how))
            return processes[-1]

        monkeypatch.setattr(stuck._context, "Process", process, raising=False)
        sessions = Sessions(Settings(max_sessions=1), stuck)
        async with ticking_clock(stuck.clock):
            with pytest.raises(SessionUnavailable, match=r"none began within 0\.2 s.*try again"):
                await sessions.create(find_lab("oscillator"), NewSession(lab="oscillator"))
        assert len(sessions) == 0
        (late,) = processes
        other_end = late.pipe.dup()
        let_go.set()
        await asyncio.to_thread(late.begun.wait, 20)
        assert late.begun.is_set()
        assert other_end.recv(1) == b"", "nobody is at the other end"
        other_end.close()

    run_in_thread(work())
