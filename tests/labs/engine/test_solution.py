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
from labs.engine.catalog import find
from labs.engine.events import Event, events_of
from labs.engine.headless import run
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


def everything() -> dict[str, Any]:
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


def saved(data: dict[str, Any]) -> Solution:
    return Solution.of("lab", {"a": 1.0, "b": True}, 3, Snapshot(5, data, "Done.", 0.5))


@pytest.mark.parametrize("form", FORMS)
def test_everything_comes_back_bit_for_bit(form: str) -> None:
    data = everything()
    solution = Solution.read(saved(data).write(form))
    assert solution.about() == saved(data).about()
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
    slow = everything() | {"seconds": {"sweep": 99.0}}
    assert saved(slow).write("json") == saved(everything()).write("json")
    assert b"sweep" not in saved(slow).write(form)


# Refusals -------------------------------------------------------------------------------------


def descended(iterations: int = 20, **changes: object) -> World:
    world = World(find("descent"), changes)
    for _ in range(iterations):
        world.iterate()
    return world


def test_a_refused_solution_changes_nothing() -> None:
    world = descended()
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
    solution = descended().solution()
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
        World(find("descent")).load(solution)


def test_only_an_axis_that_grows_may_have_another_length() -> None:
    world = World(find("descent"))
    world.load(with_array("point.path", np.ones((7, 2))))
    assert world.state.path.shape == (7, 2)


def test_what_the_lab_cannot_show_is_refused() -> None:
    """The path may have any length, but the lab measures how far it went."""
    with pytest.raises(LabError, match="this lab cannot show the solution"):
        World(find("descent")).load(with_array("point.path", np.ones((0, 2))))


def test_a_solution_of_another_lab_is_refused() -> None:
    with pytest.raises(LabError, match="a solution of 'descent', and here is 'oscillator'"):
        World(find("oscillator")).load(descended().solution())
    with pytest.raises(LabError, match="a solution of 'descent', and here is 'oscillator'"):
        run("oscillator", solution=descended().solution())
    of_none = replace(descended().solution(), lab="troublesome")
    with pytest.raises(LabError, match="has no solver"):
        World(find("troublesome")).load(of_none)


def plain(**changes: Any) -> bytes:
    return json.dumps(descended().solution().to_dict() | changes).encode()


def packed(how: int = zipfile.ZIP_DEFLATED, **members: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", how) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return stream.getvalue()


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, allow_pickle=True)
    return stream.getvalue()


def claims(shape: tuple[int, ...]) -> bytes:
    """An array that says it is larger than it is."""
    stream = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, header)
    return stream.getvalue() + bytes(8)


def headed(header: str) -> bytes:
    """An array with such a header, of 8 bytes."""
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + bytes(8)


def spelled(dtype: object, values: object, shape: object = (1,)) -> bytes:
    return plain(data={"x": {"dtype": dtype, "shape": shape, "values": values}})


def torn(content: bytes) -> bytes:
    """With some bytes of its first member turned over."""
    return content[:60] + bytes(255 - byte for byte in content[60:90]) + content[90:]


LONG = npy(np.array("x" * 1000))
UNREADABLE = {
    "nothing": b"",
    "no JSON": b"{",
    "a list": b"[]",
    "deep": b"[" * 100_000,
    "no data": b"{}",
    "data is a list": plain(data=[]),
    "an array is a number": plain(data={"x": 1}),
    "no lab": plain(lab=None),
    "a wrong seed": plain(seed=-1),
    "a wrong iteration": plain(iteration=1.5),
    "a wrong progress": plain(progress=2.0),
    "params of lists": plain(params={"rate": [1]}),
    "objects": plain(data={"x": {"dtype": "object", "shape": [1], "values": [1]}}),
    "records": plain(data={"x": {"dtype": "f8,f8", "shape": [1], "values": [1]}}),
    "a huge shape": plain(data={"x": {"dtype": "float64", "shape": [10**12], "values": [1.0]}}),
    "a broken zip": b"PK\x03\x04" + bytes(100),
    "an empty zip": packed(),
    "no npy": packed(about=b"hello"),
    "pickled": packed(about=npy(np.array([{"a": 1}], dtype=object))),
    "about nothing": packed(about=npy(np.array("{}"))),
    "boasting": packed(about=npy(np.array("{}")), x=claims((10**12,))),
    "one long text and many short ones": spelled("str", ["x" * 400_000] + 699 * [""], (700,)),
    "a shape of many axes": spelled("float64", [1.0], [2**31] * 50_000),
    "a shape of texts": spelled("float64", [1.0], "1"),
    "a dtype of many": spelled("f8," * 9_000, [1.0]),
    "a dtype of parts": spelled({"names": ["a"], "formats": ["f8"]}, [1.0]),
    "numbers as text": spelled("float64", ["9" * 100_000]),
    "numbers in lists": spelled("float64", [[1.0]]),
    "text as numbers": spelled("str", [1]),
    "an endless number": plain().replace(b'"seed": 0', b'"seed": 1' + b"0" * 5_000),
    "a long name": plain(data={"x" * 201: {"dtype": "bool", "shape": [], "values": [True]}}),
    "many parameters": plain(params={f"p{k}": 1.0 for k in range(201)}),
    "packed by LZMA": packed(zipfile.ZIP_LZMA, about=LONG),
    "torn LZMA": torn(packed(zipfile.ZIP_LZMA, about=LONG)),
    "torn BZ2": torn(packed(zipfile.ZIP_BZIP2, about=LONG)),
    "torn": torn(packed(about=LONG)),
    "a header of parentheses": packed(about=headed("(" * 5_000)),
    "a header of numbers": packed(about=headed("(" + "1," * 5_000 + ")")),
    "a header of an endless number": packed(about=headed("1" * 60_000)),
    "letters that are none": packed(about=npy(np.array("{}"))[:-8] + b"\xff\xff\xff\x7f" * 2),
    "half a letter": packed(about=npy(np.array("{}"))[:-8] + b"\x00\xd8\x00\x00" * 2),
    "deep about": packed(about=npy(np.array("[" * 100_000))),
    "many lists": plain(unknown=[[]] * 20_000),
    "many objects": plain(unknown=[{}] * 20_001),
    "many texts": plain(unknown=[""] * 50_001),
    "many numbers": plain(unknown=[0]).replace(b"[0]", b"[" + b"0," * 2**22 + b"0]"),
    "many lists in about": packed(about=npy(np.array("[" + "[]," * 20_000 + "0]"))),
    "many": packed(zipfile.ZIP_STORED, **{f"x{k}": b"" for k in range(MAX_ARRAYS + 1)}),
}


