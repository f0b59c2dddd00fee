"""What a lab may plot. A plot names channels: keys of what the lab's `measure` (recorded over
time) or `fields` (asked for a few times a second) returns. Symbols are TeX, units SI."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

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
    what a vector's components are ("joint"). `stacked` lays the solid lines of one component on
    top of one another as areas, what is negative below zero; while all are chosen, those of
    component `lead`."""

    title: str
    unit: str
    lines: tuple[Line, ...]
    select: str
    stacked: bool
    lead: int

    def __init__(
        self,
        title: str,
        unit: str,
        *lines: Line,
        select: str = "",
        stacked: bool = False,
        lead: int = 0,
    ) -> None:
        _set(self, title=title, unit=unit, lines=lines, select=select, stacked=stacked, lead=lead)


@dataclass(frozen=True)
class Trace:
    """One line or set of points among `Curves`: y over x, 1-D fields of one length, which may
    change and be 0. With y of shape (n, k) it is k curves, each of a colour of its own, over the
    same x or each over its column of an x of that shape. "marked" is a line with its points.
    Without a label it stays out of the legend; `note` names a field of one number for each curve
    (NaN or none where there is none), that stands behind the label. `series` is its colour, or
    that of the first curve, 1 to 8, or 0 for ink."""

    x: str
    y: str
    label: str | tuple[str, ...] = ""
    """Of k curves a name each, or one name in which {} stands for the number of the curve."""
    style: Literal["line", "marked", "points", "dash"] = "line"
    series: int = 0
    note: str = ""


@dataclass(frozen=True, init=False)
class Curves:
    """Traces in one chart: a trajectory in a plane, eigenvalues as points, errors over steps. On a
    logarithmic axis what is not positive is left out. `equal` gives both axes one scale; the guide
    is the line or the circle that parts the stable from the unstable."""

    title: str
    x_label: str
    y_label: str
    traces: tuple[Trace, ...]
    log_x: bool
    log_y: bool
    guide: Guide
    equal: bool

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
    ) -> None:
        labels = {"title": title, "x_label": x_label, "y_label": y_label}
        _set(self, **labels, traces=traces, log_x=log_x, log_y=log_y, guide=guide, equal=equal)


@dataclass(frozen=True)
class HeatMap:
    """A 2-D field z over 1-D fields x (columns) and y (rows). With `gaps` z may be NaN where
    there is no value: the cell stays empty."""

    title: str
    x: str
    y: str
    z: str
    x_label: str
    y_label: str
    z_label: str
    gaps: bool = False


@dataclass(frozen=True)
class Matrix:
    """A small 2-D field written out in digits. `shade` also colours each cell by its value
    relative to the largest magnitude: a heat map one can read."""

    title: str
    field: str
    symbol: str
    unit: str = ""
    shade: bool = False


@dataclass(frozen=True)
class Bars:
    """A 1-D field as bars, with the limit (a 1-D field) each must stay within, and with marks (a
    1-D field, which may be empty) across the bars where each ought to end. With `gaps` bars and
    marks may be NaN where there is no value: they are left out."""

    title: str
    field: str
    symbol: str
    unit: str
    limit: str = ""
    marks: str = ""
    gaps: bool = False


@dataclass(frozen=True)
class Readout:
    """A scalar channel as a number. Where it is not defined (yet), `measure` leaves it out.
    `whole` is for counts: no decimals."""

    channel: str
    label: str
    unit: str
    whole: bool = False


@dataclass(frozen=True)
class Note:
    """What `Lab.notes` says under this name: plain sentences, a paragraph a line."""

    title: str
    note: str


Plot = TimeSeries | Curves | HeatMap | Matrix | Bars | Readout | Note


def measured(plot: Plot) -> tuple[str, ...]:
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
        case HeatMap(x=x, y=y, z=z):
            return (x, y, z)
        case Matrix(field=field):
            return (field,)
        case Bars(field=field, limit=limit, marks=marks):
            return tuple(name for name in (field, limit, marks) if name)
        case Note(note=note):
            return (note,)
        case _:
            return ()


def fields_with_gaps(plot: Plot) -> tuple[str, ...]:
    """The fields a plot shows in which NaN stands for what has no value."""
    match plot:
        case Curves(traces=traces):
            return tuple(trace.note for trace in traces if trace.note)
        case HeatMap(z=z, gaps=True):
            return (z,)
        case Bars(field=field, marks=marks, gaps=True):
            return (field, marks)
        case _:
            return ()


def describe(plot: Plot) -> dict[str, Any]:
    """A plot as plain JSON data; `kind` tells which."""
    return {"kind": type(plot).__name__} | asdict(plot)


def _set(plot: Any, **values: Any) -> None:
    """The fields of a frozen plot, as its own __init__ sets them."""
    for name, value in values.items():
        object.__setattr__(plot, name, value)
