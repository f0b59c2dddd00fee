"""Solutions as files, and taking them up again (labs/engine/solution.py, World.load)."""

import io
import json
import tracemalloc
import zipfile
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from labs.engine.array_files import MAX_ARRAYS, MAX_UNPACKED
from labs.engine.catalog import find_lab
from labs.engine.events import Event, events_from_recording
from labs.engine.headless import run_headless
from labs.engine.run import World
from labs.engine.snapshots import flatten
from labs.engine.solution import Solution
from labs.errors import LabError, ParameterError
from labs.lab import Snapshot

FORMS = ["json", "npz"]


@dataclass
class Part:
    gain: np.ndarray
    name: str


def all_data_kinds() -> dict[str, Any]:
    """One of each kind of plain data."""
    return {
        "floats": np.array([[1.0, -0.0, 1e-310], [0.1 + 0.2, np.pi, 1e300]]),
        "columns": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "single": np.array([0.1], np.float32),
        "counts": np.array([1, -(2**62)]),
        "bytes": np.array([0, 255], np.uint8),
        "flags": np.array([True, False]),
        "waves": np.array([1 + 2j, -3.5j]),
        "none": np.zeros((0, 3)),
        "scalar": 2.5,
        "whole": 7,
        "yes": True,
        "text": "ä\n",
        "absent": None,
        "parts": [Part(np.eye(2), "one"), Part(np.zeros((2, 2)), "two")],
        "pair": (1.0, {"deep": np.ones(1)}),
        "seconds": {"sweep": 0.25},
    }


def make_solution(data: dict[str, Any]) -> Solution:
    return Solution.of("lab", {"a": 1.0, "b": True}, 3, Snapshot(5, data, "Done.", 0.5))


@pytest.mark.parametrize("form", FORMS)
def test_everything_comes_back_bit_for_bit(form: str) -> None:
    data = all_data_kinds()
    solution = Solution.read(make_solution(data).write(form))
    assert solution.about() == make_solution(data).about()
    snapshot = solution.snapshot([Snapshot(1, data)])
    assert (snapshot.iteration, snapshot.done, snapshot.progress) == (5, "Done.", 0.5)
    back = snapshot.data
    assert back["seconds"] == {}, "durations stay at home"
    assert list(back) == list(data)
    before, after = (dict(flatten({**d, "seconds": {}})) for d in (data, back))
    for name, array in before.items():
        assert after[name].dtype == array.dtype, name
        assert after[name].shape == array.shape, name
        assert after[name].tobytes("A") == array.tobytes("A"), name
    assert isinstance(back["whole"], int)
    assert isinstance(back["parts"][1], Part)
    assert isinstance(back["pair"], tuple)
    assert back["columns"].flags.f_contiguous


@pytest.mark.parametrize("form", FORMS)
def test_a_file_is_the_same_whatever_the_clock_said(form: str) -> None:
    slow = all_data_kinds() | {"seconds": {"sweep": 99.0}}
    assert make_solution(slow).write("json") == make_solution(all_data_kinds()).write("json")
    assert b"sweep" not in make_solution(slow).write(form)


# Refusals -------------------------------------------------------------------------------------


def descent_world(iterations: int = 20, **changes: object) -> World:
    world = World(find_lab("descent"), changes)
    for _ in range(iterations):
        world.iterate()
    return world


def test_a_refused_solution_changes_nothing() -> None:
    world = descent_world()
    events, state = list(world.events), world.state
    for wrong in (
        replace(world.solution(), lab="oscillator"),
        replace(world.solution(), params={"rate": 9.0}),
        replace(world.solution(), arrays={}),
    ):
        with pytest.raises(LabError):
            world.load(wrong)
    assert (world.events, world.runs) == (events, 1)
    assert world.state is state
    assert world.loaded is None


def with_array(name: str, array: np.ndarray) -> Solution:
    solution = descent_world().solution()
    return replace(solution, arrays={**solution.arrays, name: array})


