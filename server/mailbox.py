"""The one place where everything the user does waits for the loop."""

import threading
from collections import deque
from dataclasses import dataclass
from typing import Any


@dataclass
class WorkItem:
    """One thing to do."""

    do: str
    ref: int | None
    arguments: dict[str, Any]


class Mailbox:
    """Slider callbacks, page buttons, drags and the API put; the loop takes, once a frame.

    Neighbouring changes of parameters, and of a held handle, merge: the latest wins."""

    def __init__(self) -> None:
        self._items: deque[WorkItem] = deque()
        self._arrived = threading.Condition()

    def put(self, do: str, ref: int | None = None, **arguments: Any) -> None:
        """From any thread: what to do, with what; one with a `ref` expects an answer."""
        with self._arrived:
            last = self._items[-1] if self._items else None
            if last and last.do == do and last.ref is None and ref is None:
                if do == "params":
                    last.arguments["changes"] |= arguments["changes"]
                    return
                if do == "hold" and _is_same_drag(last.arguments, arguments):
                    last.arguments["point"] = arguments["point"]
                    return
            self._items.append(WorkItem(do, ref, arguments))
            self._arrived.notify()

    def take(self, timeout: float) -> list[WorkItem]:
        """All that waits; sleeps up to `timeout` seconds for the first to come."""
        with self._arrived:
            if not self._items and timeout > 0:
                self._arrived.wait(timeout)
            items = list(self._items)
            self._items.clear()
            return items


def _is_same_drag(before: dict[str, Any], after: dict[str, Any]) -> bool:
    """Whether a handle is dragged on. Its release stays apart: a click is both in a moment."""
    held = before["point"] is not None and after["point"] is not None
    return held and bool(before["handle"] == after["handle"])
