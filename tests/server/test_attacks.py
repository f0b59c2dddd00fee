"""What a hostile, broken or sleeping peer does, and what stays as it was."""

import json
import os
import signal
import socket
import tempfile
import time
from pathlib import Path

import psutil
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from server.scratch import MIN_AGE, scratch_folder
from tests.server_process import ServerProcess, SessionClient, wait_until
from tests.viser_client import SceneClient


def send_raw(server: ServerProcess, *parts: bytes, close: bool = True) -> bytes:
    """Says this, as it is, on a connection of its own; what is answered until it closes."""
    host, port = server.address.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=20) as connection:
        for part in parts:
            connection.sendall(part)
        if close:
            connection.shutdown(socket.SHUT_WR)
        answer = b""
        while part := connection.recv(65536):
            answer += part
    return answer


def read_to_end(socket: Connection) -> None:
    """Reads until it closes."""
    while True:
        socket.recv(timeout=20)


def stderr_since(server: ServerProcess, before: int) -> str:
    """What stood on its stderr since then."""
    assert server.stderr is not None
    return Path(server.stderr.name).read_bytes()[before:].decode()


def length_of_stderr(server: ServerProcess) -> int:
    assert server.stderr is not None
    return Path(server.stderr.name).stat().st_size


# Requests -------------------------------------------------------------------------------------


@pytest.mark.parametrize("origin", ["http://[", "http://[::1", "//", "null", "\u00e9", "x" * 5000])
def test_an_origin_that_is_none_is_refused(shared_server: ServerProcess, origin: str) -> None:
    headers = {b"origin": origin.encode()}
    answer = shared_server.http.post("/api/sessions", json={"lab": "oscillator"}, headers=headers)
    assert answer.status_code == 403
    assert "ORCLAB_ORIGINS" in answer.json()["error"]
    address = shared_server.address.replace("http", "ws")
    with pytest.raises(InvalidStatus) as refused:
        connect(f"{address}/api/sessions/x/stream", origin=origin)  # type: ignore[arg-type]
    assert refused.value.response.status_code == 403
    assert "ORCLAB_ORIGINS" in json.loads(refused.value.response.body or b"")["error"]


@pytest.mark.parametrize("length", ["\u00b2", "9" * 5000, "-1", "1e3", "0x10", ""])
def test_a_length_that_is_none_is_refused(shared_server: ServerProcess, length: str) -> None:
    request = f"POST /api/sessions HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: {length}\r\n\r\n"
    answer = send_raw(shared_server, request.encode("latin-1"))
    assert answer.split()[1] in (b"400", b"413")


def test_every_answer_is_guarded_and_head_is_get_without_its_body(
    shared_server: ServerProcess,
) -> None:
    with shared_server.session("oscillator") as session:
        paths = ["/", "/labs/joint-control", "/labs/none", "/docs", "/openapi.json", "/healthz"]
        paths += ["/api/labs", "/api/none", "/static/js/lab.js", "/static/none", session.path]
        paths += ["/favicon.ico", session.info["scene"], "/scene/none/", f"{session.path}/command"]
        for path in paths:
            whole = shared_server.http.get(path)
            head = shared_server.http.head(path)
            assert head.content == b""
            assert head.status_code == whole.status_code, path
            assert ("content-length" in head.headers) == ("content-length" in whole.headers)
            for headers in (whole.headers, head.headers):
                assert headers["x-content-type-options"] == "nosniff"
                assert headers["referrer-policy"] == "same-origin"
                assert "frame-ancestors 'self'" in headers["content-security-policy"]
    refused = shared_server.http.get("/", headers={"host": "evil.example"})
    assert refused.headers["x-content-type-options"] == "nosniff"
    answer = shared_server.http.request("TRACE", "/")
    assert answer.status_code == 405
    assert answer.headers["x-content-type-options"] == "nosniff"


