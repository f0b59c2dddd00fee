"""The `orclab` command (server/cli.py): called, and once each as a process of its own."""

import csv
import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labs.engine.catalog import catalog
from labs.engine.headless import run_headless
from labs.engine.record import versions
from server.cli import main


@dataclass(frozen=True)
class Result:
    """What the command said, and how it ended."""

    returncode: int
    stdout: str
    stderr: str


Orclab = Callable[..., Result]


def own_process(*arguments: object, **environment: str) -> Result:
    """Runs the command to its end, in a process of its own."""
    ended = subprocess.run(
        [sys.executable, "-m", "server", *map(str, arguments)],
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
        env=os.environ | environment,
    )
    return Result(ended.returncode, ended.stdout, ended.stderr)


@pytest.fixture
def orclab(capsys: pytest.CaptureFixture[str]) -> Orclab:
    """Calls the command here, which spares the seconds that a new process takes."""

    def call(*arguments: object) -> Result:
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as end:  # argparse's way
            code = int(end.code or 0)
        return Result(code, *capsys.readouterr())

    return call


def printed_object(result: Result) -> dict[str, Any]:
    """The one JSON object on standard output, with nothing before or after it."""
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("\n") == 1
    data: dict[str, Any] = json.loads(result.stdout, parse_constant=pytest.fail)
    return data


def printed_error(result: Result) -> str:
    """The sentence on standard error with which the command refused."""
    assert result.returncode == 2, result.stderr
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    return result.stderr.strip()


# Listing --------------------------------------------------------------------------------------


def test_list_has_a_line_a_lab(orclab: Orclab) -> None:
    result = orclab("list")
    assert result.returncode == 0
    lines = result.stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(catalog())
    for line, entry in zip(lines, catalog().values(), strict=True):
        assert entry.lab.section in line
        assert entry.lab.title in line