@pytest.mark.parametrize("content", UNREADABLE.values(), ids=UNREADABLE)
def test_what_is_no_solution_is_refused_in_a_sentence(content: bytes) -> None:
    with pytest.raises(LabError, match=r"\w+ \w+ \w+") as refused:
        Solution.read(content)
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize("form", ["json", "npz", "csv"])
def test_a_recording_is_named_as_one(form: str) -> None:
    recording = run("descent", seconds=0.1).recording().write(form)
    with pytest.raises(LabError, match=r"this is a recording .*, not a solution"):
        Solution.read(recording)


def test_what_json_holds_is_counted_before_it_is_built() -> None:
    """As large a file as is taken, of nested lists, would take 50 times its size, and seconds."""
    content = plain().replace(b"{", b'{"x": [' + b"[[[[[]]]]]," * (2**24 // 11 - 400) + b"0], ", 1)
    assert 0.99 * 2**24 < len(content) < 2**24
    tracemalloc.start()
    with pytest.raises(LabError, match=r"more than 20000 of the sign \["):
        Solution.read(content)
    used = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert used < 1e6


def test_a_file_that_unpacks_to_too_much_is_not_unpacked() -> None:
    bomb = packed(about=bytes(MAX_UNPACKED + 1))
    assert len(bomb) < 1e6
    with pytest.raises(LabError, match="unpacks to more than 64 MiB"):
        Solution.read(bomb)


# Taking up ------------------------------------------------------------------------------------


def test_a_run_begins_with_its_solution_and_goes_on_from_it() -> None:
    first = descended(20, rate=0.02)
    world = World(find("descent"))
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
    world = World(find("descent"), solution=descended().solution())
    world.reset()
    assert world.loaded is None
    assert world.latest is None
    assert world.state.steps == 0


def test_nothing_found_is_nothing_to_save() -> None:
    with pytest.raises(LabError, match="found nothing yet"):
        World(find("descent")).solution()


def test_what_is_looked_back_at_is_what_is_saved() -> None:
    world = descended(20)
    world.show(5)
    assert world.solution().iteration == 5
    assert len(world.solution().arrays["point.path"]) == 6


def test_a_run_after_loading_is_replayed_from_its_recording() -> None:
    world = World(find("oscillator"), {"guess": 50.0}, seed=4)
    world.iterate()
    world.iterate()
    world = World(find("oscillator"), solution=world.solution())
    for _ in range(3):
        world.advance()
    world.iterate()
    world.change({"noisy": True})
    for _ in range(5):
        world.advance()
    about = json.loads(world.recording().json())
    again = run(
        about["lab"],
        about["params"],
        seed=about["seed"],
        seconds=about["covers"]["to"],
        events=events_of(about),
        solution=Solution.from_dict(about["solution"]),
    )
    assert again.recording().json() == world.recording().json()
    assert world.seed == 4
    assert b"solution" not in world.recording().csv()
    with pytest.raises(LabError, match="began with a loaded solution"):
        world.command()


def test_headless_goes_on_unless_the_solution_is_done() -> None:
    part = descended(20).solution()
    assert run("descent", solution=part).state.steps == 220
    whole = run("descent", {"many": 50.0}).solution()
    assert whole.done == "50 steps done."
    assert run("descent", solution=whole).state.steps == 50
    assert run("descent", {"fade": 1.0}, solution=whole).state.steps == 50
    assert run("descent", {"rate": 0.01}, solution=whole).state.steps == 100, "another problem"
    told = [Event(0, "solve", "iterate", 3)]
    assert run("descent", solution=whole, events=told).state.steps == 53


def test_a_seed_of_ones_own_goes_before_the_solutions() -> None:
    world = World(find("oscillator"), seed=4)
    world.iterate()
    keys = [run("oscillator", solution=world.solution(), seed=s).seed for s in (None, 0, 9)]
    assert keys == [4, 0, 9]


def test_looking_back_at_nothing_is_refused() -> None:
    with pytest.raises(ParameterError, match="no iteration of the solver to look back at yet"):
        World(find("descent")).show(3)
