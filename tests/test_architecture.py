"""The architecture: who may import whom, what a file is, and how large."""

import ast
import functools
import importlib
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Set
from importlib.metadata import packages_distributions
from itertools import chain
from pathlib import Path

from labs.engine.catalog import CHAPTERS, catalog

ROOT = Path(__file__).parent.parent
OWN = {"labs", "server", "static", "tests"}
WEB = {"server", "static", "tests", "fastapi", "starlette", "uvicorn", "websockets", "viser"}
LAYERS = ("contract", "problems", "algorithms", "models", "tasks", "lab")
"""Of what labs are made of, from the bottom up. The contract are the files of `labs/` itself."""
SHARED = {"tasks", "models", "problems"}
LINES = {"lab.py": 350}
"""What a file may have at most, if not MAX_LINES."""
MAX_LINES = 300
CAMEL_CASE = re.compile(r"_?[A-Z]\w*[a-z]\w*")


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
    return path.relative_to(ROOT).as_posix()


def module_of(path: Path) -> str:
    """labs/tasks/motion/cost.py -> labs.tasks.motion.cost"""
    return name_of(path).removesuffix(".py").removesuffix("/__init__").replace("/", ".")


@functools.cache
def tree(path: Path) -> ast.Module:
    """What a file says."""
    return ast.parse(path.read_text(encoding="utf-8"))


def docstring(path: Path) -> str:
    """Of a module, in one line."""
    return " ".join((ast.get_docstring(tree(path)) or "").split())


MODULES = {module_of(path): path for path in sources("labs", "server", "tests")}


def type_names(path: Path) -> Iterator[str]:
    """The classes and types that a module defines."""
    for node in tree(path).body:
        match node:
            case (
                ast.ClassDef(name=name)
                | ast.Assign(targets=[ast.Name(id=name)])
                | ast.AnnAssign(target=ast.Name(id=name))
            ) if CAMEL_CASE.fullmatch(name):
                yield name


@functools.cache
def imported(path: Path) -> Set[str]:
    """The modules a module imports, anywhere in it."""
    return frozenset(_imported(path))


def _imported(path: Path) -> Iterator[str]:
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name_of(path)}: imports are absolute"
            package = node.module or ""
            for alias in node.names:
                module = f"{package}.{alias.name}"
                yield module if module in MODULES else package


def packages(path: Path) -> set[str]:
    """The packages a module imports, anywhere in it."""
    return {module.split(".")[0] for module in imported(path)}


# Who knows whom -------------------------------------------------------------------------------


def part_of(module: str) -> str:
    """Which part of `labs` a module belongs to: a layer, the engine, or the tasks in Gymnasium."""
    _, *inner = module.split(".")
    if ".".join(module.split(".")[:2]) in CHAPTERS:
        return "lab" if len(inner) > 1 else "contract"
    return inner[0] if len(inner) > 1 or inner[:1] in (["engine"], ["gym"]) else "contract"


def lab_of(module: str) -> str:
    """labs.appendix.integration.accuracy -> labs.appendix.integration"""
    return ".".join(module.split(".")[:3])


def test_no_merge_is_left_unresolved() -> None:
    marks = ("<" * 7 + " ", ">" * 7 + " ")
    files = [*texts("labs", "server", "static", "tests", ".ci"), *ROOT.glob("*.*")]
    left = [
        name_of(path)
        for path in files
        if path.is_file()
        and any(line.startswith(marks) for line in path.read_text("utf-8").splitlines())
    ]
    assert not left


def test_imports_go_down_and_no_lab_imports_another() -> None:
    wrong = []
    for path in sources("labs"):
        here = module_of(path)
        for there in imported(path):
            if there.split(".")[0] != "labs":
                continue
            mine, other = part_of(here), part_of(there)
            if mine == "engine":
                right = other in ("engine", "contract")
            elif mine == "gym":
                right = other not in ("engine", "lab")
            elif other in ("engine", "gym") or LAYERS.index(other) > LAYERS.index(mine):
                right = False
            else:
                right = mine != other or mine != "lab" or lab_of(here) == lab_of(there)
            if not right:
                wrong.append(f"{here} imports {there}")
    assert not wrong, "\n".join(wrong)


def reach(module: str, found: set[str]) -> set[str]:
    """All modules that a module imports, directly or not."""
    if module in MODULES and module not in found:
        found.add(module)
        for other in imported(MODULES[module]):
            reach(other, found)
    return found


def test_what_is_shared_serves_two_labs_or_one_to_come() -> None:
    """Or a lab and Gymnasium."""
    used: dict[str, set[str]] = {}
    for module in MODULES:
        if module.startswith("labs.") and part_of(module) in ("lab", "gym"):
            reach(module, used.setdefault(lab_of(module), set()))
    lonely = []
    for module, path in MODULES.items():
        if not module.startswith("labs.") or part_of(module) not in SHARED or not docstring(path):
            continue
        serves = sorted(lab for lab, modules in used.items() if module in modules)
        if len(serves) < 2 and "to come" not in docstring(path):
            lonely.append(f"{module} serves {serves} alone: move it there, or say what is to come")
    assert not lonely, "\n".join(lonely)


def test_labs_import_nothing_of_the_web() -> None:
    wrong = {name_of(path): WEB & packages(path) for path in sources("labs")}
    assert not {name: found for name, found in wrong.items() if found}


