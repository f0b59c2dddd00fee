"""The API against a real server: sessions, parameters, commands, exports, refusals."""

import io
import json
import math
from typing import Any

import httpx
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed

from labs.engine.events import Event
from labs.engine.headless import run_headless
from tests.server_process import ServerProcess, wait_until


def test_lists_labs_with_their_parameters(shared_server: ServerProcess) -> None:
    labs = {lab["slug"]: lab for lab in shared_server.http.get("/api/labs").json()}
    assert {"joint-control", "oscillator"} <= set(labs)
    gain = next(p for p in labs["oscillator"]["params"] if p["name"] == "gain")
    assert (gain["low"], gain["high"], gain["scale"], gain["unit"]) == (0, 1000, "log", "1/s")


def test_a_session_lives_and_ends(shared_server: ServerProcess) -> None:
    before = shared_server.health()["sessions"]
    with shared_server.session("oscillator", params={"omega": 3}, seed=4) as session:
        found = shared_server.http.get(session.path).json()
        assert found["params"]["omega"] == 3
        assert found["seed"] == 4
        assert found["state"] == "live"
        assert shared_server.health()["sessions"] == before + 1
    answer = shared_server.http.get(session.path)
    assert answer.status_code == 404
    assert "open the lab anew" in answer.json()["error"]
    wait_until(lambda: shared_server.health()["sessions"] == before)


