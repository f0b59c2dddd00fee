"""Who may ask, and how much."""

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from tests.served import Served


def test_other_origins_may_not_change_anything(served: Served) -> None:
    answer = served.http.post(
        "/api/sessions", json={"lab": "oscillator"}, headers={"origin": "http://evil.example"}
    )
    assert answer.status_code == 403
    assert answer.json()["code"] == "wrong-origin"


def test_the_own_origin_may(served: Served) -> None:
    answer = served.http.post(
        "/api/sessions", json={"lab": "oscillator"}, headers={"origin": served.address}
    )
    assert answer.status_code == 201
    served.http.delete(f"/api/sessions/{answer.json()['id']}")


def test_a_rebound_name_is_refused(served: Served) -> None:
    answer = served.http.get("/", headers={"host": "evil.example"})
    assert answer.status_code == 403
    assert answer.json()["code"] == "wrong-host"


@pytest.mark.parametrize("path", ["stream", "scene"])
def test_other_origins_may_open_no_websocket(served: Served, path: str) -> None:
    with served.session("oscillator") as session:
        end = session.info["stream"] if path == "stream" else session.info["scene"].rstrip("/")
        address = served.address.replace("http", "ws") + end
        with pytest.raises(InvalidStatus) as refused:
            connect(address, origin="http://evil.example", subprotocols=["viser-v1.1.1"])  # type: ignore[arg-type,list-item]
        assert refused.value.response.status_code == 403


def test_a_worker_answers_no_web_page(served: Served) -> None:
    """Past the proxy, on the worker's own port, any Origin is refused."""
    with served.session("oscillator"):
        ports = {port for _, port in served.listeners().values()}
        assert ports
        for port in ports:
            with pytest.raises(InvalidStatus) as refused:
                connect(
                    f"ws://127.0.0.1:{port}",
                    origin=served.address,  # type: ignore[arg-type]
                    subprotocols=["viser-v1.1.1"],  # type: ignore[list-item]
                )
            assert refused.value.response.status_code == 403


def test_workers_listen_on_loopback_only(served: Served) -> None:
    with served.session("oscillator"):
        assert {address for address, _ in served.listeners().values()} == {"127.0.0.1"}


def test_a_huge_body_is_not_read(served: Served) -> None:
    answer = served.http.post("/api/sessions", content=b"x" * 100_000)
    assert answer.status_code == 413
    assert "65536" in answer.json()["error"]


def test_a_huge_body_of_unknown_length_is_not_read(served: Served) -> None:
    parts = (b"x" * 1000 for _ in range(100))
    answer = served.http.post("/api/sessions", content=parts)
    assert answer.status_code == 413
