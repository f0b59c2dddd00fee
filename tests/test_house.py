"""The rules of the house, and that the README tells the truth."""

import ast
import importlib
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from labs.engine.catalog import catalog
from labs.engine.headless import run
from labs.engine.run import World
from server.articles import render
from server.cli import main
from server.settings import Settings
from tests.labs.test_contract import check, extremes

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
OWN = {"labs", "server", "static", "tests"}
WEB = {"server", "static", "tests", "fastapi", "starlette", "uvicorn", "websockets", "viser"}


def sources(*folders: str) -> list[Path]:
    """All Python modules of these folders."""
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))


def texts(*folders: str) -> list[Path]:
    """All text files of these folders."""
    found = (path for folder in folders for path in (ROOT / folder).rglob("*") if path.is_file())
    binary = {".webp", ".png", ".ttf"}
    return sorted(p for p in found if p.suffix not in binary and p.parent.name != "__pycache__")


def name_of(path: Path) -> str:
    """Of a file, as tests show it."""
    return str(path.relative_to(ROOT))


def imported(path: Path) -> Iterator[str]:
    """The packages a module imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name_of(path)}: imports are absolute"
            yield (node.module or "").split(".")[0]


# Who knows whom -------------------------------------------------------------------------------


@pytest.mark.parametrize("path", sources("labs"), ids=name_of)
def test_labs_import_nothing_of_the_web(path: Path) -> None:
    assert not WEB & set(imported(path))


def test_all_labs_together_load_nothing_of_the_web() -> None:
    """Also through what they import."""
    modules = [
        name_of(path).removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        for path in sources("labs")
    ]
    script = (
        "import importlib, sys\n"
        "for name in sys.argv[1:]: importlib.import_module(name)\n"
        "print(*{name.split('.')[0] for name in sys.modules})"
    )
    result = subprocess.run(
        [sys.executable, "-c", script, *modules],
        check=True,
        cwd=ROOT,
        env={k: v for k, v in os.environ.items() if k != "ORCLAB_LABS"},
        stdout=subprocess.PIPE,
        text=True,
    )
    loaded = set(result.stdout.split())
    assert "labs" in loaded
    assert not WEB & loaded


@pytest.mark.parametrize("path", sources("server"), ids=name_of)
def test_the_server_knows_no_particular_lab(path: Path) -> None:
    chapters = {entry.package for entry in catalog().values()}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            assert not any(node.module.startswith(chapter) for chapter in chapters)
    assert not any(f'"{slug}"' in path.read_text(encoding="utf-8") for slug in catalog())


def test_what_is_imported_is_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    declared = {need.split("==")[0].lower() for need in project["dependencies"]}
    # Parts of declared packages that are public under names of their own.
    declared |= {"starlette", "markupsafe", "pydantic-core"}
    owners = packages_distributions()
    for path in sources("labs", "server"):
        for package in set(imported(path)) - set(sys.stdlib_module_names) - OWN:
            # A namespace package may have several distributions. Pinocchio's wheel keeps its
            # modules in a folder of its own, where nobody looks for owners.
            owning = owners.get(package, {"pinocchio": ["pin"]}.get(package, []))
            names = {name.lower().replace("_", "-") for name in owning}
            assert names & declared, f"{name_of(path)} imports {package} of {names}"


# Dependencies ---------------------------------------------------------------------------------


def test_direct_dependencies_are_pinned() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for need in (*project["dependencies"], *project["optional-dependencies"]["test"]):
        assert re.fullmatch(r"[A-Za-z0-9-]+==[0-9.]+", need), need


def test_every_dependency_says_why_it_is_there() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if re.match(r' +"[^"]+==', line)]
    assert len(lines) > 20
    for line in lines:
        assert re.search(r'",\s+# \w.{3,}', line), line


# Files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", texts("labs", "server", "static", "tests", ".ci"), ids=name_of)
def test_a_file_names_no_place_outside(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    private = re.findall(r"(?<![\w.])/(?:home|Users|root|work)/\w+", text)
    assert not private, f"paths of one machine: {private}"
    if name_of(path).startswith(("labs", "server", "static")):
        # Format strings build the server's own address; w3.org names XML namespaces.
        here = r"\{|www\.w3\.org/|127\.0\.0\.1|localhost"
        addresses = re.findall(rf"\b(?:https?|wss?)://(?!{here})[\w.-]+", text)
        assert not addresses, f"a page that loads from elsewhere: {addresses}"


@pytest.mark.parametrize("path", sources("labs", "server", "tests"), ids=name_of)
def test_a_module_says_what_it_is(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    if text.strip():  # a package that only holds others says nothing
        assert ast.get_docstring(ast.parse(text))


@pytest.mark.parametrize("path", sources("labs"), ids=name_of)
def test_public_names_are_documented(path: Path) -> None:
    """Modules' functions and classes; methods that do not fulfil the contract of a base."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name[0] != "_":
            assert ast.get_docstring(node), f"{node.name} has no docstring"


