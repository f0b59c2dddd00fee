"""What is done to a run, and when: as data, in exported recordings, and on a command line.

On a command line an event is `--at T WHAT`, with T in seconds:

    kp=500                  sets a parameter
    press=push              presses an action
    hold=pull:0.1,0.2,0.3   holds a handle at a point [m]
    hold=pull:release       lets go of it
    iterate=20              takes in iterations of the solver
    show=3                  looks back at one
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from labs.engine.catalog import CatalogEntry
from labs.errors import LabError, ParameterError
from labs.params import Value

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Event:
    """Something done to the world before step `step`: parameters changed, an action pressed, a
    handle held at a point or released (None), solver iterations taken in ("iterate", how many) or
    looked back at ("show", which)."""

    step: int
    kind: Literal["set", "press", "hold", "solve"]
    name: str
    value: Any = None


def events_from_recording(about: Mapping[str, Any]) -> list[Event]:
    """The events of an exported recording, to run it again. Raises LabError."""
    if not about["changes_complete"]:
        raise LabError("this recording lost its early changes: it cannot be run again exactly")
    return [_event_from_change(change) for change in about["changes"]]


def _event_from_change(change: Mapping[str, Any]) -> Event:
    step, kind, name, value = (change[key] for key in ("step", "kind", "name", "value"))
    match kind:
        case "set":
            sound = isinstance(value, float | int | str)
        case "press":
            sound = value is None
        case "hold":
            point = value if isinstance(value, list | tuple) else ()
            numbers = len(point) == 3 and all(type(x) in (int, float) for x in point)
            sound = value is None or numbers
        case "solve":
            sound = name in ("iterate", "show") and type(value) is int and value >= 0
        case _:
            sound = False
    if not (sound and type(step) is int and 0 <= step <= 2**53 and isinstance(name, str)):
        raise LabError(f"no change of a run looks like {str(dict(change))[:200]}")
    return Event(step, kind, name, value)


def parse_event(entry: CatalogEntry, at: str, what: str) -> Event:
    """An event from a command line. Raises ParameterError."""
    try:
        step = round(float(at) / entry.lab.period)
    except (ValueError, OverflowError):
        raise ParameterError(f"--at {at}: takes a time in seconds") from None
    name, equals, value = what.partition("=")
    if not equals or step < 0:
        raise ParameterError(f"--at {at} {what}: takes a time from 0 and name=value")
    match name:
        case "press":
            return Event(step, "press", value)
        case "hold":
            handle, _, where = value.partition(":")
            return Event(step, "hold", handle, _point(where))
        case "iterate" | "show" if value.isdecimal():
            return Event(step, "solve", name, int(value))
        case _:
            return Event(step, "set", name, entry.lab.Params.read({name: value})[name])


def format_event(event: Event, period: float) -> list[str]:
    """The words of a command line that `parse_event` reads back."""
    match event.kind:
        case "press":
            what = f"press={event.name}"
        case "hold":
            where = "release" if event.value is None else ",".join(map(repr, event.value))
            what = f"hold={event.name}:{where}"
        case _:
            what = f"{event.name}={format_value(event.value)}"
    return ["--at", f"{event.step * period:.10g}", what]


def format_value(value: Value) -> str:
    """As `Params.read` reads it back."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _point(text: str) -> Point | None:
    if text == "release":
        return None
    try:
        x, y, z = map(float, text.split(","))
    except ValueError:
        raise ParameterError(f"{text}: a handle is held at x,y,z or released") from None
    return (x, y, z)