def test_all_labs_together_load_nothing_of_the_web() -> None:
    """Also through what they import."""
    script = (
        "import importlib, sys\n"
        "for name in sys.argv[1:]: importlib.import_module(name)\n"
        "print(*{name.split('.')[0] for name in sys.modules})"
    )
    result = subprocess.run(
        [sys.executable, "-c", script, *map(module_of, sources("labs"))],
        check=True,
        cwd=ROOT,
        env={k: v for k, v in os.environ.items() if k != "ORCLAB_LABS"},
        stdout=subprocess.PIPE,
        text=True,
    )
    loaded = set(result.stdout.split())
    assert "labs" in loaded
    assert not WEB & loaded


def test_the_server_knows_no_particular_lab() -> None:
    for path in sources("server"):
        text = path.read_text(encoding="utf-8")
        assert not [module for module in imported(path) if module.startswith(CHAPTERS)], path
        assert not [slug for slug in catalog() if f'"{slug}"' in text], path


def test_what_is_imported_is_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    declared = {need.split("==")[0].lower() for need in project["dependencies"]}
    # Parts of declared packages that are public under names of their own.
    declared |= {"starlette", "markupsafe", "pydantic-core"}
    gym = {need.split("==")[0].lower() for need in project["optional-dependencies"]["gym"]}
    owners = packages_distributions()
    for path in sources("labs", "server"):
        for package in packages(path) - set(sys.stdlib_module_names) - OWN:
            # A namespace package may have several distributions. Pinocchio's wheel keeps its
            # modules in a folder of its own, where nobody looks for owners.
            owning = owners.get(package, {"pinocchio": ["pin"]}.get(package, []))
            names = {name.lower().replace("_", "-") for name in owning}
            known = declared | gym if part_of(module_of(path)) == "gym" else declared
            assert names & known, f"{name_of(path)} imports {package} of {names}"


# Dependencies ---------------------------------------------------------------------------------


def test_direct_dependencies_are_pinned() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needs = [*project["dependencies"], *chain(*project["optional-dependencies"].values())]
    for need in needs:
        assert re.fullmatch(r"[A-Za-z0-9-]+==[0-9.]+", need), need
    versions = {need.split("==")[0]: need for need in needs}
    assert set(needs) == set(versions.values()), "one version of each, in all extras"


def test_every_dependency_says_why_it_is_there() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if re.match(r' +"[^"]+==', line)]
    assert len(lines) > 20
    for line in lines:
        assert re.search(r'",\s+# \w.{3,}', line), line


# Files ----------------------------------------------------------------------------------------


def test_a_file_names_no_place_outside() -> None:
    for path in texts("labs", "server", "static", "tests", ".ci"):
        text = path.read_text(encoding="utf-8")
        private = re.findall(r"(?<![\w.])/(?:home|Users|root|work)/\w+", text)
        assert not private, f"{name_of(path)}: paths of one machine: {private}"
        if name_of(path).startswith(("labs", "server", "static")):
            # Format strings build the server's own address; w3.org names XML namespaces.
            here = r"\{|www\.w3\.org/|127\.0\.0\.1|localhost"
            addresses = re.findall(rf"\b(?:https?|wss?)://(?!{here})[\w.-]+", text)
            assert not addresses, f"{name_of(path)}: a page that loads from elsewhere: {addresses}"


def test_a_module_says_what_it_is() -> None:
    """One without a word is a package that only holds others."""
    for path in sources("labs", "server", "tests"):
        assert docstring(path) or not path.read_text(encoding="utf-8").strip(), name_of(path)


def test_public_names_are_documented() -> None:
    """Modules' functions and classes; methods that do not fulfil the contract of a base."""
    for path in sources("labs"):
        for node in tree(path).body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name[0] != "_":
                assert ast.get_docstring(node), f"{name_of(path)}: {node.name} has no docstring"


def test_a_type_has_a_name_of_its_own() -> None:
    """`PlannedMotion` and `MotionTask`, not two `Motion`: who searches for it finds it."""
    defined: dict[str, list[str]] = {}
    for path in sources("labs", "server"):
        for name in type_names(path):
            defined.setdefault(name, []).append(name_of(path))
    assert len(defined) > 300
    assert not {name: paths for name, paths in defined.items() if len(paths) > 1}


def test_an_algorithm_cites_its_section() -> None:
    for path in sources("labs/algorithms"):
        said = docstring(path)
        cited = re.search(r"\bnotes\b[^.]*?(\d|A|B)\.\d", said) or "beyond the notes" in said
        assert cited or not said, f"{name_of(path)} cites no section of the notes"


def test_a_module_can_be_read_in_one_go() -> None:
    long = []
    for path in sources("labs", "server"):
        lines = len(path.read_text(encoding="utf-8").splitlines())
        most = LINES.get(path.name, MAX_LINES)
        if lines > most:
            long.append(f"{name_of(path)} has {lines} lines, {most} at most: split it")
    assert not long, "\n".join(long)


def test_every_lab_has_an_article_and_every_article_a_lab() -> None:
    for package in {entry.package for entry in catalog().values()}:
        chapter = Path(importlib.import_module(package).__path__[0])
        labs = {path.parent for path in chapter.glob("*/lab.py")}
        assert {path.parent for path in chapter.glob("*/article.md")} == labs, chapter.name
        assert labs <= {entry.folder for entry in catalog().values()}
