"""The data of plots as files (labs/engine/plot_data.py): of every kind, to the last digit."""

import csv
import io
import json
import math
import zipfile
from typing import Any

import numpy as np
import pytest

from labs.engine.headless import run_headless
from labs.engine.plot_data import PlotData, _points, file_name, named_values
from labs.engine.run import World
from labs.errors import LabError
from labs.plots import Curves, Trace, is_shown


def table(world: World, title: str) -> tuple[list[str], list[list[str]]]:
    """The header and the rows of a plot's CSV."""
    header, *rows = csv.reader(io.StringIO(PlotData.of(world, [title]).csv().decode()))
    return header, rows


def numbers(cells: list[str]) -> list[float]:
    return [float(cell) if cell else math.nan for cell in cells]


def column(rows: list[list[str]], k: int) -> np.ndarray:
    return np.array(numbers([row[k] for row in rows]))


@pytest.fixture(scope="module")
def oscillator() -> World:
    return run_headless("oscillator", {"noisy": True}, seconds=0.7, seed=3)


@pytest.fixture(scope="module")
def grid() -> World:
    return run_headless("dynamic-programming", {}, seconds=0.1)


def test_time_series_are_the_recording(oscillator: World) -> None:
    channels = oscillator.recorder.channels()
    header, rows = table(oscillator, "Position")
    assert header == ["t", "x", "both[0]", "both[1]"]
    parts = (channels["t"], channels["x"], *channels["both"].T)
    for k, values in enumerate(parts):
        np.testing.assert_array_equal(column(rows, k), values)


def test_curves_are_their_points_under_their_names(oscillator: World) -> None:
    fields = oscillator.lab.fields(oscillator.params, oscillator.state)
    header, rows = table(oscillator, "Waves")
    assert header == ["curve", "angle [rad]", "wave", "note"]
    for name, x, y in (("wave", "angle", "wave"), ("square", "angle", "square")):
        own = [row for row in rows if row[0] == name]
        np.testing.assert_array_equal(column(own, 1), fields[x])
        np.testing.assert_array_equal(column(own, 2), fields[y])
    assert {row[3] for row in rows if row[0] == "wave"} == {repr(float(fields["size"][0]))}
    assert [row for row in rows if row[0] == "size"], "a curve without a label has its field's"


def test_several_curves_of_one_field_have_their_words() -> None:
    world = run_headless("markov", {}, seconds=0.1)
    said, (header, rows) = world.lab.labels(world.params), table(world, "Transition matrix")
    assert [row[0] for row in rows] == list(said["state"])
    matrix = world.lab.fields(world.params, world.state)["P"]
    np.testing.assert_array_equal([numbers(row[1:]) for row in rows], matrix)
    header, rows = table(world, "Distribution now, and in the long run")
    assert header == ["bar", "value", "mark"]
    assert [row[0] for row in rows] == list(said["state"])


def test_heat_maps_have_their_cells_gaps_and_arrows(grid: World) -> None:
    fields = grid.lab.fields(grid.params, grid.state)
    x, y, z = (np.asarray(fields[name]) for name in ("x", "y", "V_map"))
    for title in ("Cost-to-go", "Policy"):
        header, rows = table(grid, title)
        assert header[:3] == ["column", "row from below", "V"]
        found = column(rows, 2).reshape(z.shape)
        np.testing.assert_array_equal(found, z)
        assert np.isnan(found).any(), "walls have no value"
        np.testing.assert_array_equal(column(rows, 0).reshape(z.shape), np.tile(x, (len(y), 1)))
    arrows = np.array([numbers([row[0], row[1], *row[3:]]) for row in rows if row[3]])
    expected = np.asarray(fields["policy"])
    np.testing.assert_array_equal(arrows[np.lexsort(arrows.T)], expected[np.lexsort(expected.T)])


def test_matrices_bars_and_notes(oscillator: World) -> None:
    fields = oscillator.lab.fields(oscillator.params, oscillator.state)
    _, rows = table(oscillator, "Matrix")
    np.testing.assert_array_equal([numbers(row[1:]) for row in rows], fields["matrix"])
    header, rows = table(oscillator, "Bars")
    assert header == ["bar", "value", "limit", "mark"]
    for k, name in enumerate(("bars", "limits", "marks"), 1):
        np.testing.assert_array_equal(column(rows, k), fields[name])
    header, rows = table(oscillator, "Note")
    assert (header, rows[-1]) == (["text"], ["It swings."])


def test_numbers_in_notes_have_the_sign_of_mathematics(
    oscillator: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = {"side": "At most -8 rad/s."}
    monkeypatch.setattr(type(oscillator.lab), "notes", lambda *_: said)
    assert named_values(oscillator)["side"] == "At most \u22128 rad/s."


def test_a_curve_that_is_left_out_is_not_in_the_table() -> None:
    curves = Curves(
        "Cost", "k", "J", Trace("k", "J", "J"), Trace("k", "bound", "bound", optional=True)
    )
    data = {"k": np.arange(2.0), "J": np.ones(2)}
    assert [row[0] for row in _points(curves, data, False)] == ["J", "J"]
    assert len(list(_points(curves, data | {"bound": np.ones(2)}, False))) == 4


def test_json_has_all_with_what_it_belongs_to(grid: World) -> None:
    found: dict[str, Any] = json.loads(PlotData.of(grid).json())
    assert (found["lab"], found["t"], found["seed"]) == ("dynamic-programming", grid.t, grid.seed)
    assert found["params"] == grid.params.model_dump()
    assert found["iteration"] == grid.shown.iteration  # type: ignore[union-attr]
    plots = {plot["title"]: plot for plot in found["plots"]}
    assert set(plots) == {
        plot.title
        for plot in grid.lab.plots
        if hasattr(plot, "title") and is_shown(plot, grid.params.model_dump())
    }
    policy = plots["Policy"]
    cells = np.array(policy["data"][policy["z"]], dtype=float)  # null is NaN
    np.testing.assert_array_equal(cells, grid.lab.fields(grid.params, grid.state)["V_map"])


def test_all_tables_in_one_file(oscillator: World) -> None:
    data = PlotData.of(oscillator)
    with zipfile.ZipFile(io.BytesIO(data.write("zip"))) as packed:
        assert json.loads(packed.read("about.json"))["lab"] == "oscillator"
        names = {f"{file_name(plot.title)}.csv" for plot, _ in data.plots}
        assert set(packed.namelist()) == {"about.json"} | names
        assert packed.read("position.csv") == PlotData.of(oscillator, ["Position"]).csv()


def test_what_is_not_there_is_refused(oscillator: World) -> None:
    with pytest.raises(LabError, match=r"no plot is named 'Positions'; there are Position, "):
        PlotData.of(oscillator, ["Positions"])
    with pytest.raises(LabError, match="a table is of one plot"):
        PlotData.of(oscillator).csv()
    assert file_name("What V* does over X₀") == "what-v-does-over-x"
