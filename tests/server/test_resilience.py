"""What breaks, and what comes back by itself."""

import os
import signal
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import psutil
import pytest

from tests.server_process import ServerProcess, SessionClient, wait_until
from tests.viser_client import SceneClient


def test_a_killed_worker_is_replaced_with_the_same_parameters(shared_server: ServerProcess) -> None:
    wait_until(lambda: shared_server.health()["workers"] == shared_server.health()["spares"] == 1)
    before = set(shared_server.listeners())
    params = {"omega": 6.5, "noisy": True}
    with (
        shared_server.session("oscillator", params=params, seed=7) as session,
        session.stream() as stream,
    ):
        stream.next("status", lambda s: s["t"] > 0.3)
        # The session took the worker that was the spare.
        (worker,) = before
        os.kill(worker, signal.SIGKILL)
        notice = stream.next("notice")
        assert notice["state"] == "recovering"
        assert "SIGKILL" in notice["text"]
        assert stream.next("notice")["state"] == "live"
        status = stream.next("status", lambda s: s["t"] > 0.1)
        assert status["params"].items() >= params.items()
        assert status["seed"] == 7
        assert status["running"]
        assert worker not in shared_server.listeners()


def test_a_killed_fork_server_takes_nothing_down(single_place_server: ServerProcess) -> None:
    with single_place_server.session("oscillator") as session, session.stream() as stream:
        stream.next("status", lambda s: s["t"] > 0.3)
        (fork_server,) = {
            psutil.Process(worker).ppid() for worker in single_place_server.listeners()
        }
        os.kill(fork_server, signal.SIGKILL)
        assert stream.next("notice")["state"] == "recovering"
        assert stream.next("notice")["state"] == "live"
        assert stream.next("status", lambda s: s["t"] > 0.1)


def test_a_request_broken_off_leaves_the_fork_server_and_its_workers(
    single_place_server: ServerProcess,
) -> None:
    with single_place_server.session("oscillator") as session, session.stream() as stream:
        wait_until(lambda: single_place_server.health()["spares"] == 1)
        workers = set(single_place_server.listeners())
        (fork_server,) = {psutil.Process(worker).ppid() for worker in workers}
        sockets = psutil.Process(fork_server).net_connections("unix")
        (address,) = {found.laddr for found in sockets if "listener-" in str(found.laddr)}
        for _ in range(3):
            with socket.socket(socket.AF_UNIX) as client:
                client.connect(address)
        before = stream.next("status")["t"]
        assert stream.next("status", lambda s: s["t"] > before + 0.3)
        assert set(single_place_server.listeners()) == workers
    wait_until(lambda: single_place_server.health()["sessions"] == 0)
    with single_place_server.session("oscillator"):
        wait_until(lambda: single_place_server.health()["spares"] == 1)
        assert {psutil.Process(worker).ppid() for worker in single_place_server.listeners()} == {
            fork_server
        }


def test_a_hung_lab_is_replaced_and_then_given_up(shared_server: ServerProcess) -> None:
    with shared_server.session("troublesome") as session, session.stream() as stream:
        stream.next("status", lambda s: s["t"] > 0.1)
        session.set(fault="hang")
        notice = stream.next("notice")
        assert notice["state"] == "recovering"
        assert "stopped answering for 3 s" in notice["text"]
        # It hangs again with the same parameters, and is not restarted for ever.
        last = stream.next("notice", lambda n: n["state"] == "failed")
        assert "defaults" in last["text"]
        assert session.set(fault="none").status_code == 503


def test_trouble_stops_the_world_and_reset_starts_it(shared_server: ServerProcess) -> None:
    with shared_server.session("troublesome") as session, session.stream() as stream:
        session.set(fault="trouble")
        stuck = stream.next("status", lambda s: s["trouble"])
        assert stuck["trouble"].startswith("It diverged")
        session.set(fault="none")
        session.command("reset")
        assert stream.next("status", lambda s: not s["trouble"] and s["t"] > 0.1)


def test_a_lab_that_raises_says_so_and_lives_on(shared_server: ServerProcess) -> None:
    with shared_server.session("troublesome") as session, session.stream() as stream:
        session.set(fault="raise")
        stuck = stream.next("status", lambda s: s["trouble"])
        assert "ZeroDivisionError" in stuck["trouble"]
        assert "defect of the lab" in stuck["trouble"]
        session.set(fault="none")
        session.command("reset")
        assert stream.next("status", lambda s: not s["trouble"] and s["t"] > 0.1)


def test_a_slow_lab_slows_time_down_and_says_so(shared_server: ServerProcess) -> None:
    slow = {"fault": "slow"}
    with shared_server.session("troublesome", params=slow) as session, session.stream() as stream:
        status = stream.next("status", lambda s: s["capped"])
        assert status["real_time_factor"] < 0.5


