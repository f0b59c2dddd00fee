"""The pipe between the web process and a worker: frames on a socket pair.

A frame is its length (4 bytes, big endian), a kind (1 byte) and a JSON payload. All but CONTROL
frames go on to the page's viewers as they are: the web process does not look inside STREAM."""

import socket
import struct
import threading
from typing import Any

import numpy as np
import orjson

HEADER = struct.Struct(">IB")
STREAM, HELLO, STATUS, CONTROL = range(4)
"""STREAM: telemetry. HELLO, STATUS: the latest is kept. CONTROL: for the web process."""


def encode_frame(kind: int, payload: bytes) -> bytes:
    """The bytes of one frame."""
    return HEADER.pack(len(payload), kind) + payload


def encode_json(message: Any) -> bytes:
    """JSON; arrays become lists, NaN becomes null."""
    return orjson.dumps(message, default=_array_to_list, option=orjson.OPT_SERIALIZE_NUMPY)


def _array_to_list(value: object) -> object:
    """Arrays that are views with strides come here; nothing else that is no JSON may pass."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in a message")


class WorkerPipe:
    """The worker's end."""

    def __init__(self, sock: socket.socket) -> None:
        self._socket = sock
        self._lock = threading.Lock()

    def send(self, kind: int, message: Any) -> None:
        """Sends one frame, from any thread. Raises OSError once the web process is gone."""
        data = encode_frame(kind, encode_json(message))
        with self._lock:
            self._socket.sendall(data)

    def receive(self) -> dict[str, Any] | None:
        """The next message from the web process; None once it is gone."""
        header = self._read_exactly(HEADER.size)
        if header is None:
            return None
        payload = self._read_exactly(HEADER.unpack(header)[0])
        return None if payload is None else orjson.loads(payload)

    def _read_exactly(self, count: int) -> bytes | None:
        data = bytearray()
        while len(data) < count:
            try:
                part = self._socket.recv(count - len(data))
            except OSError:
                return None
            if not part:
                return None
            data += part
        return bytes(data)
