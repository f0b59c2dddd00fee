"""A bare client of Viser's protocol: what a browser's scene says and hears, without a browser."""

import contextlib
import struct
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Self

import msgspec
import zstandard
from websockets.sync.client import connect

from tests.server_process import TIMEOUT, SessionClient

PROTOCOL = "viser-v1.1.1"


def decode(window: bytes) -> list[dict[str, Any]]:
    """The messages of one window (arrays are left where they are)."""
    _, size = struct.unpack_from("<QQ", window)
    inner = zstandard.ZstdDecompressor().decompress(window[16 : 16 + size])
    messages: list[dict[str, Any]] = msgspec.msgpack.decode(inner)["messages"]
    return messages


def camera_message(position: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> bytes:
    """Where a client looks from; the first makes it count as connected."""
    return message(
        "ViewerCameraMessage",
        wxyz=(1, 0, 0, 0),
        position=position,
        fov=1.0,
        near=0.01,
        far=100.0,
        image_height=600,
        image_width=800,
        look_at=(0, 0, 0),
        up_direction=(0, 0, 1),
    )


def message(kind: str, **fields: Any) -> bytes:
    return msgspec.msgpack.encode({"type": kind, **fields})


class SceneClient:
    """`with SceneClient(session) as scene: scene.set("ω", 0.5)`: controls go by their labels, up to
    the value that a slider's says."""

    def __init__(self, session: SessionClient) -> None:
        address = session.server.address.replace("http", "ws") + session.info["scene"].rstrip("/")
        self.socket = connect(
            address,
            subprotocols=[PROTOCOL],  # type: ignore[list-item]
            max_size=None,
            compression=None,
            origin=session.server.address,  # type: ignore[arg-type]
        )
        self.controls: dict[str, str] = {}  # uuid by label
        self.labels: dict[str, str] = {}  # what they say, by uuid
        self.values: dict[str, Any] = {}  # what is shown, by uuid
        self.nodes: set[str] = set()
        self._unread: deque[dict[str, Any]] = deque()
        self.socket.send(camera_message())
        self.read_until(lambda m: m["type"] == "ReplayDoneMessage")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def messages(self, timeout: float = TIMEOUT) -> Iterator[dict[str, Any]]:
        """All messages as they come, noted. Fails after `timeout` seconds of silence."""
        while True:
            while self._unread:
                found = self._unread.popleft()
                self._note(found)
                yield found
            window = self.socket.recv(timeout)
            assert isinstance(window, bytes)
            self._unread.extend(decode(window))

    def read_until(self, true: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        end = time.monotonic() + TIMEOUT
        for found in self.messages():
            if true(found):
                return found
            assert time.monotonic() < end, "no such scene message came"
        raise AssertionError

    def read_for(self, seconds: float) -> None:
        """Reads on for a while, so that what comes next is new."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            with contextlib.suppress(TimeoutError):
                window = self.socket.recv(left)
                assert isinstance(window, bytes)
                self._unread.extend(decode(window))
        for found in self._unread:
            self._note(found)
        self._unread.clear()

    def set(self, label: str, value: Any) -> None:
        """Moves a control as a hand would: a slider to a position in [0, 1]."""
        update = {"value": value}
        self.socket.send(message("GuiUpdateMessage", uuid=self.control(label), updates=update))

    def control(self, label: str) -> str:
        """The uuid of a control; waits for a panel that is still being built."""
        if label not in self.controls:
            self.read_until(lambda _: label in self.controls)
        return self.controls[label]

    def wait_for_node(self, name: str) -> None:
        """Waits until the scene has a node of this name; a drag of none is dropped."""
        if name not in self.nodes:
            self.read_until(lambda _: name in self.nodes)

    def wait_for_value(self, label: str, value: Any) -> None:
        """Waits until a control shows a value. Fails after `TIMEOUT`."""
        uuid = self.control(label)
        if self.values[uuid] != value:
            self.read_until(lambda _: self.values[uuid] == value)

    def wait_for_label(self, label: str, text: str) -> None:
        """Waits until a control's whole label is `text`. Fails after `TIMEOUT`."""
        uuid = self.control(label)
        if self.labels[uuid] != text:
            self.read_until(lambda _: self.labels[uuid] == text)

    def _note(self, found: dict[str, Any]) -> None:
        match found:
            case {"uuid": uuid, "props": {"label": str(label)}}:
                self.controls[label.split(" = ")[0]] = uuid
                self.labels[uuid] = label
                self.values[uuid] = found.get("value")
            case {"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates}:
                self.values[uuid] = updates.get("value", self.values.get(uuid))
                self.labels[uuid] = updates.get("label", self.labels.get(uuid, ""))
            case {"name": str(name), "props": _}:
                self.nodes.add(name)