def test_a_reader_who_leaves_early_ends_it_quietly() -> None:
    """As `orclab list | head -1` does."""
    with subprocess.Popen(
        [sys.executable, "-m", "server", "list"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout
        assert process.stderr
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141


def test_version_is_the_one_recordings_name(orclab: Orclab) -> None:
    result = orclab("--version")
    assert (result.returncode, result.stdout.strip()) == (0, versions()["orclab"])


def test_help_names_every_command(orclab: Orclab) -> None:
    result = orclab("--help")
    assert result.returncode == 0
    assert all(word in result.stdout for word in ("serve", "list", "run", "--port", "--open"))


# Running --------------------------------------------------------------------------------------


def test_run_prints_the_final_measurements() -> None:
    result = own_process("run", "joint-control", "--set", "kp=500", "--seconds", "0.5")
    data = printed_object(result)
    assert (data["lab"], data["seed"], data["t"], data["trouble"]) == ("joint-control", 0, 0.5, "")
    world = run_headless("joint-control", {"kp": 500.0}, seconds=0.5)
    for name, value in world.lab.measure(world.params, world.state).items():
        assert data[name] == (value.tolist() if isinstance(value, np.ndarray) else value)
    assert result.stderr == ""


def test_the_default_is_ten_seconds(orclab: Orclab) -> None:
    assert printed_object(orclab("run", "oscillator"))["t"] == 10.0


def test_changes_presses_and_drags_happen_at_their_times(orclab: Orclab) -> None:
    line = (
        "run oscillator --seconds 1 --set noisy=false --at 0.2 omega=5 --at 0.3 press=kick "
        "--at 0.4 hold=pull:0.5,0,0 --at 0.5 guess=16"
    )
    data = printed_object(orclab(*line.split()))
    assert (data["kicks"], data["pulled"]) == (1.0, 0.5)
    assert data["root"] == pytest.approx(4.0, rel=1e-12)
    assert data["x"] == pytest.approx(np.cos(5.0), rel=1e-12)


def test_trouble_is_a_result_and_a_sentence(orclab: Orclab) -> None:
    result = orclab("run", "troublesome", "--set", "fault=trouble")
    data = printed_object(result)
    assert data["trouble"] == "It diverged at once: choose another fault."
    assert data["trouble"] in result.stderr
    assert data["t"] == 0.01


def test_the_solvers_last_sentence_is_printed_once_there_is_one(orclab: Orclab) -> None:
    line = "run descent --set many=5 --seconds 0"
    assert printed_object(orclab(*line.split()))["solver"] == "5 steps done."
    assert printed_object(orclab(*line.split(), "--at", "0", "iterate=3"))["solver"] is None
    assert printed_object(orclab("run", "troublesome", "--seconds", "0"))["solver"] is None


def test_a_diverged_arm_prints_finite_numbers_only(orclab: Orclab) -> None:
    line = "run joint-control --set kd=0 --set integrator=explicit-euler --set kp=2000"
    data = printed_object(orclab(*line.split(), "--set", "torque_limits=off"))
    assert data["trouble"].startswith("Diverged at t = ")


def test_the_three_forms_hold_the_same_run(orclab: Orclab, tmp_path: Path) -> None:
    for form in ("json", "csv", "npz"):
        path = tmp_path / f"run.{form}"
        line = "run oscillator --seconds 1 --seed 3 --set noisy=true"
        result = orclab(*line.split(), "--out", path)
        assert printed_object(result)["seed"] == 3
        assert result.stderr.startswith(f"wrote {path}\n")
    beside = json.loads((tmp_path / "run.about.json").read_text())
    data = json.loads((tmp_path / "run.json").read_text())
    with np.load(tmp_path / "run.npz") as arrays:
        assert json.loads(str(arrays["about"]))["params"]["noisy"] is True
        for name, values in data["channels"].items():
            read = np.array(values, dtype=float)
            assert np.array_equal(read, arrays[name], equal_nan=True), name
    assert beside["params"] == data["params"]
    header, *lines = csv.reader((tmp_path / "run.csv").read_text().splitlines())
    column = [float(line[header.index("x")]) for line in lines]
    assert column == data["channels"]["x"]
    assert len(column) == 101


def test_the_same_seed_gives_the_same_channels(orclab: Orclab, tmp_path: Path) -> None:
    contents = []
    for seed, name, command in ((3, "one", orclab), (3, "two", own_process), (4, "other", orclab)):
        path = tmp_path / f"{name}.npz"
        line = f"run joint-control --set noise=0.01 --seconds 0.5 --seed {seed} --at 0.2 press=push"
        assert command(*line.split(), "--out", path).returncode == 0
        with np.load(path) as arrays:
            contents.append({k: arrays[k].tobytes() for k in arrays.files if k != "about"})
    assert contents[0] == contents[1] != contents[2]


def test_a_replay_is_the_run_again(orclab: Orclab, tmp_path: Path) -> None:
    first, second = tmp_path / "first.json", tmp_path / "second.json"
    line = "run joint-control --set noise=0.01 --seconds 0.6 --seed 3 --at 0.2 press=push"
    one = orclab(*line.split(), "--at", "0.3", "kp=900", "--out", first)
    two = orclab("run", "--replay", first, "--out", second)
    assert printed_object(one) == printed_object(two)
    assert first.read_bytes() == second.read_bytes()


def test_a_replay_can_go_on_for_longer(orclab: Orclab, tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    assert orclab("run", "oscillator", "--seconds", 1, "--out", path).returncode == 0
    assert printed_object(orclab("run", "--replay", path, "--seconds", 2))["t"] == 2.0


# Wrong use ------------------------------------------------------------------------------------


RefusedCall = Callable[..., str]


@pytest.fixture
def refused(orclab: Orclab) -> RefusedCall:
    """Calls the command; the sentence with which it refuses."""
    return lambda *arguments: printed_error(orclab(*arguments))


def test_wrong_use_ends_the_process_with_2_and_no_traceback() -> None:
    assert printed_error(own_process("run", "nope")).startswith("orclab: no lab is named 'nope'")


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("run", "say which lab to run: kinematics"),
        ("run nope", "no lab is named 'nope'; there are kinematics"),
        ("run oscillator --set nope=1", "no parameter is named 'nope'; there are omega"),
        ("run oscillator --set omega=99", "omega takes a number from 0.1 to 10 rad/s"),
        ("run oscillator --set omega=nan", "omega takes a number from 0.1 to 10 rad/s"),
        ("run oscillator --set omega=fast", "omega = fast"),
        ("run oscillator --set shape=round", "shape takes one of sine, square"),
        ("run oscillator --set noisy=maybe", "noisy takes true or false"),
        ("run oscillator --set omega", "write name=value"),
        ("run oscillator --seconds nan", "takes a number from 0 to 20000"),
        ("run oscillator --seconds -1", "takes a number from 0 to 20000"),
        ("run oscillator --seconds long", "--seconds"),
        ("run oscillator --seed -1", "takes a whole number from 0 to 4294967295"),
        ("run oscillator --seed 1.5", "--seed"),
        ("run oscillator --at soon omega=1", "takes a time in seconds"),
        ("run oscillator --at -1 omega=1", "takes a time from 0"),
        ("run oscillator --at 1 omega", "name=value"),
        ("run oscillator --at 1 omega=99", "omega takes a number from 0.1 to 10 rad/s"),
        ("run oscillator --at 1 start=0.5", "give it with --set"),
        ("run oscillator --at 1 press=jump", "there are kick"),
        ("run oscillator --at 1 hold=pull:1,2", "held at x,y,z or released"),
        ("run oscillator --at 1 hold=pull:nan,0,0", "three finite numbers"),
        ("run oscillator --at 1 hold=plul:0,0,0", "no handle is named 'plul'; there are pull"),
        ("run oscillator --at 99 omega=1", "lies beyond the run's 10 s"),
        ("run oscillator --out run.txt", "F.json, F.csv or F.npz"),
        ("run oscillator --out no/such/folder/run.json", "there is no folder"),
        ("run --replay no-such-file.json", "No such file"),
        ("run oscillator --replay run.json", "takes the lab"),
        ("run --seed 1 --replay run.json", "and seed from the file"),
        ("walk", "invalid choice"),
        ("--port 65536", "takes a whole number from 0 to 65535"),
        ("--port http", "takes a whole number from 0 to 65535"),
        ("serve --port -1", "takes a whole number from 0 to 65535"),
        ("--host 256.0.0.1", "cannot listen on 256.0.0.1"),
    ],
)
def test_wrong_use_is_refused_with_a_sentence(
    refused: RefusedCall, line: str, sentence: str
) -> None:
    assert sentence in refused(*line.split())


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"lab": "nope"}, "no lab is named 'nope'"),
        ({"params": {"omega": 99.0}}, "omega takes a number"),
        ({"params": 5}, "not a JSON export of orclab"),
        ({"seed": "x"}, "not a JSON export of orclab"),
        ({"seed": -1}, "takes a whole number"),
        ({"covers": {}}, "not a JSON export of orclab"),
        ({"covers": {"to": 1e9}}, "takes a number from 0 to 20000"),
        ({"changes": [{"step": 1}]}, "not a JSON export of orclab"),
        ({"changes": [{"step": "x", "kind": "set", "name": "a", "value": 1}]}, "no change of"),
        ({"changes_complete": False}, "cannot be run again exactly"),
    ],
)
def test_a_damaged_export_is_refused(
    refused: RefusedCall, tmp_path: Path, change: dict[str, Any], sentence: str
) -> None:
    data = json.loads(run_headless("oscillator", seconds=0.1).recording().json())
    path = tmp_path / "run.json"
    path.write_text(json.dumps(data | change))
    assert sentence in refused("run", "--replay", path)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"5", b"\xff\xfe", b'{"lab": "oscillator"}'])
