"""Who may ask, and how much."""

import ipaddress
import socket
from typing import Any

import pytest
from fastapi.testclient import TestClient
from pydantic import ValidationError
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from server.app import create_app
from server.serving import host_addresses
from server.settings import Settings
from tests.server_process import ServerProcess


def test_other_origins_may_not_change_anything(shared_server: ServerProcess) -> None:
    answer = shared_server.http.post(
        "/api/sessions", json={"lab": "oscillator"}, headers={"origin": "http://evil.example"}
    )
    assert answer.status_code == 403
    assert answer.json()["code"] == "wrong-origin"


def test_the_own_origin_may(shared_server: ServerProcess) -> None:
    answer = shared_server.http.post(
        "/api/sessions", json={"lab": "oscillator"}, headers={"origin": shared_server.address}
    )
    assert answer.status_code == 201
    shared_server.http.delete(f"/api/sessions/{answer.json()['id']}")


def test_a_rebound_name_is_refused(shared_server: ServerProcess) -> None:
    answer = shared_server.http.get("/", headers={"host": "evil.example"})
    assert answer.status_code == 403
    assert answer.json()["code"] == "wrong-host"


@pytest.mark.parametrize("path", ["stream", "scene"])
def test_other_origins_may_open_no_websocket(shared_server: ServerProcess, path: str) -> None:
    with shared_server.session("oscillator") as session:
        end = session.info["stream"] if path == "stream" else session.info["scene"].rstrip("/")
        address = shared_server.address.replace("http", "ws") + end
        with pytest.raises(InvalidStatus) as refused:
            connect(address, origin="http://evil.example", subprotocols=["viser-v1.1.1"])  # type: ignore[arg-type,list-item]
        assert refused.value.response.status_code == 403


def test_a_worker_answers_no_web_page(shared_server: ServerProcess) -> None:
    """Past the proxy, on the worker's own port, any Origin is refused."""
    with shared_server.session("oscillator"):
        ports = {port for _, port in shared_server.listeners().values()}
        assert ports
        for port in ports:
            with pytest.raises(InvalidStatus) as refused:
                connect(
                    f"ws://127.0.0.1:{port}",
                    origin=shared_server.address,  # type: ignore[arg-type]
                    subprotocols=["viser-v1.1.1"],  # type: ignore[list-item]
                )
            assert refused.value.response.status_code == 403


def test_workers_listen_on_loopback_only(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator"):
        assert {address for address, _ in shared_server.listeners().values()} == {"127.0.0.1"}


def test_a_huge_body_is_not_read(shared_server: ServerProcess) -> None:
    answer = shared_server.http.post("/api/sessions", content=b"x" * 100_000)
    assert answer.status_code == 413
    assert "65536" in answer.json()["error"]


def test_a_huge_body_of_unknown_length_is_not_read(shared_server: ServerProcess) -> None:
    parts = (b"x" * 1000 for _ in range(100))
    answer = shared_server.http.post("/api/sessions", content=parts)
    assert answer.status_code == 413


# Behind a proxy -------------------------------------------------------------------------------

PREFIX = "/user/student/proxy/8301"


def client_without_workers(**settings: Any) -> TestClient:
    """A client of an application without workers."""
    return TestClient(create_app(Settings(**settings)), base_url="http://127.0.0.1")


def test_a_prefix_may_be_taken_away_by_the_proxy_or_not() -> None:
    client = client_without_workers(root_path=f"{PREFIX}/")
    for prefix in ("", PREFIX):
        page = client.get(f"{prefix}/labs/oscillator")
        assert page.status_code == 200
        assert 'href="../static/css/base.css"' in page.text
        assert client.get(f"{prefix}/static/css/base.css").status_code == 200
        assert client.get(f"{prefix}/api/labs").status_code == 200
    assert client.get(f"{PREFIX}x/labs/oscillator").status_code == 404
    assert client.get("/labs/a%2fb").status_code == 404


def test_the_name_a_proxy_gives_has_to_be_named() -> None:
    hub = {"host": "hub.example"}
    refused = client_without_workers().get("/healthz", headers=hub)
    assert refused.status_code == 403
    assert "ORCLAB_ORIGINS" in refused.json()["error"]
    client = client_without_workers(origins=("https://hub.example",))
    page = client.get("/labs/oscillator", headers=hub)
    assert page.status_code == 200
    assert "wss://hub.example" in page.headers["content-security-policy"]
    own = {"host": "127.0.0.1:8000"}  # a proxy that says so
    for headers in (hub, own):
        # Allowed to ask: what is asked for is none.
        asked = client.post("/api/none", headers=headers | {"origin": "https://hub.example"})
        assert asked.status_code == 404
    assert client.get("/", headers={"host": "evil.example"}).status_code == 403


@pytest.mark.parametrize(
    "wrong",
    [
        {"root_path": "user/student"},
        {"root_path": "/user/../x y"},
        {"root_path": "/<b>"},
        {"origins": ("hub.example",)},
        {"origins": ("http://[",)},
        {"origins": ("https://hub.example/path",)},
    ],
)
def test_what_is_no_address_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Settings(**wrong)


def test_who_listens_to_all_prints_what_others_open(monkeypatch: pytest.MonkeyPatch) -> None:
    assert host_addresses("127.0.0.1") == ["127.0.0.1"]
    assert host_addresses("::1") == ["[::1]"]
    monkeypatch.setattr(socket, "gethostname", lambda: "desk")
    own, *others = host_addresses("0.0.0.0")
    assert own == "127.0.0.1"
    assert others[-1] == "desk"
    for other in others[:-1]:
        assert not ipaddress.ip_address(other).is_loopback