def test_answers_of_the_protocol_are_guarded(single_place_server: ServerProcess) -> None:
    """No HTTP, no handshake, no WebSocket there, or none for whom asks; and each says why."""
    key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="
    before = length_of_stderr(single_place_server)
    with single_place_server.session("oscillator") as session:
        scene, stream = session.info["scene"].rstrip("/"), session.info["stream"]
        handshakes = {
            "sec-websocket-key": (stream, "Sec-WebSocket-Key: short", "GET", 400),
            "line too long": (stream, f"{key}\r\nX: {'x' * 10_000}", "GET", 400),
            "method": (stream, key, "POST", 400),
            "ORCLAB_ORIGINS": (stream, f"{key}\r\nOrigin: http://evil.example", "GET", 403),
            "at this address": ("/none", key, "GET", 403),
            "open its page": (scene, key, "GET", 403),
        }
        answers = {"Invalid HTTP": (send_raw(single_place_server, b"no HTTP at all\r\n\r\n"), 400)}
        for why, (path, more, method, status) in handshakes.items():
            hello = (
                f"{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n"
                f"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n{more}\r\n\r\n"
            )
            answers[why] = send_raw(single_place_server, hello.encode(), close=False), status
    for why, (answer, status) in answers.items():
        head, _, body = answer.decode().partition("\r\n\r\n")
        assert head.startswith(f"HTTP/1.1 {status} "), (why, head)
        assert why.lower() in body.lower(), (why, body)
        for header in ("x-content-type-options: nosniff", "referrer-policy: same-origin"):
            assert header in head.lower(), why
        assert "frame-ancestors 'self'" in head, why
    complaints = stderr_since(single_place_server, before)
    assert "ERROR" not in complaints, complaints
    assert "Traceback" not in complaints, complaints


