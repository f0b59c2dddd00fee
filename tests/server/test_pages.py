"""The pages stand by themselves: whole, guarded by headers, and without the network."""

import json
import re
from pathlib import Path
from urllib.parse import urljoin

import pytest
from fastapi.testclient import TestClient

from labs.engine.catalog import catalog
from server.app import create_app
from server.articles import render
from server.pages import STATIC, VENDOR, lab_data, vendor_url
from server.settings import Settings

SLUGS = list(catalog())
LAB = "joint-control"
OWN_FILES = sorted(p for p in STATIC.rglob("*") if p.suffix in {".js", ".css", ".html", ".svg"})


@pytest.fixture(scope="module")
def client() -> TestClient:
    # Without its lifespan: pages need no workers.
    return TestClient(create_app(Settings(host="0.0.0.0")))


def page_data(html: str) -> dict[str, object]:
    found = re.search(r'<script type="application/json" id="lab-data">(.*?)</script>', html, re.S)
    assert found
    data: dict[str, object] = json.loads(found[1])
    return data


def test_home_lists_every_lab_under_its_chapter(client: TestClient) -> None:
    html = client.get("/").text
    for slug, entry in catalog().items():
        assert f'href="./labs/{slug}"' in html
        assert entry.lab.title in html
        assert entry.chapter_title in html
    assert html.count('class="chapter"') == len({e.chapter for e in catalog().values()})


@pytest.mark.parametrize("slug", SLUGS)
def test_a_lab_page_reads_without_scripts(client: TestClient, slug: str) -> None:
    entry = catalog()[slug]
    html = client.get(f"/labs/{slug}").text
    assert f"<h1>{entry.lab.title}</h1>" in html
    assert render(entry).html in html
    for name, tunable in entry.lab.Params.tunables.items():
        assert f'id="param-{name}"' in html, name
        assert tunable.kind in {"knob", "choice", "toggle", "text"}


@pytest.mark.parametrize("slug", SLUGS)
def test_a_lab_page_carries_what_its_scripts_need(client: TestClient, slug: str) -> None:
    entry = catalog()[slug]
    data = page_data(client.get(f"/labs/{slug}").text)
    assert data == json.loads(json.dumps(lab_data(entry)))
    assert data["slug"] == slug
    assert data["period"] == entry.lab.period
    params = data["params"]
    assert isinstance(params, list)
    assert [p["name"] for p in params] == list(entry.lab.Params.tunables)
    assert all(p["mathml"].startswith("<math") for p in params if p["symbol"])


@pytest.mark.parametrize("slug", SLUGS)
def test_a_choice_stands_above_what_it_governs(client: TestClient, slug: str) -> None:
    """Showing and hiding what acts then moves nothing that stays, least of all the choice."""
    params = catalog()[slug].lab.Params
    rows = re.findall(r'id="param-(\w+)" (hidden)?', client.get(f"/labs/{slug}").text)
    order = [name for name, _ in rows]
    assert sorted(order) == sorted(params.tunables)
    for name, tunable in params.tunables.items():
        for choices in tunable.when:
            assert all(order.index(governor) < order.index(name) for governor in choices), name
    assert {name for name, hidden in rows if hidden} == {n for n in order if not params().acts(n)}
    keys = [name for name, tunable in params.tunables.items() if tunable.key]
    assert order[: len(keys)] == keys, "what matters first is on top"


def test_data_cannot_end_its_script_element(client: TestClient) -> None:
    html = client.get(f"/labs/{LAB}").text
    inside = html.split('id="lab-data">')[1].split("</script>")[0]
    assert "<" not in inside
    assert "\\u003cmath" in inside


@pytest.mark.parametrize("slug", ["nonsense", "<script>alert(1)</script>", "x" * 500])
def test_an_unknown_lab_gets_a_page_that_lists_those_there_are(
    client: TestClient, slug: str
) -> None:
    answer = client.get(f"/labs/{slug}")
    if "/" in slug:  # never a page of ours
        assert answer.status_code == 404
        return
    assert answer.status_code == 404
    assert "text/html" in answer.headers["content-type"]
    assert "No lab is called" in answer.text
    assert f'href="../labs/{LAB}"' in answer.text


def test_what_an_address_says_is_escaped(client: TestClient) -> None:
    assert "<b>" not in client.get("/labs/<b>x").text


