"""The wheel: what is in it, and that it works where no checkout is."""

import email
import json
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("labs", "server", "static")

# What someone does who installed the wheel, with nothing of the checkout in reach.
USE = """
import importlib, json, pkgutil, sys
from starlette.testclient import TestClient
import labs, server
from labs.engine.catalog import catalog
from server.app import create_app
from server.settings import Settings

client = TestClient(create_app(Settings()), base_url="http://127.0.0.1")  # no lifespan: no workers
home, page = client.get("/"), client.get("/labs/joint-control")
files = [client.get(path).status_code for path in sys.argv[1:]]
found = {
    "from": [labs.__file__, server.__file__],
    "slugs": list(catalog()),
    "articles": [len(entry.article) for entry in catalog().values()],
    "home": [home.status_code, home.text],
    "page": [page.status_code, page.text],
    "files": files,
}
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy, so that the checkout stays clean and leftovers of it stay out."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    for package in (*PACKAGES, "tests"):
        shutil.copytree(
            ROOT / package, source / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, source)
    arguments = ["wheel", str(source), "--no-deps", "--no-build-isolation", "-w", str(folder)]
    subprocess.run(
        [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", *arguments], check=True
    )
    (built,) = folder.glob("*.whl")
    return built


def test_the_wheel_holds_every_file_of_the_packages_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    wanted = {
        str(path.relative_to(ROOT))
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.name[0] != "."
    }
    assert names == wanted


@pytest.mark.parametrize(
    "name",
    [
        "labs/engine/catalog.py",
        "labs/reactive_control/joint_control/lab.py",
        "labs/reactive_control/joint_control/article.md",
        "server/app.py",
        "static/templates/home.html",
        "static/css/base.css",
        "static/js/lab.js",
        "static/img/icon.svg",
    ],
)
def test_the_wheel_holds(wheel: Path, name: str) -> None:
    with zipfile.ZipFile(wheel) as archive:
        assert archive.getinfo(name).file_size > 0


def test_the_wheel_carries_what_pyproject_says(wheel: Path) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    with zipfile.ZipFile(wheel) as archive:
        (folder,) = {name.split("/")[0] for name in archive.namelist() if ".dist-info/" in name}
        metadata = email.message_from_bytes(archive.read(f"{folder}/METADATA"))
        scripts = archive.read(f"{folder}/entry_points.txt").decode()
    assert metadata["Version"] == project["version"]
    needs = [need for need in metadata.get_all("Requires-Dist", []) if "extra ==" not in need]
    assert needs == project["dependencies"]
    assert "orclab = server.cli:main" in scripts


def test_the_unpacked_wheel_serves_its_pages_from_anywhere(wheel: Path, tmp_path: Path) -> None:
    site, elsewhere = tmp_path / "site", tmp_path / "elsewhere"
    elsewhere.mkdir()
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    environment = {k: v for k, v in os.environ.items() if not k.startswith("ORCLAB_")}
    paths = ["/static/js/lab.js", "/static/css/base.css", "/vendor/uplot.js", "/vendor/stix.ttf"]
    result = subprocess.run(
        [sys.executable, "-c", USE, *paths],
        check=True,
        cwd=elsewhere,
        env=environment | {"PYTHONPATH": str(site)},
        stdout=subprocess.PIPE,
        timeout=120,
    )
    found = json.loads(result.stdout)
    assert all(Path(file).is_relative_to(site) for file in found["from"])
    assert "joint-control" in found["slugs"]
    assert "oscillator" not in found["slugs"]
    assert all(length > 100 for length in found["articles"])
    assert found["home"][0] == found["page"][0] == 200
    assert 'labs/joint-control"' in found["home"][1]
    assert "Joint motion control" in found["home"][1]
    assert "<math" in found["page"][1]
    assert "Open loop drifts" in found["page"][1]
    assert found["files"] == [200] * len(paths)
