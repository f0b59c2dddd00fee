"""The solver's clock through the API: run, pause, step, look back, pace; saving and loading."""

import io
import json
import os
import signal
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from labs.engine.catalog import find_lab
from labs.engine.events import events_from_recording
from labs.engine.headless import run_headless
from labs.engine.run import World
from labs.engine.solution import Solution
from server.cli import main
from server.messages import SolverStatus
from server.solver_clock import SolverClock
from tests.server_process import ServerProcess, SessionClient, wait_until

LONG = {"many": 1000.0, "rate": 0.01}


def solver_status(session: SessionClient) -> Any:
    """The solver's status, now; None where there is no solver."""
    with session.stream() as stream:
        return stream.next("status")["solver"]


def put(session: SessionClient, content: bytes) -> httpx.Response:
    return session.server.http.put(f"{session.path}/solution", content=content)


def get(session: SessionClient, form: str) -> httpx.Response:
    return session.server.http.get(f"{session.path}/solution.{form}")


def replay(about: dict[str, Any]) -> World:
    """The same run, made headless from an export."""
    return run_headless(
        about["lab"],
        about["params"],
        seed=about["seed"],
        seconds=about["covers"]["to"],
        events=events_from_recording(about),
        solution=Solution.from_dict(about["solution"]) if "solution" in about else None,
    )


# The clock itself -----------------------------------------------------------------------------


def test_a_pace_lets_through_as_many_as_are_due() -> None:
    world = World(find_lab("descent"))
    clock = SolverClock(world, None)
    clock.dispatch("pace", pace=10.0)
    done = []
    for frame in range(60):
        now = 100.0 + frame / 60
        clock.iterate(now, until=float("inf"))
        done.append(world.latest.iteration if world.latest else 0)
    assert done[-1] in (12, 13), "10 in a second, and at first what it may be late (0.2 s)"
    assert np.diff(done).max() == 1


def test_time_left_is_told_from_progress_and_its_own_time() -> None:
    world = World(find_lab("descent"))
    clock = SolverClock(world, None)
    clock.dispatch("pace", pace=10.0)
    for frame in range(601):
        clock.iterate(100.0 + frame / 60, until=float("inf"))
    status = clock.status()
    assert isinstance(status, SolverStatus)
    assert status.progress == status.latest / 200
    expected = 10.0 * (200 - status.latest) / status.latest
    assert status.seconds_left == pytest.approx(expected, rel=0.02)
    clock.dispatch("pause")
    for frame in range(600):
        clock.iterate(200.0 + frame / 60, until=float("inf"))
    after = clock.status()
    assert after is not None
    assert after.seconds_left == pytest.approx(expected, rel=0.02), "a pause is not its time"


def test_steps_that_are_owed_end_with_their_solver() -> None:
    world = World(find_lab("descent"))
    clock = SolverClock(world, {"running": False, "pace": 0.0})
    clock.dispatch("step", count=5)
    world.change({"rate": 0.01})
    clock.iterate(1.0, until=float("inf"))
    assert world.latest is None
    clock.dispatch("step", count=3)
    clock.iterate(1.0, until=float("inf"))
    assert world.snapshots.iterations == [1, 2, 3]


def test_an_iteration_in_pieces_is_one_iteration() -> None:
    world = World(find_lab("descent"))
    clock = SolverClock(world, {"running": False, "pace": 0.0})
    clock.dispatch("step", count=2)
    found = []
    for _ in range(6):
        clock.iterate(1.0, until=0.0)  # a piece at a time
        found.append(world.latest.iteration if world.latest else 0)
    assert found == [0, 1, 1, 2, 2, 2]
    clock.dispatch("run")
    clock.iterate(1.0, until=0.0)
    clock.dispatch("show", iteration=1)
    for _ in range(3):
        clock.iterate(1.0, until=0.0)
    assert world.shown is world.snapshots.at(1), "what is looked at stays, in the midst of another"
    clock.dispatch("pace", pace=1.0)
    clock.dispatch("run")
    for _ in range(9):
        clock.iterate(2.0, until=0.0)
    assert world.latest is not None
    assert world.latest.iteration == 4, "the one that had begun, and the one that was due"