def test_a_slow_reader_slows_nobody_and_grows_nothing(shared_server: ServerProcess) -> None:
    with (
        shared_server.session("joint-control") as session,
        session.stream(max_queue=1) as lazy,
        session.stream() as brisk,
    ):
        lazy.next("status")
        web = psutil.Process(shared_server.process.pid)
        brisk.next("status", lambda s: s["t"] > 1)
        memory = web.memory_info().rss
        times = [row[0] for row in brisk.next("telemetry")["rows"]]
        while times[-1] < times[0] + 6:
            times += [row[0] for row in brisk.next("telemetry")["rows"]]
        assert np.diff(times) == pytest.approx(np.full(len(times) - 1, 0.01), abs=1e-4)
        assert web.memory_info().rss - memory < 10e6
        # Reading again, the lazy one is told the present, not the past.
        lazy.next("telemetry", lambda m: m["rows"] and m["rows"][-1][0] > times[-1] - 1)


def test_the_session_limit_is_told_in_words(single_place_server: ServerProcess) -> None:
    with single_place_server.session("oscillator"):
        answer = single_place_server.http.post("/api/sessions", json={"lab": "oscillator"})
        assert answer.status_code == 503
        assert answer.json()["code"] == "full"
        assert "all 1 places are taken" in answer.json()["error"]


def test_idle_sessions_end(short_timeout_server: ServerProcess) -> None:
    opened = short_timeout_server.http.post("/api/sessions", json={"lab": "oscillator"}).json()
    wait_until(
        lambda: short_timeout_server.http.get(f"/api/sessions/{opened['id']}").status_code == 404
    )
    with short_timeout_server.session("oscillator") as session, session.stream() as stream:
        notice = stream.next("notice")
        assert notice["state"] == "ended"
        assert "same parameters" in notice["text"]
    wait_until(lambda: short_timeout_server.health()["sessions"] == 0)


def test_ended_sessions_leave_no_process(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator"):
        pass
    wait_until(lambda: shared_server.health()["sessions"] == 0)
    # The fork server, the resource tracker and the spare remain.
    wait_until(lambda: shared_server.health()["workers"] == shared_server.health()["spares"] == 1)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_no_process_survives_the_server(
    single_place_server: ServerProcess, how: signal.Signals
) -> None:
    server = single_place_server
    answer = server.http.post("/api/sessions", json={"lab": "troublesome"}).json()
    path = f"/api/sessions/{answer['id']}/params"
    wait_until(lambda: server.health()["workers"] == 2)
    below = server.workers()
    assert len(below) >= 3
    # One of the workers is stuck in an endless loop when the server goes.
    server.http.patch(path, json={"fault": "hang"})
    server.stop(how)
    assert not psutil.wait_procs(below, timeout=10)[1], "these survived"
    assert server.process.stdout is not None
    printed = server.process.stdout.read()
    if server.starts > 1:  # of these cases the second at the latest
        assert printed == "", "all was compiled before"


def test_the_first_start_may_take_its_time(tmp_path: Path) -> None:
    """Longer than a hung worker is given, and than a session nobody watches."""
    prepared = tmp_path / "prepared"
    with (
        ServerProcess(
            wait=False,
            PREPARED_BY=str(prepared),
            ORCLAB_HANG_SECONDS="1",
            ORCLAB_VIEWERLESS_SECONDS="3",
        ) as server,
        ThreadPoolExecutor() as pool,
    ):
        assert server.health()["preparing"]
        opening = pool.submit(SessionClient.new, server, "oscillator", {})
        wait_until(lambda: server.health()["sessions"] == 1)
        asked = time.monotonic()
        assert server.process.stdout is not None
        assert server.process.stdout.readline().startswith("First start: compiling the solvers")
        wait_until(lambda: time.monotonic() > asked + 4)
        assert server.health()["preparing"]
        prepared.touch()
        with opening.result().stream() as stream:
            assert stream.next("status", lambda s: s["t"] > 0)
            assert not server.health()["preparing"]


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_a_server_that_still_prepares_ends_at_once(how: signal.Signals, tmp_path: Path) -> None:
    server = ServerProcess(wait=False, PREPARED_BY=str(tmp_path / "never"))
    assert server.process.stdout is not None
    assert server.process.stdout.readline().startswith("First start")
    below = server.workers()
    assert below
    server.stop(how)
    assert not psutil.wait_procs(below, timeout=10)[1], "these survived"


def test_a_restarted_server_answers_404_for_the_old_session(
    single_place_server: ServerProcess,
) -> None:
    old = single_place_server.http.post("/api/sessions", json={"lab": "oscillator"}).json()
    below = single_place_server.workers()
    single_place_server.stop(signal.SIGINT)
    assert not psutil.wait_procs(below, timeout=10)[1], "these survived"
    single_place_server.start(wait=False)
    assert single_place_server.http.get(f"/api/sessions/{old['id']}").status_code == 404


def test_a_server_ends_quietly_though_its_viewers_worker_is_stuck(
    single_place_server: ServerProcess,
) -> None:
    """The scenes' relays wait for a worker that does not even close its connections."""
    assert single_place_server.stderr is not None
    said = Path(single_place_server.stderr.name)
    before = said.stat().st_size
    (worker,) = single_place_server.listeners()  # the spare, which the session takes
    session = SessionClient.new(single_place_server, "oscillator", {})
    viewers = [SceneClient(session) for _ in range(5)]
    os.kill(worker, signal.SIGSTOP)
    single_place_server.stop()
    for viewer in viewers:
        viewer.socket.close()
    text = said.read_bytes()[before:].decode()
    assert "Traceback" not in text
    assert "Exception" not in text