def test_a_module_can_be_read_in_one_go() -> None:
    for path in sources("labs", "server"):
        lines = len(path.read_text(encoding="utf-8").splitlines())
        most = 350 if path.name == "lab.py" else 300
        assert lines <= most, f"{name_of(path)} has {lines} lines, {most} at most: split it"


def test_every_lab_has_an_article_and_every_article_a_lab() -> None:
    for package in {entry.package for entry in catalog().values()}:
        chapter = Path(importlib.import_module(package).__path__[0])
        labs = {path.parent for path in chapter.glob("*/lab.py")}
        assert {path.parent for path in chapter.glob("*/article.md")} == labs, chapter.name
        assert labs <= {entry.folder for entry in catalog().values()}


# The README -----------------------------------------------------------------------------------


def blocks(language: str) -> list[str]:
    """The fenced blocks of the README in a language; longer fences may hold shorter ones."""
    pattern = rf"^(`{{3,}}){language}\n(.*?)^\1$"
    return [block for _, block in re.findall(pattern, README, flags=re.M | re.S)]


def section(title: str) -> str:
    """A section of the README."""
    return re.split(r"^## ", README.split(f"\n## {title}\n")[1], flags=re.M)[0]


def test_start_and_test_take_one_line_each() -> None:
    for title in ("Start", "Test"):
        (line,) = re.findall(r"```sh\n(.*?)\n```", section(title), flags=re.S)
        assert "\n" not in line
        assert line.startswith("python3 -m venv .venv && .venv/bin/pip install -q ")


def test_ci_runs_the_test_command_of_the_readme() -> None:
    path = ROOT / ".ci" / "run"
    (line,) = re.findall(r"```sh\n(.*?)\n```", section("Test"), flags=re.S)
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
    assert {path.name for path in tmp_path.iterdir()} == {"run.npz", "run.json", "again.csv"}


def test_the_python_of_the_readme_runs(tmp_path: Path) -> None:
    example = blocks("python")[0]
    (expected,) = re.findall(r"# (\(\d+, \d+\))", example)
    result = subprocess.run(
        [sys.executable, "-c", example],
        check=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert result.stdout.strip() == expected


def test_the_lab_of_the_readme_is_a_lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "readme_course"
    folder.mkdir()
    (folder / "__init__.py").write_text("NUMBER = '1'\nTITLE = 'From the README'\n")
    (folder / "spring").mkdir()
    (folder / "spring" / "lab.py").write_text(blocks("python")[1])
    (folder / "spring" / "article.md").write_text(blocks("markdown")[0])
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("ORCLAB_LABS", "readme_course")
    catalog.cache_clear()
    try:
        entry = catalog()["spring"]
        for name, value in extremes(entry):
            check(run("spring", {name: value}, seconds=2.0))
        (experiment,) = render(entry).experiments
        critical = run("spring", experiment.settings, seconds=3.0).recording().channels["x"]
        assert (critical > -1e-3).all(), "critically damped, it does not swing over"
        assert abs(critical[-1]) < 1e-3
        check(World(entry))
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
    rows = dict(re.findall(r"^\| `(ORCLAB_\w+)` \| `?([^`|]*?)`?\s*\|", section("Configure"), re.M))
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
    told = re.findall(r"^\| `?([^|`]+?)`? \| ([^|]+?) \|$", section("Use"), re.M)
    told = [(keys, does) for keys, does in told if keys not in ("Key", "---")]
    assert len(told) > 8
    assert [keys for keys, _ in told] == [keys for keys, _ in helped if keys != "Esc"]


def test_the_changelog_has_this_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert f"\n## {project['version']}\n" in (ROOT / "CHANGELOG.md").read_text()