@pytest.mark.parametrize(
    ("solution", "sentence"),
    [
        (with_array("extra", np.ones(1)), "has extra, of which this lab knows nothing"),
        (with_array("point.x", np.ones(3)), r"point.x .* shape \(3,\); .* takes \(2,\)"),
        (with_array("point.x", np.ones((2, 1))), r"point.x .* shape \(2, 1\)"),
        (with_array("point.x", np.array([1.0, np.inf])), "not finite"),
        (with_array("point.x", np.array([1, 2])), "holds whole numbers; it takes numbers"),
        (with_array("point.x", np.array(["a", "b"])), "holds text; it takes numbers"),
        (with_array("counts.0", np.array(2.0)), "holds numbers; it takes whole numbers"),
        (with_array("counts.0", np.array(2**64 - 1, np.uint64)), "too large"),
        (with_array("point.path", np.ones((7, 3))), r"point.path .* shape \(7, 3\)"),
        (with_array("point.path", np.ones(7)), r"point.path .* shape \(7,\)"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(solution: Solution, sentence: str) -> None:
    with pytest.raises(LabError, match=sentence):
        World(find_lab("descent")).load(solution)


def test_only_an_axis_that_grows_may_have_another_length() -> None:
    world = World(find_lab("descent"))
    world.load(with_array("point.path", np.ones((7, 2))))
    assert world.state.path.shape == (7, 2)


def test_what_the_lab_cannot_show_is_refused() -> None:
    """The path may have any length, but the lab measures how far it went."""
    with pytest.raises(LabError, match="this lab cannot show the solution"):
        World(find_lab("descent")).load(with_array("point.path", np.ones((0, 2))))


def test_a_solution_of_another_lab_is_refused() -> None:
    with pytest.raises(LabError, match="a solution of 'descent', and here is 'oscillator'"):
        World(find_lab("oscillator")).load(descent_world().solution())
    with pytest.raises(LabError, match="a solution of 'descent', and here is 'oscillator'"):
        run_headless("oscillator", solution=descent_world().solution())
    of_none = replace(descent_world().solution(), lab="troublesome")
    with pytest.raises(LabError, match="has no solver"):
        World(find_lab("troublesome")).load(of_none)


def json_file(**changes: Any) -> bytes:
    return json.dumps(descent_world().solution().to_dict() | changes).encode()


def npz_file(how: int = zipfile.ZIP_DEFLATED, **members: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", how) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return stream.getvalue()


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, allow_pickle=True)
    return stream.getvalue()


def oversized_header(shape: tuple[int, ...]) -> bytes:
    """An array that says it is larger than it is."""
    stream = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, header)
    return stream.getvalue() + bytes(8)


def npy_with_header(header: str) -> bytes:
    """An array with such a header, of 8 bytes."""
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + bytes(8)


def json_with_array(dtype: object, values: object, shape: object = (1,)) -> bytes:
    return json_file(data={"x": {"dtype": dtype, "shape": shape, "values": values}})


def corrupt_member(content: bytes) -> bytes:
    """With some bytes of its first member turned over."""
    return content[:60] + bytes(255 - byte for byte in content[60:90]) + content[90:]


LONG = npy(np.array("x" * 1000))
UNREADABLE = {
    "nothing": b"",
    "no JSON": b"{",
    "a list": b"[]",
    "deep": b"[" * 100_000,
    "no data": b"{}",
    "data is a list": json_file(data=[]),
    "an array is a number": json_file(data={"x": 1}),
    "no lab": json_file(lab=None),
    "a wrong seed": json_file(seed=-1),
    "a wrong iteration": json_file(iteration=1.5),
    "a wrong progress": json_file(progress=2.0),
    "params of lists": json_file(params={"rate": [1]}),
    "objects": json_file(data={"x": {"dtype": "object", "shape": [1], "values": [1]}}),
    "records": json_file(data={"x": {"dtype": "f8,f8", "shape": [1], "values": [1]}}),
    "a huge shape": json_file(data={"x": {"dtype": "float64", "shape": [10**12], "values": [1.0]}}),
    "a broken zip": b"PK\x03\x04" + bytes(100),
    "an empty zip": npz_file(),
    "no npy": npz_file(about=b"hello"),
    "pickled": npz_file(about=npy(np.array([{"a": 1}], dtype=object))),
    "about nothing": npz_file(about=npy(np.array("{}"))),
    "boasting": npz_file(about=npy(np.array("{}")), x=oversized_header((10**12,))),
    "one long text and many short ones": json_with_array(
        "str", ["x" * 400_000] + 699 * [""], (700,)
    ),
    "a shape of many axes": json_with_array("float64", [1.0], [2**31] * 50_000),
    "a shape of texts": json_with_array("float64", [1.0], "1"),
    "a dtype of many": json_with_array("f8," * 9_000, [1.0]),
    "a dtype of parts": json_with_array({"names": ["a"], "formats": ["f8"]}, [1.0]),
    "numbers as text": json_with_array("float64", ["9" * 100_000]),
    "numbers in lists": json_with_array("float64", [[1.0]]),
    "text as numbers": json_with_array("str", [1]),
    "an endless number": json_file().replace(b'"seed": 0', b'"seed": 1' + b"0" * 5_000),
    "a long name": json_file(data={"x" * 201: {"dtype": "bool", "shape": [], "values": [True]}}),
    "many parameters": json_file(params={f"p{k}": 1.0 for k in range(201)}),
    "packed by LZMA": npz_file(zipfile.ZIP_LZMA, about=LONG),
    "torn LZMA": corrupt_member(npz_file(zipfile.ZIP_LZMA, about=LONG)),
    "torn BZ2": corrupt_member(npz_file(zipfile.ZIP_BZIP2, about=LONG)),
    "torn": corrupt_member(npz_file(about=LONG)),
    "a header of parentheses": npz_file(about=npy_with_header("(" * 5_000)),
    "a header of numbers": npz_file(about=npy_with_header("(" + "1," * 5_000 + ")")),
    "a header of an endless number": npz_file(about=npy_with_header("1" * 60_000)),
    "letters that are none": npz_file(about=npy(np.array("{}"))[:-8] + b"\xff\xff\xff\x7f" * 2),
    "half a letter": npz_file(about=npy(np.array("{}"))[:-8] + b"\x00\xd8\x00\x00" * 2),
    "deep about": npz_file(about=npy(np.array("[" * 100_000))),
    "many lists": json_file(unknown=[[]] * 20_000),
    "many objects": json_file(unknown=[{}] * 20_001),
    "many texts": json_file(unknown=[""] * 50_001),
    "many numbers": json_file(unknown=[0]).replace(b"[0]", b"[" + b"0," * 2**22 + b"0]"),
    "many lists in about": npz_file(about=npy(np.array("[" + "[]," * 20_000 + "0]"))),
    "many": npz_file(zipfile.ZIP_STORED, **{f"x{k}": b"" for k in range(MAX_ARRAYS + 1)}),
}


@pytest.mark.parametrize("content", UNREADABLE.values(), ids=UNREADABLE)
def test_what_is_no_solution_is_refused_in_a_sentence(content: bytes) -> None:
    with pytest.raises(LabError, match=r"\w+ \w+ \w+") as refused:
        Solution.read(content)
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize("form", ["json", "npz", "csv"])
def test_a_recording_is_named_as_one(form: str) -> None:
    recording = run_headless("descent", seconds=0.1).recording().write(form)
    with pytest.raises(LabError, match=r"this is a recording .*, not a solution"):
        Solution.read(recording)


def test_what_json_holds_is_counted_before_it_is_built() -> None:
    """As large a file as is taken, of nested lists, would take 50 times its size, and seconds."""
    content = json_file().replace(
        b"{", b'{"x": [' + b"[[[[[]]]]]," * (2**24 // 11 - 400) + b"0], ", 1
    )
    assert 0.99 * 2**24 < len(content) < 2**24
    tracemalloc.start()
    with pytest.raises(LabError, match=r"more than 20000 of the sign \["):
        Solution.read(content)
    used = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert used < 1e6


def test_a_file_that_unpacks_to_too_much_is_not_unpacked() -> None:
    bomb = npz_file(about=bytes(MAX_UNPACKED + 1))
    assert len(bomb) < 1e6
    with pytest.raises(LabError, match="unpacks to more than 64 MiB"):
        Solution.read(bomb)


# Taking up ------------------------------------------------------------------------------------


def test_a_run_begins_with_its_solution_and_goes_on_from_it() -> None:
    first = descent_world(20, rate=0.02)
    world = World(find_lab("descent"))
    world.load(Solution.read(first.solution().npz()))
    assert world.params.model_dump()["rate"] == 0.02
    assert world.state.path.tolist() == first.state.path.tolist()
    assert world.recording().channels["best"].tolist() == [first.state.best]
    assert world.snapshots.iterations == [20]
    first.iterate()
    world.iterate()
    assert world.snapshots.iterations == [20, 21]
    assert world.state.path.tolist() == first.state.path.tolist()


def test_a_reset_begins_without_the_solution() -> None:
    world = World(find_lab("descent"), solution=descent_world().solution())
    world.reset()
    assert world.loaded is None
    assert world.latest is None
    assert world.state.steps == 0


def test_nothing_found_is_nothing_to_save() -> None:
    with pytest.raises(LabError, match="found nothing yet"):
        World(find_lab("descent")).solution()


def test_what_is_looked_back_at_is_what_is_saved() -> None:
    world = descent_world(20)
    world.show(5)
    assert world.solution().iteration == 5
    assert len(world.solution().arrays["point.path"]) == 6


def test_a_run_after_loading_is_replayed_from_its_recording() -> None:
    world = World(find_lab("oscillator"), {"guess": 50.0}, seed=4)
    world.iterate()
    world.iterate()
    world = World(find_lab("oscillator"), solution=world.solution())
    for _ in range(3):
        world.advance()
    world.iterate()
    world.change({"noisy": True})
    for _ in range(5):
        world.advance()
    about = json.loads(world.recording().json())
    again = run_headless(
        about["lab"],
        about["params"],
        seed=about["seed"],
        seconds=about["covers"]["to"],
        events=events_from_recording(about),
        solution=Solution.from_dict(about["solution"]),
    )
    assert again.recording().json() == world.recording().json()
    assert world.seed == 4
    assert b"solution" not in world.recording().csv()
    with pytest.raises(LabError, match="began with a loaded solution"):
        world.command()


def test_headless_goes_on_unless_the_solution_is_done() -> None:
    part = descent_world(20).solution()
    assert run_headless("descent", solution=part).state.steps == 220
    whole = run_headless("descent", {"many": 50.0}).solution()
    assert whole.done == "50 steps done."
    assert run_headless("descent", solution=whole).state.steps == 50
    assert run_headless("descent", {"fade": 1.0}, solution=whole).state.steps == 50
    assert run_headless("descent", {"rate": 0.01}, solution=whole).state.steps == 100, (
        "another problem"
    )
    told = [Event(0, "solve", "iterate", 3)]
    assert run_headless("descent", solution=whole, events=told).state.steps == 53


def test_a_seed_of_ones_own_goes_before_the_solutions() -> None:
    world = World(find_lab("oscillator"), seed=4)
    world.iterate()
    keys = [
        run_headless("oscillator", solution=world.solution(), seed=s).seed for s in (None, 0, 9)
    ]
    assert keys == [4, 0, 9]


def test_looking_back_at_nothing_is_refused() -> None:
    with pytest.raises(ParameterError, match="no iteration of the solver to look back at yet"):
        World(find_lab("descent")).show(3)
