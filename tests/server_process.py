"""A real orclab server for tests and measurements: started, spoken to, ended, or killed."""

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import IO, Any, Self, TypeVar

import httpx
import psutil
from websockets.sync.client import connect
from websockets.sync.connection import Connection

T = TypeVar("T")
TIMEOUT = 90.0
"""[s] What takes longer does not come any more, however busy the machine is."""


class ServerProcess:
    """`with ServerProcess(ORCLAB_SPARES="0") as server: server.http.get("/")`."""

    def __init__(
        self, port: int = 0, wait: bool = True, stderr: IO[str] | None = None, **environment: str
    ) -> None:
        """`wait`: until a spare is warm. `stderr`: where its complaints go."""
        self._environment = os.environ | {"ORCLAB_LABS": "tests.sample_labs"} | environment
        self._port, self.stderr, self.starts = port, stderr, 0
        self.start(wait)

    def start(self, wait: bool = True) -> None:
        """Starts, and waits until it answers and a spare is warm."""
        self.starts += 1
        self.process = subprocess.Popen(
            [sys.executable, "-m", "server", "--port", str(self._port)],
            env=self._environment,
            stdout=subprocess.PIPE,
            stderr=self.stderr,
            text=True,
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert "http://" in line, "the server did not start"
        self.address = next(word for word in line.split() if "http" in word)
        self._port = int(self.address.rsplit(":", 1)[1])
        self.http = httpx.Client(base_url=self.address, timeout=60)
        spares = int(self._environment.get("ORCLAB_SPARES", "1"))
        # A fresh checkout compiles the solvers first.
        wait_until(lambda: not wait or self.health()["spares"] >= spares, seconds=240)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self, how: signal.Signals = signal.SIGINT) -> None:
        """Ends the server with a signal and waits."""
        self.http.close()
        if self.running:
            self.process.send_signal(how)
            self.process.wait(20)

    @property
    def running(self) -> bool:
        return self.process.poll() is None

    def health(self) -> dict[str, Any]:
        """What /healthz says."""
        answer: dict[str, Any] = self.http.get("/healthz").json()
        return answer

    def workers(self) -> list[psutil.Process]:
        """All processes below the server's, and theirs."""
        below: list[psutil.Process] = psutil.Process(self.process.pid).children(recursive=True)
        return below

    def listeners(self) -> dict[int, tuple[str, int]]:
        """Where each worker's Viser server listens, by process id."""
        found = {}
        for process in self.workers():
            with contextlib.suppress(psutil.NoSuchProcess):  # one may just be ending
                for connection in process.net_connections():
                    if connection.status == "LISTEN":
                        found[process.pid] = (connection.laddr.ip, connection.laddr.port)
        return found

    @contextlib.contextmanager
    def session(self, lab: str, **more: Any) -> Iterator["SessionClient"]:
        """A session that is closed at the end."""
        opened = SessionClient.new(self, lab, more)
        try:
            yield opened
        finally:
            self.http.delete(opened.path)


class SessionClient:
    """A session seen through the API and its stream."""

    def __init__(self, server: ServerProcess, info: dict[str, Any]) -> None:
        """`info`: of a session that was opened elsewhere, by a page."""
        self.server, self.info = server, info
        self.path = f"/api/sessions/{info['id']}"

    @classmethod
    def new(cls, server: ServerProcess, lab: str, more: dict[str, Any]) -> Self:
        answer = server.http.post("/api/sessions", json={"lab": lab, **more})
        assert answer.status_code == 201, answer.text
        return cls(server, answer.json())

    def set(self, **params: Any) -> httpx.Response:
        return self.server.http.patch(f"{self.path}/params", json=params)

    def command(self, command: str, **more: Any) -> httpx.Response:
        body = {"command": command, **more}
        return self.server.http.post(f"{self.path}/commands", json=body)

    def export(self) -> dict[str, Any]:
        answer: dict[str, Any] = self.server.http.get(f"{self.path}/export.json").json()
        return answer

    @contextlib.contextmanager
    def stream(self, **options: Any) -> Iterator["StreamClient"]:
        address = self.server.address.replace("http", "ws") + self.info["stream"]
        with connect(address, **options) as socket:
            yield StreamClient(socket)


class StreamClient:
    """A session's stream, read message by message."""

    def __init__(self, socket: Connection) -> None:
        self.socket = socket

    def next(self, type: str, when: Callable[[dict[str, Any]], bool] = lambda m: True) -> Any:
        """The next message of a type that fulfils a condition. Fails after `TIMEOUT`."""
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:
            message = json.loads(self.socket.recv(timeout=end - time.monotonic()))
            if message["type"] == type and when(message):
                return message
        raise AssertionError(f"no such {type} came")


def wait_until(true: Callable[[], bool], seconds: float = TIMEOUT) -> None:
    """Waits until something is true. Fails after `seconds`."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come true in time"
        time.sleep(0.02)


def run_in_thread(work: Coroutine[Any, Any, T]) -> T:
    """As `asyncio.run`, on a thread of its own: Playwright has a loop on this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, work).result()
