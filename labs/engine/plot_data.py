"""The data of a lab's plots, in full precision: of one plot as a table (CSV), of any as JSON, of
all as a ZIP file of tables.

A table has one header line and a line a sample, point, bar, row or cell; what has no value is
empty. JSON has what each plot says of itself (labs/plots.py) and, under "data", the arrays and
words it names: z of a heat map under `data[plot["z"]]`, (rows, columns).
"""

import io
import json
import re
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np

from labs.engine.record import csv_table, versions
from labs.engine.run import World
from labs.errors import LabError
from labs.number_texts import with_minus_signs
from labs.plots import (
    Bars,
    Card,
    Curves,
    HeatMap,
    Matrix,
    Note,
    Readout,
    TimeSeries,
    channel_names,
    describe,
    field_names,
    is_shown,
    label_names,
)

TOLERANCE = 1e-9
"""Of a heat map's axes: an arrow this near to the middle of a cell stands in that cell."""

_Arrays = Mapping[str, Any]
_Table = tuple[Sequence[str], Iterable[Sequence[Any]]]
"""A header, and rows of numbers and words."""


@dataclass(frozen=True)
class PlotData:
    """What some plots of a world show at one moment."""

    about: Mapping[str, Any]
    """Lab, parameters, seed, simulated time, iteration of the solver, versions."""
    plots: Sequence[tuple[Card, _Arrays]]

    @classmethod
    def of(cls, world: World, titles: Sequence[str] = ()) -> "PlotData":
        """The plots of these titles; without any all that mean something under the present
        parameters. Raises LabError."""
        shown = {p.title: p for p in world.lab.plots if not isinstance(p, Readout)}
        if unknown := [title for title in titles if title not in shown]:
            raise LabError(f"no plot is named {unknown[0]!r}; there are {', '.join(shown)}")
        params = world.params.model_dump()
        wanted = [shown[t] for t in titles] or [p for p in shown.values() if is_shown(p, params)]
        known = named_values(world)
        channels = world.recorder.channels()
        about = {
            "lab": world.entry.slug,
            "params": params,
            "seed": world.seed,
            "t": world.t,
            "iteration": world.shown.iteration if world.shown else None,
            "versions": versions(),
        }
        return cls(about, [(plot, _plot_arrays(plot, channels, known)) for plot in wanted])

    def csv(self) -> bytes:
        """The table of one plot. Raises LabError unless it is one."""
        if len(self.plots) != 1:
            raise LabError("a table is of one plot: name its title, or take a ZIP file of all")
        return _csv(*self.plots[0])

    def json(self) -> bytes:
        """{...about, "plots": [{title, kind, ..., "data": {name: values}}]}."""
        import orjson  # on demand: a headless run without output needs no writer

        plots = [describe(plot) | {"data": data} for plot, data in self.plots]
        return orjson.dumps(
            {**self.about, "plots": plots}, option=orjson.OPT_SERIALIZE_NUMPY, default=list
        )

    def zip(self) -> bytes:
        """A table a plot, named by its title, and about.json."""
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr("about.json", json.dumps(self.about, indent=1))
            for plot, data in self.plots:
                file.writestr(f"{file_name(plot.title)}.csv", _csv(plot, data))
        return packed.getvalue()

    def write(self, form: str) -> bytes:
        """`form` is "csv", "json" or "zip"."""
        return {"csv": self.csv, "json": self.json, "zip": self.zip}[form]()


def named_values(world: World) -> dict[str, np.ndarray | str | tuple[str, ...]]:
    """Fields, notes and labels as they are now: what plots show besides measured channels."""
    notes = world.lab.notes(world.params, world.state)
    return {
        **world.lab.fields(world.params, world.state),
        **{name: with_minus_signs(text) for name, text in notes.items()},
        **world.lab.labels(world.params),
    }


def file_name(title: str) -> str:
    """A plot's title in the letters every file system takes: "Gain now" is gain-now."""
    return re.sub(r"[^\w]+", "-", title.lower(), flags=re.ASCII).strip("-") or "plot"


def _plot_arrays(plot: Card, channels: _Arrays, known: _Arrays) -> _Arrays:
    """What a plot names, and nothing else; the world may go on meanwhile."""
    if isinstance(plot, TimeSeries):
        found = {name: channels[name] for name in ("t", *channel_names(plot)) if name in channels}
    else:
        found = {name: known[name] for name in field_names(plot) if name in known}
    found |= {name: known[name] for name in label_names(plot) if name in known}
    return {
        name: np.array(value, order="C") if isinstance(value, np.ndarray) else value
        for name, value in found.items()
    }


# Tables -------------------------------------------------------------------------------------


