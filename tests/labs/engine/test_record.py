"""The recording of a run and its files (labs/engine/record.py)."""

import csv
import io
import json
import math
from typing import Any

import numpy as np
import pandas
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labs.engine.events import Event
from labs.engine.headless import run_headless
from labs.engine.record import Recorder, Recording, versions
from labs.engine.run import World

FINITE = st.floats(allow_nan=False, allow_infinity=False)
MEASUREMENTS = st.lists(st.tuples(FINITE, FINITE, FINITE, st.none() | FINITE), max_size=40)


def measurement(row: tuple[float, float, float, float | None]) -> dict[str, Any]:
    x, a, b, late = row
    return {"x": x, "v": np.array([a, b])} | ({} if late is None else {"late": late})


def a_recorder(capacity: int) -> Recorder:
    return Recorder({"x": 0.0, "v": np.zeros(2)}, ["late"], capacity)


# In memory ------------------------------------------------------------------------------------


@given(MEASUREMENTS, st.integers(1, 12), st.integers(0, 45))
def test_a_recorder_keeps_the_end_of_a_plain_list(
    rows: list[tuple[float, float, float, float | None]], capacity: int, since: int
) -> None:
    recorder = a_recorder(capacity)
    plain = []
    for i, row in enumerate(rows):
        recorder.add(float(i), measurement(row))
        plain.append([float(i), *(math.nan if value is None else value for value in row)])
    first = max(len(plain) - capacity, 0)
    expected = np.array(plain[max(first, since) :]).reshape(-1, 5)
    assert np.array_equal(recorder.since(since), expected, equal_nan=True)
    assert recorder.count == len(plain)
    assert recorder.kept == len(plain) - first


@pytest.mark.parametrize("rows", [1, 255, 256, 257, 513, 1000, 1001, 2500])
def test_memory_grows_with_use_and_stops_at_the_capacity(rows: int) -> None:
    recorder = a_recorder(1000)
    for i in range(rows):
        recorder.add(float(i), {"x": 10.0 * i, "v": np.array([i, -i])})
    expected = np.arange(max(0, rows - 1000), rows)
    channels = recorder.channels()
    assert np.array_equal(channels["t"], expected)
    assert np.array_equal(channels["x"], 10.0 * expected)
    assert np.array_equal(channels["v"], np.stack([expected, -expected], axis=1))
    assert len(recorder._rows) <= 1000


def test_what_was_handed_out_does_not_change_later() -> None:
    recorder = a_recorder(2)
    recorder.add(0.0, {"x": 1.0, "v": np.zeros(2)})
    rows, channels = recorder.since(0), recorder.channels()
    for i in range(5):
        recorder.add(float(i), {"x": 9.0, "v": np.ones(2)})
    assert rows[0, 1] == channels["x"][0] == 1.0


def test_columns_name_every_component_in_order() -> None:
    assert a_recorder(4).columns == ["t", "x", "v[0]", "v[1]", "late"]


def test_a_missing_scalar_does_not_repeat_the_row_it_overwrites() -> None:
    recorder = a_recorder(1)
    recorder.add(0.0, {"x": 1.0, "v": np.zeros(2), "late": 7.0})
    recorder.add(1.0, {"x": 2.0, "v": np.zeros(2)})
    assert math.isnan(recorder.channels()["late"][0])


# As files -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Ten events, a channel that begins late, noise."""
    events = [Event(i, "set", "omega", 2.0 + 0.1 * i) for i in range(10)]
    return run_headless(
        "oscillator", {"noisy": True}, seconds=1.0, seed=5, events=events
    ).recording()


def test_json_holds_the_same_numbers(recording: Recording) -> None:
    data = json.loads(recording.json())
    channels = data.pop("channels")
    assert data == json.loads(json.dumps(recording.about))
    assert list(channels) == list(recording.channels)
    for name, values in recording.channels.items():
        read = np.array(channels[name], dtype=float)
        assert np.array_equal(read, values, equal_nan=True), name
    assert channels["late"][0] is None


def test_csv_holds_the_same_numbers(recording: Recording) -> None:
    text = recording.csv().decode()
    assert json.loads(recording.description()) == json.loads(json.dumps(recording.about))
    header, *lines = csv.reader(io.StringIO(text))
    assert header == list(recording.columns)
    read = np.array([[float(cell) if cell else math.nan for cell in line] for line in lines])
    assert np.array_equal(read, recording.rows, equal_nan=True)
    assert lines[0][header.index("late")] == ""
    assert {len(line) for line in lines} == {len(header)}


def test_csv_is_read_by_pandas_without_options(recording: Recording) -> None:
    table = pandas.read_csv(io.BytesIO(recording.csv()))
    assert list(table.columns) == list(recording.columns)
    assert set(map(str, table.dtypes)) == {"float64"}
    assert np.allclose(table.to_numpy(), recording.rows, rtol=1e-15, equal_nan=True)


def test_npz_holds_the_same_numbers(recording: Recording) -> None:
    with np.load(io.BytesIO(recording.npz()), allow_pickle=False) as data:
        assert json.loads(str(data["about"])) == json.loads(json.dumps(recording.about))
        assert set(data.files) == {"about", *recording.channels}
        for name, values in recording.channels.items():
            assert np.array_equal(data[name], values, equal_nan=True), name


@pytest.mark.parametrize("form", ["json", "csv", "npz"])
def test_write_knows_the_forms_by_name(recording: Recording, form: str) -> None:
    assert len(recording.write(form)) > 1000


@given(st.lists(FINITE, min_size=1, max_size=20))
def test_every_double_survives_json_and_csv(values: list[float]) -> None:
    recorder = Recorder({"x": 0.0}, [], 100)
    for i, value in enumerate(values):
        recorder.add(float(i), {"x": value})
    recording = Recording({}, recorder.columns, recorder.since(0), recorder.channels())
    read = json.loads(recording.json())["channels"]["x"]
    assert np.array(read).tobytes() == np.array(values).tobytes()
    lines = recording.csv().decode().splitlines()[1:]
    written = [float(line.split(",")[1]) for line in lines]
    assert np.array(written).tobytes() == np.array(values).tobytes()


def test_a_recording_says_what_it_covers() -> None:
    world = World(run_headless("oscillator", seconds=0.0).entry, capacity=11)
    for _ in range(25):
        world.advance()
    recording = world.recording()
    assert recording.about["covers"] == {"from": 15 * 0.01, "to": 25 * 0.01, "rows": 11}
    assert recording.rows[0, 0] == 15 * 0.01
    assert recording.rows[-1, 0] == 25 * 0.01


def test_a_recording_names_the_versions_that_could_change_its_digits() -> None:
    found = versions()
    assert set(found) == {"python", "machine", "orclab", "pin", "numpy"}
    assert found["numpy"] == np.__version__