# Live -----------------------------------------------------------------------------------------


def test_it_runs_by_itself_and_says_how_it_stands(shared_server: ServerProcess) -> None:
    with shared_server.session("descent") as session, session.stream() as stream:
        solver = stream.next("status", lambda s: s["solver"]["done"])["solver"]
        assert solver == {
            "iteration": 200,
            "latest": 200,
            "kept": [1, 200],
            "running": True,
            "pace": 0.0,
            "done": "200 steps done.",
            "progress": 1.0,
            "seconds_left": None,
        }


def test_numbers_follow_the_solver_while_the_world_stands_still(
    shared_server: ServerProcess,
) -> None:
    with shared_server.session("descent", params=LONG) as session, session.stream() as stream:
        columns = stream.next("hello")["columns"]
        at = columns.index("best")
        session.command("solver_pause")
        session.command("reset")  # it may have done all its iterations by then
        stream.next("status", lambda s: s["solver"]["latest"] == 0)
        session.command("solver_step", count=3)
        before = stream.next("telemetry", lambda m: m["now"] and m["now"][at] < 5.5)["now"][at]
        session.command("solver_step", count=50)
        assert stream.next("telemetry", lambda m: m["now"] and m["now"][at] < before)
        session.command("solver_show", iteration=1)
        back = stream.next("telemetry", lambda m: m["now"] and m["now"][at] > before)
        assert back["rows"] == [], "what is looked at is not recorded"


def test_numbers_are_the_last_ones_where_a_solver_brings_the_world_to_a_halt(
    shared_server: ServerProcess,
) -> None:
    """The weights of Baird's star diverge; the last row was measured before."""
    star = {"world": "star", "alpha": 0.01, "updates": 5000.0}
    with shared_server.session("function-approximation", params=star) as session:
        with session.stream() as stream:
            status = stream.next("status", lambda s: s["trouble"])
        with session.stream() as stream:
            at = stream.next("hello")["columns"].index("learned")
            session.command("reset")
            updates = 50.0 * status["solver"]["latest"]
            assert stream.next("telemetry", lambda m: m["now"] and m["now"][at] == updates)


def test_a_lab_without_a_solver_says_so(shared_server: ServerProcess) -> None:
    with shared_server.session("troublesome") as session:
        assert solver_status(session) is None
        answer = session.command("solver_pause")
        assert answer.status_code == 422
        assert "no solver" in answer.json()["error"]
        assert get(session, "npz").status_code == 422
        assert put(session, b"{}").status_code == 422


def test_run_pause_step_and_pace(shared_server: ServerProcess) -> None:
    with shared_server.session("descent", params=LONG) as session, session.stream() as stream:
        session.command("solver_pace", pace=20)
        session.command("reset")
        stream.next("status", lambda s: 3 < s["solver"]["latest"] < 900)
        session.command("solver_pause")
        paused = stream.next("status", lambda s: not s["solver"]["running"])["solver"]
        assert solver_status(session)["latest"] == paused["latest"] < 900
        assert session.command("solver_step", count=7).status_code == 204
        stepped = stream.next("status", lambda s: s["solver"]["latest"] > paused["latest"] + 6)
        assert stepped["solver"]["latest"] == paused["latest"] + 7
        assert not stepped["solver"]["running"]
        session.command("solver_pace", pace=0)
        session.command("solver_run")
        assert stream.next("status", lambda s: s["solver"]["done"])["solver"]["latest"] == 1000