def _csv(plot: Card, data: _Arrays) -> bytes:
    return csv_table(*TABLES[type(plot)](plot, data))


def _time_series(plot: TimeSeries, data: _Arrays) -> _Table:
    columns = {"t": data["t"]}
    for name in dict.fromkeys(channel_names(plot)):
        values = data.get(name, np.empty(0))
        several = values.ndim == 2
        parts = {f"{name}[{i}]": values[:, i] for i in range(values.shape[1])} if several else {}
        columns |= parts or {name: values}
    return list(columns), zip_longest(*columns.values())


def _curves(plot: Curves, data: _Arrays) -> _Table:
    noted = any(trace.note for trace in plot.traces)
    x_name, y_name = _fill_label(plot.x_label, data), _fill_label(plot.y_label, data)
    header = ("curve", x_name or "x", (y_name if y_name != x_name else "") or "y")
    return (*header, "note") if noted else header, _points(plot, data, noted)


def _points(plot: Curves, data: _Arrays, noted: bool) -> Iterable[Sequence[Any]]:
    there = (trace for trace in plot.traces if not trace.optional or trace.y in data)
    for trace in there:
        xs, ys = np.asarray(data[trace.x]), np.asarray(data[trace.y])
        count = ys.shape[1] if ys.ndim == 2 else 1
        notes = np.ravel(data[trace.note]) if trace.note and trace.note in data else ()
        for k in range(count):
            label = trace.label if isinstance(trace.label, str) else trace.label[k]
            name = _fill_label(label, data, k) or (f"{trace.y}[{k}]" if ys.ndim == 2 else trace.y)
            note = [notes[k] if k < len(notes) else None] if noted else []
            of_x, of_y = (a[:, k] if a.ndim == 2 else a for a in (xs, ys))
            for x, y in zip(of_x, of_y, strict=True):
                yield name, x, y, *note


def _heat_map(plot: HeatMap, data: _Arrays) -> _Table:
    labels = [_fill_label(text, data) for text in (plot.x_label, plot.y_label, plot.z_label)]
    names = [label or name for label, name in zip(labels, "xyz", strict=True)]
    header = names if len(set(names)) == 3 else ["x", "y", "z"]
    x, y, z = (np.asarray(data[name]) for name in (plot.x, plot.y, plot.z))
    cells = [[x[j], y[i], z[i, j]] for i in range(len(y)) for j in range(len(x))]
    if not plot.arrows:
        return header, cells
    arrows = np.asarray(data[plot.arrows]).reshape(-1, 4)
    rows = [[*cell, None, None] for cell in cells]
    for across, up, *way in arrows:
        j, i = (int(np.argmin(np.abs(axis - at))) for axis, at in ((x, across), (y, up)))
        near = abs(x[j] - across) + abs(y[i] - up) <= TOLERANCE * (1.0 + abs(across) + abs(up))
        if near:
            rows[i * len(x) + j][3:] = way
        else:
            rows.append([across, up, None, *way])
    return [*header, "arrow right", "arrow up"], rows


def _matrix(plot: Matrix, data: _Arrays) -> _Table:
    values = np.asarray(data[plot.field])
    values = values.reshape(len(values), -1)
    names = data.get(plot.rows) or range(1, len(values) + 1)
    header = ["row", *(str(j + 1) for j in range(values.shape[1]))]
    return header, ([str(name), *row] for name, row in zip(names, values, strict=True))


def _bars(plot: Bars, data: _Arrays) -> _Table:
    columns = {"value": plot.field, "limit": plot.limit, "mark": plot.marks}
    there = {name: np.ravel(data[field]) for name, field in columns.items() if field in data}
    names = data.get(plot.names) or range(1, len(there["value"]) + 1)
    numbered = (str(name) for name in names)
    return ["bar", *there], zip_longest(numbered, *there.values())


def _note(plot: Note, data: _Arrays) -> _Table:
    return ["text"], ([line] for line in data[plot.note].split("\n"))


TABLES: Mapping[type, Callable[[Any, _Arrays], _Table]] = {
    TimeSeries: _time_series,
    Curves: _curves,
    HeatMap: _heat_map,
    Matrix: _matrix,
    Bars: _bars,
    Note: _note,
}


def _fill_label(text: str, data: _Arrays, k: int | None = None) -> str:
    """A label with its words, as the page has it (static/js/plots/placeholders.js)."""

    def word(match: re.Match[str]) -> str:
        if not match[1]:
            return match[0] if k is None else str(k + 1)
        said = data.get(match[1], "")
        if isinstance(said, str):
            return said
        if k is None:
            return ", ".join(dict.fromkeys(said))
        return said[k] if k < len(said) else ""

    return re.sub(r"\{(\w*)\}", word, text)
