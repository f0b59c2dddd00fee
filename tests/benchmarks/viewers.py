"""Viewers without a browser: each reads a session's stream and scene, as a page would."""

import asyncio
import json
import multiprocessing
import time
from collections import defaultdict
from multiprocessing.connection import Connection
from typing import Any

import websockets

from tests.viser_client import PROTOCOL, camera_message

Statuses = dict[str, list[dict[str, Any]]]


class ViewerProcess:
    """A process of viewers, one a session. `with Crowd(address, infos) as crowd`."""

    def __init__(self, address: str, sessions: list[dict[str, Any]]) -> None:
        self._ours, theirs = multiprocessing.Pipe()
        context = multiprocessing.get_context("spawn")
        self._process = context.Process(target=_watch, args=(address, sessions, theirs))

    def __enter__(self) -> "ViewerProcess":
        self._process.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.join()

    def statuses(self) -> Statuses:
        """Every status heard since last asked, by session."""
        self._ours.send("statuses")
        heard: Statuses = self._ours.recv()
        return heard


def _watch(address: str, sessions: list[dict[str, Any]], ask: Connection) -> None:
    asyncio.run(_watch_all(address.replace("http", "ws"), sessions, ask))


async def _watch_all(address: str, sessions: list[dict[str, Any]], ask: Connection) -> None:
    heard: Statuses = defaultdict(list)
    for info in sessions:
        asyncio.create_task(_read_stream(address, info, heard))  # noqa: RUF006
        asyncio.create_task(_read_scene(address, info))  # noqa: RUF006
    while True:
        await asyncio.to_thread(ask.recv)
        ask.send(dict(heard))
        heard.clear()


async def _read_stream(address: str, info: dict[str, Any], heard: Statuses) -> None:
    async with websockets.connect(address + info["stream"], max_size=None) as socket:
        async for message in socket:
            if b'"type":"status"' in _bytes(message)[:40]:
                heard[info["id"]].append(json.loads(message) | {"wall": time.monotonic()})


async def _read_scene(address: str, info: dict[str, Any]) -> None:
    path = info["scene"].rstrip("/")
    async with websockets.connect(
        address + path,
        subprotocols=[PROTOCOL],  # type: ignore[list-item]
        max_size=None,
        compression=None,
    ) as socket:
        await socket.send(camera_message())
        async for _ in socket:
            pass


def _bytes(message: str | bytes) -> bytes:
    return message.encode() if isinstance(message, str) else message
