"""The README tells the truth: its commands, its Python, its example lab, its settings and keys."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from labs.engine.catalog import catalog
from labs.engine.headless import run_headless
from labs.engine.run import World
from server.articles import render
from server.cli import main
from server.settings import Settings
from tests.labs.contract import check_world, extreme_values

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """The fenced blocks of the README in a language; longer fences may hold shorter ones."""
    pattern = rf"^(`{{3,}}){language}\n(.*?)^\1$"
    return [block for _, block in re.findall(pattern, README, flags=re.M | re.S)]


def section(title: str) -> str:
    """A section of the README."""
    return re.split(r"^## ", README.split(f"\n## {title}\n")[1], flags=re.M)[0]


def test_start_and_test_take_one_line_each() -> None:
    for title in ("Getting started", "Testing"):
        (line,) = re.findall(r"```sh\n(.*?)\n```", section(title), flags=re.S)
        assert "\n" not in line
        assert line.startswith("python3 -m venv .venv && .venv/bin/pip install -q ")


def test_ci_runs_the_test_command_of_the_readme() -> None:
    path = ROOT / ".ci" / "run"
    (line,) = re.findall(r"```sh\n(.*?)\n```", section("Testing"), flags=re.S)
    assert path.read_text().rstrip().endswith(f"\n{line}")
    assert os.access(path, os.X_OK)
    subprocess.run(["bash", "-n", str(path)], check=True)


def test_the_commands_of_the_readme_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    commands = [shlex.split(line)[1:] for line in lines if line.startswith("orclab ")]
    assert len(commands) == 4
    for command in commands:
        assert main(command) == 0, capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == {
        "run.npz",
        "run.json",
        "again.csv",
        "again.about.json",
    }


def test_the_python_of_the_readme_runs(tmp_path: Path) -> None:
    headless, gymnasium, peer, _ = blocks("python")
    compile(peer, "README.md", "exec")
    example = headless + gymnasium
    expected = re.findall(r"# (\(\d+,[ \d]*\))", example)
    result = subprocess.run(
        [sys.executable, "-c", example],
        check=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert result.stdout.splitlines() == expected


def test_the_lab_of_the_readme_is_a_lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "readme_course"
    folder.mkdir()
    (folder / "__init__.py").write_text("NUMBER = '1'\nTITLE = 'From the README'\n")
    (folder / "spring").mkdir()
    (folder / "spring" / "lab.py").write_text(blocks("python")[3])
    (folder / "spring" / "article.md").write_text(blocks("markdown")[0])
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("ORCLAB_LABS", "readme_course")
    catalog.cache_clear()
    try:
        entry = catalog()["spring"]
        for name, value in extreme_values(entry):
            check_world(run_headless("spring", {name: value}, seconds=2.0))
        (experiment,) = render(entry).experiments
        critical = (
            run_headless("spring", experiment.settings, seconds=3.0).recording().channels["x"]
        )
        assert (critical > -1e-3).all(), "critically damped, it does not swing over"
        assert abs(critical[-1]) < 1e-3
        check_world(World(entry))
    finally:
        catalog.cache_clear()
    style = [
        "ruff",
        "check",
        "--isolated",
        "--line-length",
        "100",
        str(folder / "spring" / "lab.py"),
    ]
    subprocess.run([sys.executable, "-m", *style], check=True)


def test_the_readme_lists_every_setting_with_its_default() -> None:
    rows = dict(
        re.findall(r"^\| `(ORCLAB_\w+)` \| `?([^`|]*?)`?\s*\|", section("Configuration"), re.M)
    )
    defaults = {
        f"ORCLAB_{name.upper()}": field.default for name, field in Settings.model_fields.items()
    }
    assert set(rows) == {*defaults, "ORCLAB_LABS"}
    for name, default in defaults.items():
        if name == "ORCLAB_ORIGINS":
            assert (rows[name], default) == ("[]", ())
        else:
            assert type(default)(rows[name]) == default, name


def test_the_readme_names_the_keys_the_help_names() -> None:
    text = (ROOT / "static" / "templates" / "help.html").read_text(encoding="utf-8")
    helped = [
        (re.sub(r"<[^>]+>", "", keys).strip(), re.sub(r"<[^>]+>", "", does).strip())
        for keys, does in re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", text)
    ]
    told = re.findall(r"^\| `?([^|`]+?)`? \| ([^|]+?) \|$", section("Usage"), re.M)
    told = [(keys, does) for keys, does in told if keys not in ("Key", "---")]
    assert len(told) > 8
    assert [keys for keys, _ in told] == [keys for keys, _ in helped if keys != "Esc"]


def test_the_changelog_has_this_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert f"\n## {project['version']}\n" in (ROOT / "CHANGELOG.md").read_text()