def test_a_file_that_is_no_export_is_refused(
    refused: RefusedCall, tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "run.json"
    path.write_bytes(content)
    assert "not a JSON export of orclab" in refused("run", "--replay", path)


def test_a_file_that_cannot_be_written_is_refused(refused: RefusedCall, tmp_path: Path) -> None:
    (tmp_path / "run.json").mkdir()
    sentence = refused("run", "oscillator", "--seconds", 0, "--out", tmp_path / "run.json")
    assert "Is a directory" in sentence


def test_a_taken_port_is_refused_with_what_to_do(refused: RefusedCall) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        sentence = refused("--port", port)
    assert f"cannot listen on 127.0.0.1 port {port}" in sentence
    assert "--port 0" in sentence


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("ORCLAB_PORT", "http"),
        ("ORCLAB_MAX_SESSIONS", "0"),
        ("ORCLAB_HANG_SECONDS", "-1"),
        ("ORCLAB_ORIGINS", "nonsense"),
    ],
)
def test_a_wrong_setting_is_refused_by_name(
    refused: RefusedCall, monkeypatch: pytest.MonkeyPatch, variable: str, value: str
) -> None:
    monkeypatch.setenv(variable, value)
    assert variable in refused()


def test_a_course_that_is_not_there_is_refused_by_name() -> None:
    sentence = printed_error(own_process("list", ORCLAB_LABS="no_such_course"))
    assert "ORCLAB_LABS names no_such_course" in sentence
