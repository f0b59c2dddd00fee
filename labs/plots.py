"""What a lab may plot. A plot names channels: keys of what the lab's `measure` (recorded over
time) or `fields` (asked for a few times a second) returns. Symbols are TeX, units SI.

In a unit, an axis or the label of a curve, `{name}` stands for what `Lab.labels` says under the
present parameters. A plot with `when`, such as `when={"world": ("pendulum",)}`, is there only
while each of these parameters has one of its values."""

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from types import MappingProxyType
from typing import Any, Literal

from labs.params import Value

ShownWhen = Mapping[str, tuple[Value, ...]]
ALWAYS: ShownWhen = MappingProxyType({})
Guide = Literal["none", "imaginary-axis", "left-half-plane", "unit-circle"]


@dataclass(frozen=True)
class Line:
    """One curve. A vector channel makes one curve a component, chosen by the page's selector."""

    channel: str
    symbol: str
    style: Literal["solid", "dash", "limit"] = "solid"


@dataclass(frozen=True, init=False)
class TimeSeries:
    """Measured channels over time: `TimeSeries("Error", "rad", Line("error", "e"))`. `select` names
    what a vector's components are ("joint"); what `Lab.labels` says under it are their names. A
    unit in braces may be one for each of them. `stacked` lays the solid lines of one component on
    top of one another as areas, what is negative below zero; while all are chosen, those of
    component `lead`."""

    title: str
    unit: str
    lines: tuple[Line, ...]
    select: str
    stacked: bool
    lead: int
    when: ShownWhen

    def __init__(
        self,
        title: str,
        unit: str,
        *lines: Line,
        select: str = "",
        stacked: bool = False,
        lead: int = 0,
        when: ShownWhen = ALWAYS,
    ) -> None:
        _set_fields(
            self, title=title, unit=unit, lines=lines, select=select, stacked=stacked, lead=lead
        )
        _set_fields(self, when=when)


@dataclass(frozen=True)
class Trace:
    """One line or set of points among `Curves`: y over x, 1-D fields of one length, which may
    change and be 0. With y of shape (n, k) it is k curves, each of a colour of its own, over the
    same x or each over its column of an x of that shape. "marked" is a line with its points.
    Without a label it stays out of the legend; `note` names a field of one number for each curve
    (NaN or none where there is none), that stands behind the label. `series` is its colour, or
    that of the first curve, 1 to 8, or 0 for ink. Of an `optional` one `Lab.fields` leaves x and y
    out where there never is anything to show: it is not in the legend then."""

    x: str
    y: str
    label: str | tuple[str, ...] = ""
    """Of k curves a name each, or one name in which {} stands for the number of the curve, or
    {name} for a word of each."""
    style: Literal["line", "marked", "points", "dash"] = "line"
    series: int = 0
    note: str = ""
    optional: bool = False


@dataclass(frozen=True, init=False)
class Curves:
    """Traces in one chart: a trajectory in a plane, eigenvalues as points, errors over steps. On a
    logarithmic axis what is not positive is left out. `equal` gives both axes one scale; the guide
    is the line or the circle that parts the stable from the unstable. With `gaps` y may be NaN
    where there is no value: the point is left out."""

    title: str
    x_label: str
    y_label: str
    traces: tuple[Trace, ...]
    log_x: bool
    log_y: bool
    guide: Guide
    equal: bool
    gaps: bool
    when: ShownWhen

    def __init__(
        self,
        title: str,
        x_label: str,
        y_label: str,
        *traces: Trace,
        log_x: bool = False,
        log_y: bool = False,
        guide: Guide = "none",
        equal: bool = False,
        gaps: bool = False,
        when: ShownWhen = ALWAYS,
    ) -> None:
        labels = {"title": title, "x_label": x_label, "y_label": y_label}
        _set_fields(
            self, **labels, traces=traces, log_x=log_x, log_y=log_y, guide=guide, equal=equal
        )
        _set_fields(self, gaps=gaps, when=when)


@dataclass(frozen=True)
class HeatMap:
    """A 2-D field z over 1-D fields x (columns) and y (rows). With `gaps` z may be NaN where
    there is no value: the cell stays empty. `arrows` names a field (k, 4) of arrows over it, such
    as a policy: x and y of the middle on the axes, then the way right and up on the screen, at
    most 1 long; (0, 0) is a dot. With `downward` y grows downward, as the rows of a matrix do."""

    title: str
    x: str
    y: str
    z: str
    x_label: str
    y_label: str
    z_label: str
    gaps: bool = False
    arrows: str = ""
    downward: bool = False
    when: ShownWhen = field(default_factory=dict, kw_only=True)