@pytest.mark.parametrize("path", ["/", f"/labs/{LAB}", "/labs/nonsense"])
def test_pages_are_guarded(client: TestClient, path: str) -> None:
    headers = client.get(path).headers
    policy = headers["content-security-policy"]
    for rule in ("default-src 'self'", "script-src 'self'", "frame-ancestors 'self'"):
        assert rule in policy
    assert "base-uri 'none'" in policy
    assert "unsafe-eval" not in policy
    assert "ws://testserver" in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "same-origin"


def test_a_strange_host_does_not_reach_the_policy(client: TestClient) -> None:
    answer = client.get("/", headers={"Host": "a; script-src *"})
    assert "script-src *" not in answer.headers["content-security-policy"]


def test_pages_have_no_inline_scripts(client: TestClient) -> None:
    for path in ("/", f"/labs/{LAB}", "/labs/nonsense"):
        html = client.get(path).text
        for attributes, content in re.findall(r"<script([^>]*)>(.*?)</script>", html, re.S):
            assert "src=" in attributes or "application/json" in attributes
            assert not ("src=" in attributes and content)
        assert not re.search(r"\son\w+=", html)


def test_everything_a_page_refers_to_is_served(client: TestClient) -> None:
    for path in ("/", f"/labs/{LAB}", "/labs/nonsense"):
        html = client.get(path).text
        links = re.findall(r"""(?:src|href)="([^"#]+)""", html)
        links += re.findall(r"""url\(["']?([^"')]+)""", html)
        assert len(links) > 5
        for link in set(links):
            assert link.startswith("."), "no address leaves a proxy's prefix"
            assert client.get(urljoin(path, link)).status_code == 200, link


def test_modules_import_files_that_exist() -> None:
    for path in STATIC.rglob("*.js"):
        for target in re.findall(r'from "(\.[^"]+)"', path.read_text(encoding="utf-8")):
            assert (path.parent / target).is_file(), (path, target)


@pytest.mark.parametrize("name", VENDOR)
def test_files_from_wheels_are_served_for_long(client: TestClient, name: str) -> None:
    answer = client.get(vendor_url(name))
    assert answer.status_code == 200
    assert len(answer.content) > 1000
    assert answer.headers["content-type"].startswith(VENDOR[name][3])
    assert "immutable" in answer.headers["cache-control"]
    assert re.search(r"\?v=\d", vendor_url(name))


@pytest.mark.parametrize(
    "path",
    ["/vendor/none.js", "/static/none.css", "/static/templates/lab.html", "/static/../README.md",
     "/labs/nonsense/picture.webp", "/vendor/..%2f..%2fpages.py"],
)  # fmt: skip
def test_nothing_else_is_served(client: TestClient, path: str) -> None:
    assert client.get(path).status_code == 404


def test_own_files_are_asked_for_again(client: TestClient) -> None:
    answer = client.get("/static/css/base.css")
    assert answer.headers["cache-control"] == "no-cache"
    assert answer.headers["etag"]


@pytest.mark.parametrize("path", OWN_FILES, ids=lambda p: str(p.relative_to(STATIC)))
def test_no_file_of_ours_reaches_out(path: Path) -> None:
    """Names of XML namespaces look like addresses but are never fetched."""
    text = path.read_text(encoding="utf-8")
    found = set(re.findall(r"(?:https?:)?//[\w.-]+\.\w+[^\s\"')]*", text))
    assert all(address.startswith("http://www.w3.org/") for address in found), found


@pytest.mark.parametrize("path", ["/", f"/labs/{LAB}"])
def test_no_page_reaches_out(client: TestClient, path: str) -> None:
    assert not re.search(r'(?:src|href|action)="(?:https?:)?//', client.get(path).text)


def test_pictures_are_those_of_the_labs(client: TestClient) -> None:
    for slug, entry in catalog().items():
        answer = client.get(f"/labs/{slug}/picture.webp")
        if entry.picture is None:
            assert answer.status_code == 404
        else:
            assert answer.content == entry.picture
            assert answer.headers["content-type"] == "image/webp"


def test_the_api_is_described_without_the_network(client: TestClient) -> None:
    html = client.get("/docs").text
    assert vendor_url("swagger.js") in html
    assert "://" not in re.sub(r"http://testserver\S*", "", html)