def test_what_a_peer_breaks_off_is_told_in_a_line(single_place_server: ServerProcess) -> None:
    """Half an upload, a broken chunk, a frame that is none, letters that are none: no traceback."""
    before = length_of_stderr(single_place_server)
    with single_place_server.session("oscillator") as session, session.stream() as stream:
        put = f"PUT {session.path}/solution HTTP/1.1\r\nHost: 127.0.0.1\r\n".encode()
        send_raw(single_place_server, put + b"Content-Length: 1000\r\n\r\n" + b"x" * 10)
        send_raw(single_place_server, put + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n")
        send_raw(single_place_server, put + b"Transfer-Encoding: chunked\r\n\r\n5\r\nab")
        post = b"POST /api/sessions HTTP/1.1\r\nHost: 127.0.0.1\r\n"
        send_raw(single_place_server, post + b"Transfer-Encoding: chunked\r\n\r\n5\r\nabcdeXX")
        send_raw(single_place_server, post + b"Content-Length: 1000\r\n\r\n{")
        send_raw(single_place_server, b"\x16\x03\x01 no HTTP at all\r\n\r\n")
        for path in (session.info["stream"], session.info["scene"].rstrip("/")):
            for frame in (b"\x81\x83\x00\x00\x00\x00\xff\xfe\xfd", b"\xff" * 40, b"\x80\x80" * 9):
                hello = (
                    f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n"
                    "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
                    "Sec-WebSocket-Protocol: viser-v1.1.1\r\n\r\n"
                )
                send_raw(single_place_server, hello.encode(), frame, close=True)
        assert stream.next("status")
        assert single_place_server.http.get(session.path).json()["state"] == "live"
    text = stderr_since(single_place_server, before)
    assert "Traceback" not in text, text
    assert "LocalProtocolError" not in text or "broken" in text
    assert len(text.splitlines()) < 30


def test_a_message_too_large_ends_its_connection_alone(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session, session.stream() as healthy:
        with session.stream() as stream:
            stream.socket.send("x" * (2**20 + 1))
            with pytest.raises(ConnectionClosed):
                stream.next("answer")
        scene = SceneClient(session)
        scene.socket.send(b"x" * (2**20 + 1))
        with pytest.raises(ConnectionClosed):
            read_to_end(scene.socket)
        assert healthy.next("status")


# The machine ----------------------------------------------------------------------------------


def test_out_of_descriptors_is_a_refusal_and_passes(single_place_server: ServerProcess) -> None:
    """No session leaks: afterwards its place is free."""
    before = length_of_stderr(single_place_server)
    web = psutil.Process(single_place_server.process.pid)
    soft, hard = web.rlimit(psutil.RLIMIT_NOFILE)
    with single_place_server.session("oscillator"):  # takes the spare
        pass
    wait_until(
        lambda: (
            single_place_server.health()["sessions"] == 0
            and single_place_server.health()["spares"] == 1
        )
    )
    single_place_server.http.get("/healthz")
    for free in range(-2, 6):  # the step at which it runs out differs
        try:
            web.rlimit(psutil.RLIMIT_NOFILE, (web.num_fds() + free, hard))
            answer = single_place_server.http.post("/api/sessions", json={"lab": "oscillator"})
            if answer.status_code == 201:  # the spare; the next has none
                single_place_server.http.delete(f"/api/sessions/{answer.json()['id']}")
            else:
                assert answer.status_code == 503
                assert "try again" in answer.json()["error"]
        finally:
            web.rlimit(psutil.RLIMIT_NOFILE, (soft, hard))
        wait_until(lambda: single_place_server.health()["sessions"] == 0)
    with single_place_server.session("oscillator") as session:
        assert session.info["state"] == "live"
    assert "Traceback" not in stderr_since(single_place_server, before)


def test_a_full_disk_is_told_in_a_sentence(single_place_server: ServerProcess) -> None:
    """Files may have no byte: as on a full disk, but told by EFBIG."""
    before = length_of_stderr(single_place_server)
    web = psutil.Process(single_place_server.process.pid)
    with single_place_server.session("oscillator") as session:
        soft, hard = web.rlimit(psutil.RLIMIT_FSIZE)
        try:
            web.rlimit(psutil.RLIMIT_FSIZE, (0, hard))
            answer = single_place_server.http.put(f"{session.path}/solution", content=b"x" * 10_000)
        finally:
            web.rlimit(psutil.RLIMIT_FSIZE, (soft, hard))
        assert answer.status_code == 503
        assert "no room" in answer.json()["error"]
        assert single_place_server.http.get(session.path).json()["state"] == "live"
    assert "Traceback" not in stderr_since(single_place_server, before)


def test_a_suspended_server_ends_no_session(shared_server: ServerProcess) -> None:
    """The machine sleeps for longer than a hung worker is given: the run goes on."""
    with shared_server.session("oscillator") as session, session.stream() as stream:
        wait_until(lambda: shared_server.health()["spares"] == 1)
        before = stream.next("status", lambda s: s["t"] > 0.1)
        processes = [psutil.Process(shared_server.process.pid), *shared_server.workers()]
        for process in processes:
            process.send_signal(signal.SIGSTOP)
        time.sleep(4.0)
        for process in processes:
            process.send_signal(signal.SIGCONT)
        after = stream.next("status", lambda s: s["t"] > before["t"] + 1.5)
        assert after["run"] == before["run"]
        assert after["t"] < before["t"] + 4.0, "what was slept through is not caught up with"
        assert set(shared_server.workers()) <= set(processes)


def test_viewers_hear_that_the_server_stops(single_place_server: ServerProcess) -> None:
    opened = SessionClient.new(single_place_server, "oscillator", {})
    with opened.stream() as stream:
        stream.next("status")
        single_place_server.process.send_signal(signal.SIGINT)
        notice = stream.next("notice")
        assert notice["state"] == "recovering"
        assert "goes on by itself" in notice["text"]
        with pytest.raises(ConnectionClosed):
            stream.next("answer")
    single_place_server.stop()


def test_what_a_killed_server_left_is_swept(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    old = time.time() - MIN_AGE - 10
    names = ("orclab-left", "orclab-young", "other")
    for name in names:
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").touch()
        os.utime(tmp_path / name, (old, old))
    os.utime(tmp_path / "orclab-young")
    (tmp_path / "orclab-link").symlink_to(tmp_path / "other")
    with scratch_folder() as used:
        os.utime(used, (old, old))
        with scratch_folder() as another:
            assert used.is_dir(), "in use"
            assert another != used
    assert {path.name for path in tmp_path.iterdir()} == {"orclab-young", "orclab-link", "other"}
    assert (tmp_path / "other" / "file").exists()


def test_a_huge_json_number_costs_nothing(shared_server: ServerProcess) -> None:
    """Ten thousand digits, deep lists, a thousand names: all within the size of a body."""
    bodies = [
        '{"lab": "oscillator", "seed": ' + "9" * 60_000 + "}",
        '{"lab": "oscillator", "params": {"omega": ' + "9" * 60_000 + "}}",
        '{"lab": "oscillator", "params": {"omega": 1e' + "9" * 60_000 + "}}",
        "[" * 60_000,
        '{"a":' * 10_000,
        json.dumps({"lab": "oscillator", "params": {f"p{i}": 0 for i in range(1000)}}),
    ]
    for body in bodies:
        answer = shared_server.http.post(
            "/api/sessions", content=body, headers={"content-type": "application/json"}
        )
        assert 400 <= answer.status_code < 500, body[:40]
        assert answer.elapsed.total_seconds() < 20
        assert len(answer.text) < 1000
    link = {"omega": "9" * 60_000}  # left out and named: a link keeps what it can
    with shared_server.session("oscillator", link=link) as session:
        (remark,) = session.info["remarks"]
        assert "omega" in remark
        assert len(remark) < 200
    with shared_server.session("oscillator") as session, session.stream() as stream:
        for body in bodies:
            stream.socket.send(body)
            assert stream.next("answer")["error"]