@dataclass(frozen=True)
class Matrix:
    """A small 2-D field written out in digits. `shade` also colours each cell by its value
    relative to the largest magnitude: a heat map one can read. What `Lab.labels` says under
    `rows` are the names of its rows."""

    title: str
    field: str
    symbol: str
    unit: str = ""
    shade: bool = False
    rows: str = ""
    when: ShownWhen = dataclasses.field(default_factory=dict, kw_only=True)


@dataclass(frozen=True)
class Bars:
    """A 1-D field as bars, with the limit (a 1-D field) each must stay within, and with marks (a
    1-D field, which may be empty) across the bars where each ought to end. With `gaps` bars and
    marks may be NaN where there is no value: they are left out. What `Lab.labels` says under
    `names` are the names of the bars, else they have numbers."""

    title: str
    field: str
    symbol: str
    unit: str
    limit: str = ""
    marks: str = ""
    gaps: bool = False
    names: str = ""
    when: ShownWhen = dataclasses.field(default_factory=dict, kw_only=True)


@dataclass(frozen=True)
class Readout:
    """A scalar channel as a number. Where it is not defined (yet), `measure` leaves it out.
    `whole` is for counts: no decimals."""

    channel: str
    label: str
    unit: str
    whole: bool = False
    when: ShownWhen = field(default_factory=dict, kw_only=True)


@dataclass(frozen=True)
class Note:
    """What `Lab.notes` says under this name: plain sentences, a paragraph a line."""

    title: str
    note: str
    when: ShownWhen = field(default_factory=dict, kw_only=True)


Card = TimeSeries | Curves | HeatMap | Matrix | Bars | Note
"""What has a title and a place of its own."""
Plot = Card | Readout


def channel_names(plot: Plot) -> tuple[str, ...]:
    """The channels of `Lab.measure` a plot shows."""
    if isinstance(plot, TimeSeries):
        return tuple(line.channel for line in plot.lines)
    return (plot.channel,) if isinstance(plot, Readout) else ()


def field_names(plot: Plot) -> tuple[str, ...]:
    """The channels of `Lab.fields` and `Lab.notes` a plot shows."""
    match plot:
        case Curves(traces=traces):
            named = (name for trace in traces for name in (trace.x, trace.y, trace.note))
            return tuple(name for name in named if name)
        case HeatMap(x=x, y=y, z=z, arrows=arrows):
            return (x, y, z, arrows) if arrows else (x, y, z)
        case Matrix(field=field):
            return (field,)
        case Bars(field=field, limit=limit, marks=marks):
            return tuple(name for name in (field, limit, marks) if name)
        case Note(note=note):
            return (note,)
        case _:
            return ()


def is_shown(plot: Plot, params: Mapping[str, Value]) -> bool:
    """Whether a plot is there under these parameters."""
    when: ShownWhen = getattr(plot, "when", ALWAYS)
    return all(params[name] in values for name, values in when.items())


def label_names(plot: Plot) -> tuple[str, ...]:
    """The names of `Lab.labels` a plot may show."""
    match plot:
        case TimeSeries(unit=unit, select=select):
            return _placeholders(unit) + ((select,) if select else ())
        case Curves(x_label=x_label, y_label=y_label, traces=traces):
            labels = [trace.label for trace in traces if isinstance(trace.label, str)]
            return _placeholders(x_label, y_label, *labels)
        case HeatMap(x_label=x_label, y_label=y_label, z_label=z_label):
            return _placeholders(x_label, y_label, z_label)
        case Readout(label=label, unit=unit):
            return _placeholders(label, unit)
        case Matrix(rows=names) | Bars(names=names):
            return (names,) if names else ()
        case _:
            return ()


def fields_with_gaps(plot: Plot) -> tuple[str, ...]:
    """The fields a plot shows in which NaN stands for what has no value."""
    match plot:
        case Curves(traces=traces, gaps=gaps):
            notes = tuple(trace.note for trace in traces if trace.note)
            return notes + (tuple(trace.y for trace in traces) if gaps else ())
        case HeatMap(z=z, gaps=True):
            return (z,)
        case Bars(field=field, marks=marks, gaps=True):
            return (field, marks)
        case _:
            return ()


def describe(plot: Plot) -> dict[str, Any]:
    """A plot as plain JSON data; `kind` tells which."""
    data = {"kind": type(plot).__name__} | {f.name: getattr(plot, f.name) for f in fields(plot)}
    for name in ("lines", "traces"):
        if name in data:
            data[name] = [asdict(part) for part in data[name]]
    if "when" in data:
        data["when"] = dict(data["when"])
    return data


def _placeholders(*texts: str) -> tuple[str, ...]:
    """The names that stand in braces."""
    return tuple(name for text in texts for name in re.findall(r"\{(\w+)\}", text))


def _set_fields(plot: Any, **values: Any) -> None:
    """The fields of a frozen plot, as its own __init__ sets them."""
    for name, value in values.items():
        object.__setattr__(plot, name, value)