def test_changes_are_all_or_nothing(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session:
        assert session.set(omega=5.0, noisy=True).json()["params"]["omega"] == 5.0
        refused = session.set(omega=6.0, gain=-1.0)
        assert refused.status_code == 422
        assert refused.json()["error"] == "gain = -1.0: gain takes a number from 0 to 1000 1/s"
        assert shared_server.http.get(session.path).json()["params"]["omega"] == 5.0


def test_the_stream_takes_what_the_api_takes(shared_server: ServerProcess) -> None:
    """The page's own way: each message is answered, whatever it is, after what it changed."""
    with shared_server.session("oscillator") as session, session.stream() as stream:

        def ask(message: dict[str, Any] | str) -> str:
            text = message if isinstance(message, str) else json.dumps(message)
            stream.socket.send(text)
            return str(stream.next("answer")["error"])

        assert ask({"type": "params", "ref": 1, "changes": {"omega": 5.0}}) == ""
        assert shared_server.http.get(session.path).json()["params"]["omega"] == 5.0
        error = ask({"type": "params", "ref": 2, "changes": {"omega": 6.0, "gain": -1.0}})
        assert error == "gain = -1.0: gain takes a number from 0 to 1000 1/s"
        assert ask({"type": "command", "ref": 3, "command": {"command": "pause"}}) == ""
        error = ask({"type": "command", "ref": 4, "command": {"command": "press", "action": "no"}})
        assert "kick" in error
        for wrong in ("", "[]", "{", '{"type": "params", "ref": -1}', '{"type": "no", "ref": 5}'):
            assert ask(wrong), wrong
        stream.socket.send(json.dumps({"type": "command", "ref": 77, "command": "dance"}))
        assert stream.next("answer")["ref"] == 77, "a wrong one is answered where it belongs"
        assert shared_server.http.get(session.path).json()["params"]["omega"] == 5.0
        stream.socket.send("x" * 70_000)
        with pytest.raises(ConnectionClosed, match="65536"):
            stream.next("answer")


def test_commands_do_what_they_say(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session, session.stream() as stream:
        stream.next("status", lambda s: s["running"] and s["t"] > 0)
        assert session.command("pause").status_code == 204
        paused = stream.next("status", lambda s: not s["running"])
        session.command("step", count=7)
        stepped = stream.next("status", lambda s: s["t"] > paused["t"])
        assert stepped["t"] == pytest.approx(paused["t"] + 0.07, abs=1e-9)
        session.command("reset")
        assert stream.next("status", lambda s: s["run"] > paused["run"])["t"] == 0
        session.command("speed", factor=4)
        assert stream.next("status", lambda s: s["speed"] == 4)
        session.command("seed", seed=9)
        assert stream.next("status", lambda s: s["seed"] == 9)
        session.command("apply", params={"omega": 7.0})
        assert stream.next("status", lambda s: s["running"] and s["params"]["omega"] == 7.0)
        session.command("apply")
        assert stream.next("status", lambda s: s["params"]["omega"] == 2.0)
        session.command("press", action="kick")
        session.command("run")
        stream.next("telemetry", lambda m: m["rows"] and m["rows"][-1][5] == 1.0)


def test_an_experiment_is_one_command(shared_server: ServerProcess) -> None:
    """It sets speed and pace, makes the run it compares with, and holds exactly then, once."""
    with shared_server.session("oscillator", seed=5) as session, session.stream() as stream:
        noisy = {"noisy": True}
        other = {"params": noisy, "seconds": 2.0}
        how = {"speed": 4.0, "pace": 2.0, "hold": 0.53, "compare": other}
        assert session.command("apply", params={"omega": 7.0}, **how).status_code == 204
        compared = stream.next("compared")
        held = stream.next("status", lambda s: s["run"] == compared["run"] and not s["running"])
        assert held["t"] == pytest.approx(0.53, abs=1e-9)
        assert (held["speed"], held["solver"]["pace"], held["params"]["noisy"]) == (4, 2, False)
        alone = run_headless("oscillator", noisy, seconds=2.0, seed=5).recorder
        assert compared["columns"] == alone.columns
        np.testing.assert_array_equal(
            np.array(compared["rows"], "float32"), alone.since(0).astype("float32")
        )
        exported = session.server.http.get(f"{session.path}/export.json").json()
        assert {change["kind"] for change in exported["changes"]} <= {"solve"}, (
            "nothing of the hold"
        )
        session.command("run")
        stream.next("status", lambda s: s["running"] and s["t"] > 0.6)
        session.command("apply", hold=5.0)
        session.command("reset")
        session.command("apply", speed=1.0, pace=0.0)
        after = stream.next("status", lambda s: s["t"] > 0.2 and s["speed"] == 1)
        assert after["running"]
        assert session.command("apply", compare=other | {"params": {"noisy": 7}}).status_code == 422
        assert session.command("apply", hold=-1.0).status_code == 422


def test_a_link_keeps_what_it_can(shared_server: ServerProcess) -> None:
    link = {"gain": "1e9", "omega": "3", "fbclid": "x", "seed": "5"}
    with shared_server.session("oscillator", link=link) as session:
        params, remarks = session.info["params"], session.info["remarks"]
        assert (params["gain"], params["omega"], session.info["seed"]) == (1000.0, 3.0, 5)
        assert [remark.split()[0] for remark in remarks] == ["fbclid", "gain"]


def test_plots_are_files(shared_server: ServerProcess) -> None:
    """As labs/engine/plot_data.py makes them; here is how they are asked for."""
    with shared_server.session("oscillator", seed=5) as session:
        session.command("pause")

        def plots(form: str, **query: str) -> httpx.Response:
            return shared_server.http.get(f"{session.path}/plots.{form}", params=query)

        table = plots("csv", title="Position")
        assert "oscillator-position.csv" in table.headers["content-disposition"]
        one, every = plots("json", title="Position").json(), plots("json").json()
        assert (one["seed"], one["t"]) == (5, every["t"])
        assert one["plots"][0] in every["plots"]
        rows = [line.split(",") for line in table.text.splitlines()[1:]]
        assert [float(row[1]) for row in rows] == one["plots"][0]["data"]["x"]
        assert plots("zip").content.startswith(b"PK")
        for refused, why in (
            (plots("csv"), "a table is of one plot"),
            (plots("csv", title="No"), "there are Position, "),
        ):
            assert (refused.status_code, why in refused.json()["error"]) == (422, True)
        assert plots("npz").status_code in (404, 422)


def test_an_answer_comes_after_what_it_answers(shared_server: ServerProcess) -> None:
    """Whoever has the answer to a command finds the session changed."""
    with shared_server.session("oscillator") as session:
        for k in range(20):
            session.command("apply", params={"omega": 1.0 + 0.25 * k})
            found = shared_server.http.get(session.path).json()
            assert found["params"]["omega"] == 1.0 + 0.25 * k


def test_a_restart_parameter_restarts(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session, session.stream() as stream:
        first = stream.next("status", lambda s: s["t"] > 0.2)
        session.set(start=-0.5)
        after = stream.next("status", lambda s: s["run"] > first["run"])
        assert after["t"] < first["t"]
        assert after["params"]["start"] == -0.5


def test_telemetry_has_every_step_once_and_in_order(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session, session.stream() as stream:
        times: list[float] = []
        while len(times) < 150:
            times += [row[0] for row in stream.next("telemetry")["rows"]]
        assert np.diff(times) == pytest.approx(np.full(len(times) - 1, 0.01), abs=1e-4)


def test_fields_come_with_the_telemetry(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session, session.stream() as stream:
        fields = stream.next("telemetry", lambda m: m["fields"] is not None)["fields"]
        assert len(fields["field"]) == len(fields["angle"]) == 40
        assert len(fields["matrix"]) == 2
        assert fields["side"].endswith("It swings.")


def test_exports_hold_the_same_run(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator", params={"noisy": True}, seed=3) as session:
        session.command("step", count=200)
        session.set(omega=4.5)
        session.command("step", count=50)
        as_json = session.export()
        as_csv = shared_server.http.get(f"{session.path}/export.csv")
        as_npz = shared_server.http.get(f"{session.path}/export.npz")
    assert "oscillator.csv" in as_csv.headers["content-disposition"]
    x = np.array(as_json["channels"]["x"])
    assert len(x) == as_json["covers"]["rows"] >= 251
    header, *lines = as_csv.text.splitlines()
    column = header.split(",").index("x")
    assert [float(line.split(",")[column]) for line in lines] == x.tolist()
    arrays = np.load(io.BytesIO(as_npz.content))
    assert arrays["x"].tolist() == x.tolist()
    assert arrays["both"].shape == (len(x), 2)


def replay(about: dict[str, Any]) -> dict[str, np.ndarray]:
    """The channels of the same run, made headless from an export."""
    events = [Event(c["step"], c["kind"], c["name"], c["value"]) for c in about["changes"]]
    world = run_headless(
        about["lab"],
        about["params"],
        seed=about["seed"],
        seconds=about["covers"]["to"],
        events=events,
    )
    return world.recorder.channels()


@pytest.mark.parametrize("speed", [0.5, 4.0])
def test_live_and_headless_are_the_same_bit_for_bit(
    shared_server: ServerProcess, speed: float
) -> None:
    params = {"noise": 0.002, "initial_error": 0.1, "controller": "pid", "ki": 50.0}
    with shared_server.session("joint-control", params=params, seed=3) as session:
        session.command("speed", factor=speed)
        with session.stream() as stream:
            stream.next("status", lambda s: s["t"] > 0.4)
            session.set(kp=700.0, payload=2.0)
            session.command("press", action="push")
            stream.next("status", lambda s: s["t"] > 1.0)
            session.set(integrator="rk4")
            stream.next("status", lambda s: s["t"] > 1.4)
        session.command("pause")
        live = session.export()
    headless = replay(live)
    assert live["changes"], "the changes were recorded"
    assert set(live["channels"]) == set(headless)
    for name, values in live["channels"].items():
        assert np.array_equal(np.array(values, float), headless[name], equal_nan=True), (
            f"{name} differs"
        )


def test_the_command_line_reproduces_what_was_done(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator", seed=5) as session:
        session.command("step", count=30)
        session.set(omega=4.0)
        session.command("step", count=20)
        line = shared_server.http.get(f"{session.path}/command").json()["command"]
    assert line.startswith("orclab run oscillator --seed 5 --seconds ")
    assert "omega=4.0" in line


NOT_NUMBERS = ["NaN", "Infinity", "-Infinity", "1e999"]


@pytest.mark.parametrize("text", NOT_NUMBERS)
def test_numbers_must_be_finite(shared_server: ServerProcess, text: str) -> None:
    with shared_server.session("oscillator") as session:
        answer = shared_server.http.patch(
            f"{session.path}/params",
            content=f'{{"omega": {text}}}',
            headers={"content-type": "application/json"},
        )
        assert answer.status_code == 422, answer.text
        assert answer.json()["error"]
        assert math.isfinite(shared_server.http.get(session.path).json()["params"]["omega"])


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ("{", 422),
        ("[]", 422),
        ('"x"', 422),
        ('{"lab": "no-such-lab"}', 404),
        ('{"lab": "oscillator", "params": {"nothing": 1}}', 422),
        ('{"lab": "oscillator", "params": {"omega": "fast"}}', 422),
        ('{"lab": "oscillator", "params": {"omega": 1e6}}', 422),
        ('{"lab": "oscillator", "seed": -1}', 422),
        ('{"lab": "oscillator", "seed": 1.5}', 422),
        ('{"lab": "oscillator", "surprise": 1}', 422),
        ('{"lab": "../../etc/passwd"}', 404),
    ],
)
def test_bad_sessions_are_refused_in_words(
    shared_server: ServerProcess, body: str, status: int
) -> None:
    before = shared_server.health()["sessions"]
    answer = shared_server.http.post(
        "/api/sessions", content=body, headers={"content-type": "application/json"}
    )
    assert answer.status_code == status, answer.text
    assert answer.json()["error"]
    assert shared_server.health()["sessions"] == before


@pytest.mark.parametrize("command", ["fly", "speed", "step", "press", "apply"])
def test_bad_commands_are_refused_in_words(shared_server: ServerProcess, command: str) -> None:
    bad = {"factor": 99, "count": -1, "action": "no-such", "params": {"omega": 99}}
    with shared_server.session("oscillator") as session:
        wanted = {"speed": "factor", "step": "count", "press": "action", "apply": "params"}
        name = wanted.get(command)
        answer = session.command(command, **({name: bad[name]} if name else {}))
        assert answer.status_code == 422
        assert answer.json()["error"]


def test_a_guessed_id_finds_nothing(shared_server: ServerProcess) -> None:
    for method, path in (
        ("GET", "/api/sessions/guess"),
        ("DELETE", "/api/sessions/guess"),
        ("PATCH", "/api/sessions/guess/params"),
        ("GET", "/api/sessions/guess/export.csv"),
        ("GET", "/api/sessions/guess/command"),
        ("GET", "/scene/guess/"),
    ):
        body: dict[str, float] | None = {} if method == "PATCH" else None
        assert shared_server.http.request(method, path, json=body).status_code == 404, path


def test_unknown_export_forms_are_refused(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session:
        assert shared_server.http.get(f"{session.path}/export.exe").status_code == 422