def test_the_two_clocks_do_not_hold_each_other(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session, session.stream() as stream:
        session.command("solver_pause")
        session.set(guess=50.0)
        held = stream.next("status", lambda s: s["params"]["guess"] == 50.0)
        assert held["solver"]["latest"] == 0
        assert stream.next("status", lambda s: s["t"] > held["t"] + 0.3)["solver"]["latest"] == 0
        session.command("pause")
        session.command("solver_run")
        ended = stream.next("status", lambda s: s["solver"]["done"])
        assert not ended["running"]
        assert ended["solver"]["done"] == "converged"


@pytest.mark.parametrize("how", ["reset", "change"])
def test_a_solver_that_is_paused_stays_so_when_it_starts_anew(
    shared_server: ServerProcess, how: str
) -> None:
    with shared_server.session("descent") as session, session.stream() as stream:
        stream.next("status", lambda s: s["solver"]["done"])
        session.command("solver_pause")
        session.command("reset") if how == "reset" else session.set(rate=0.02)
        anew = stream.next("status", lambda s: s["solver"]["latest"] == 0)["solver"]
        assert anew["kept"] is None
        assert not anew["running"]
        session.command("solver_step")
        stream.next("status", lambda s: s["solver"]["latest"] == 1)


def test_looking_back_pauses_and_running_goes_on_from_the_latest(
    shared_server: ServerProcess,
) -> None:
    with shared_server.session("descent", params=LONG) as session, session.stream() as stream:
        session.command("solver_pace", pace=50)
        session.command("reset")
        stream.next("status", lambda s: 10 < s["solver"]["latest"] < 900)
        assert session.command("solver_show", iteration=4).status_code == 204
        back = stream.next("status", lambda s: s["solver"]["iteration"] == 4)["solver"]
        assert not back["running"]
        assert back["kept"] == [1, back["latest"]]
        path = stream.next("telemetry", lambda m: m["fields"] and len(m["fields"]["first"]) == 5)
        assert path
        session.command("solver_run")
        on = stream.next("status", lambda s: s["solver"]["iteration"] > 4)["solver"]
        assert on["iteration"] >= back["latest"]


def test_looking_back_at_nothing_is_refused(shared_server: ServerProcess) -> None:
    with shared_server.session("descent") as session:
        session.command("solver_pause")
        session.command("reset")
        answer = session.command("solver_show", iteration=3)
        assert answer.status_code == 422
        assert "no iteration" in answer.json()["error"]


@pytest.mark.parametrize(
    ("command", "more"),
    [
        ("solver_step", {"count": 0}),
        ("solver_step", {"count": 10**6}),
        ("solver_show", {}),
        ("solver_show", {"iteration": -1}),
        ("solver_pace", {"pace": -1.0}),
        ("solver_pace", {"pace": 1e9}),
    ],
)
def test_wrong_commands_are_refused(
    shared_server: ServerProcess, command: str, more: dict[str, Any]
) -> None:
    with shared_server.session("descent") as session:
        assert session.command(command, **more).status_code == 422


def test_whatever_the_pace_was_the_run_is_replayed_bit_for_bit(
    shared_server: ServerProcess,
) -> None:
    with shared_server.session("oscillator", params={"guess": 90.0}) as session:
        with session.stream() as stream:
            session.command("solver_pace", pace=8)
            session.command("reset")
            stream.next("status", lambda s: s["solver"]["latest"] >= 3)
            session.command("solver_show", iteration=2)
            stream.next("status", lambda s: s["solver"]["iteration"] == 2 and s["t"] > 0.5)
            session.command("solver_run")
            stream.next("status", lambda s: s["solver"]["latest"] >= 5)
            session.set(guess=40.0)
            stream.next("status", lambda s: s["solver"]["done"])
        session.command("pause")
        live = session.export()
        line = shared_server.http.get(f"{session.path}/command").json()["command"]
    headless = replay(live)
    again = headless.recorder.channels()
    assert live["channels"]["root"] == again["root"].tolist()
    assert len(set(live["channels"]["root"])) > 6
    assert "show=2" in line


def test_a_replaced_worker_keeps_the_pace_and_the_pause(shared_server: ServerProcess) -> None:
    wait_until(lambda: shared_server.health()["workers"] == shared_server.health()["spares"] == 1)
    before = set(shared_server.listeners())
    with shared_server.session("descent") as session, session.stream() as stream:
        session.command("solver_pace", pace=5)
        session.command("solver_pause")
        stream.next("status", lambda s: s["solver"]["pace"] == 5 and not s["solver"]["running"])
        (worker,) = before  # the session took the spare
        os.kill(worker, signal.SIGKILL)
        assert stream.next("notice", lambda n: n["state"] == "live")
        solver = stream.next("status")["solver"]
        assert (solver["running"], solver["pace"], solver["latest"]) == (False, 5.0, 0)


# Solutions ------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["json", "npz"])
def test_a_solution_is_saved_and_loaded_elsewhere(shared_server: ServerProcess, form: str) -> None:
    params = {"rate": 0.03, "many": 120.0}
    with (
        shared_server.session("descent", params=params, seed=5) as session,
        session.stream() as stream,
    ):
        stream.next("status", lambda s: s["solver"]["done"])
        session.command("solver_show", iteration=60)
        answer = get(session, form)
    assert f"descent-solution.{form}" in answer.headers["content-disposition"]
    if form == "npz":
        arrays = np.load(io.BytesIO(answer.content))
        assert arrays["point.path"].shape == (61, 2)
        about = json.loads(str(arrays["about"]))
        assert (about["lab"], about["iteration"], about["seed"]) == ("descent", 60, 5)
    with shared_server.session("descent") as other, other.stream() as stream:
        loaded = put(other, answer.content)
        assert loaded.status_code == 200, loaded.text
        assert loaded.json()["params"].items() >= params.items()
        told = stream.next("status", lambda s: s["params"]["rate"] == 0.03)
        assert told["seed"] == 5
        assert told["solver"]["iteration"] == told["solver"]["latest"] == 60
        assert not told["solver"]["running"]
        assert shared_server.http.get(other.path).json()["params"]["rate"] == 0.03
        other.command("solver_run")
        ended = stream.next("status", lambda s: s["solver"]["done"])["solver"]
        assert ended["latest"] == 180, "it went on from there"
        live = other.export()
    world = replay(live)
    assert world.state.steps == 180
    assert live["solution"]["iteration"] == 60


def test_a_recording_after_loading_runs_again_from_the_command_line(
    shared_server: ServerProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with shared_server.session("oscillator", params={"guess": 90.0}) as session:
        with session.stream() as stream:
            stream.next("status", lambda s: s["solver"]["done"])
            assert put(session, get(session, "npz").content).status_code == 200
            stream.next("status", lambda s: s["t"] > 0.2)
        session.command("pause")
        live = session.export()
        refused = shared_server.http.get(f"{session.path}/command")
    assert refused.status_code == 422
    assert "--replay" in refused.json()["error"]
    (tmp_path / "run.json").write_text(json.dumps(live))
    again = tmp_path / "again.json"
    assert main(["run", "--replay", str(tmp_path / "run.json"), "--out", str(again)]) == 0
    assert json.loads(again.read_bytes())["channels"] == live["channels"]


def test_a_refused_solution_leaves_the_session_as_it_was(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session, session.stream() as stream:
        stream.next("status", lambda s: s["solver"]["done"] and s["t"] > 0.1)
        good = get(session, "json").json()
        wrong = [
            (b"hello", "no solution saved by orclab"),
            (json.dumps(good | {"lab": "descent"}).encode(), "a solution of 'descent'"),
            (json.dumps(good | {"data": {}}).encode(), "lacks root"),
            (json.dumps(good | {"params": {"omega": 1e9}}).encode(), "omega takes a number"),
        ]
        for content, sentence in wrong:
            answer = put(session, content)
            assert answer.status_code == 422
            assert sentence in answer.json()["error"]
        now = stream.next("status", lambda s: s["t"] > 0.2)
        assert now["run"] == 1
        assert now["solver"]["running"]
        assert not now["trouble"]


def test_a_solution_may_be_larger_than_other_bodies_but_not_any_size(
    shared_server: ServerProcess,
) -> None:
    with shared_server.session("oscillator") as session:
        assert put(session, b" " * 100_000).status_code == 422
        assert put(session, b" " * (2**24 + 1)).status_code == 413
        parts = (b" " * 2**20 for _ in range(40))  # without a length
        assert put(session, parts).status_code == 413  # type: ignore[arg-type]


def test_nothing_found_yet_is_told(shared_server: ServerProcess) -> None:
    with shared_server.session("descent") as session:
        session.command("solver_pause")
        session.command("reset")
        answer = get(session, "npz")
        assert answer.status_code == 422
        assert "found nothing yet" in answer.json()["error"]


# The command ----------------------------------------------------------------------------------


def test_the_command_writes_a_solution_and_starts_from_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = tmp_path / "a.npz", tmp_path / "b.json"
    begin = ["run", "descent", "--set", "many=50", "--at", "0", "iterate=20"]
    assert main([*begin, "--solution-out", str(first)]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 20.0
    go_on = ["run", "descent", "--solution", str(first), "--solution-out", str(second)]
    assert main(go_on) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 70.0
    assert main(["run", "descent", "--solution", str(second)]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 70.0, "it is done"
    assert main(["run", "descent", "--at", "0", "show=3"]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 3.0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["descent", "--solution", "none.npz"], "--solution none.npz: No such file"),
        (["descent", "--solution", __file__], "this is no solution saved by orclab"),
        (["descent", "--solution-out", "x.csv"], "the file is named F.json or F.npz"),
        (["descent", "--solution-out", "nowhere/x.npz"], "there is no folder nowhere"),
        (["troublesome", "--solution-out", "x.npz", "--seconds", "0"], "found nothing yet"),
    ],
)
def test_wrong_use_of_the_command_is_refused(
    arguments: list[str],
    sentence: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", *arguments]) == 2
    assert sentence in capsys.readouterr().err


def test_a_solution_tells_other_programs_what_was_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An LQR's matrices and poles, a learner's curves, values and policy; and they do no harm to
    who takes the solution up again."""
    lqr, learned, plots = tmp_path / "lqr.npz", tmp_path / "td.json", tmp_path / "plots.json"
    once = ["--seconds", "0", "--at", "0", "iterate=1"]
    written = ["--solution-out", str(lqr), "--plots-out", str(plots)]
    assert main(["run", "lqr", *once, *written]) == 0
    with np.load(lqr) as file:
        found = {n.removeprefix("results/"): file[n] for n in file if n.startswith("results/")}
    a, b, q, r = (found[name] for name in "ABQR")
    p, k = found["P"][0], found["K"][0]
    np.testing.assert_allclose(p, solve_discrete_are(a, b, q, r), rtol=1e-6)
    np.testing.assert_allclose(k, -np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a), rtol=1e-6)
    np.testing.assert_allclose(
        np.sort_complex(found["poles"]), np.sort_complex(np.linalg.eigvals(a + b @ k)), rtol=1e-9
    )
    assert np.abs(found["poles"]).max() < 1.0 < np.abs(found["poles_open"]).max()
    assert Solution.read(lqr.read_bytes()).results == {}
    assert "Gain now" in {plot["title"] for plot in json.loads(plots.read_bytes())["plots"]}
    assert main(["run", "lqr", "--solution", str(lqr), *once]) == 0
    few = ["--set", "episodes=250", "--seconds", "0"]
    assert main(["run", "td-control", *few, "--solution-out", str(learned)]) == 0
    results = json.loads(learned.read_bytes())["results"]
    assert {"V", "greedy_control", "policy", "online_first"} <= set(results)
    values = np.reshape(results["V"]["values"], results["V"]["shape"])
    data = json.loads(learned.read_bytes())["data"]
    np.testing.assert_array_equal(
        values, np.reshape(data["q"]["values"], data["q"]["shape"]).min(axis=-1)
    )
    capsys.readouterr()
