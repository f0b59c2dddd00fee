"""What is compiled: ahead of the first click, and again when its source has changed."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from labs.compiled import cache_folder, delete_stale_cache, source_digest

ROOT = Path(__file__).parents[2]

AFTERWARDS = """
import json, sys
from numba.core.dispatcher import Dispatcher
from labs.engine.catalog import catalog
from labs.params import Choice, Toggle
from labs.engine.run import World

def versions():
    loaded = [m for name, m in list(sys.modules.items()) if name.startswith("labs")]
    found = {f for m in loaded for f in vars(m).values() if isinstance(f, Dispatcher)}
    return {f"{f.__module__}.{f.__name__}": len(f.signatures) for f in found}

late = {}
for slug, entry in catalog().items():
    entry.lab.prepare()
    ready = versions()
    settings, defaults = [{}], entry.lab.Params()
    for name, tunable in defaults.tunables.items():
        options = {}
        if isinstance(tunable, Choice):
            options = tunable.options
        if isinstance(tunable, Toggle):
            options = (True, False)
        if defaults.acts(name):
            settings += [{name: value} for value in options if value != getattr(defaults, name)]
    for changes in settings:
        if slug == "troublesome":
            continue
        world = World(entry, changes)
        for _ in range(3):  # a solver's third step is the first that may guess its active set
            world.iterate()
            world.advance()
        entry.lab.measure(world.params, world.state)
        entry.lab.fields(world.params, world.state)
        new = {name: n for name, n in versions().items() if n > ready.get(name, 0)}
        if new:
            late[f"{slug} {changes}"] = new
            ready = versions()
print(json.dumps({"late": late, "compiled": len(versions())}))
"""


def test_nothing_is_compiled_after_a_lab_was_prepared() -> None:
    """For every option of every lab, where it acts by default: what compiles late makes somebody
    wait for seconds."""
    result = subprocess.run(
        [sys.executable, "-c", AFTERWARDS], check=True, stdout=subprocess.PIPE, text=True
    )
    found = json.loads(result.stdout)
    assert found["compiled"] > 10, "there is something to look at"
    assert found["late"] == {}


def test_what_was_compiled_is_forgotten_when_a_source_changes(tmp_path: Path) -> None:
    package = tmp_path / "package"
    cache = package / "inner" / "__pycache__"
    cache.mkdir(parents=True)
    caller, callee = package / "inner" / "caller.py", package / "callee.py"
    other, kept = package / "other.py", cache / "other.pyc"
    caller.write_text("@compiled\ndef f(): return g()\n")
    callee.write_text("@compiled\ndef g(): return 1\n")
    other.write_text("x = 1\n")
    kept.write_text("")

    def forgets() -> bool:
        (cache / "caller.f.nbi").write_text("")
        (cache / "caller.f.1.nbc").write_text("")
        said = delete_stale_cache(package, source_digest(package))
        left = sorted(path.name for path in cache.iterdir())
        assert left == (["other.pyc"] if said else ["caller.f.1.nbc", "caller.f.nbi", "other.pyc"])
        return said

    assert forgets(), "nobody knows what it was compiled from"
    assert not forgets()
    other.write_text("x = 2\n")
    assert not forgets(), "that file compiles nothing"
    callee.write_text("@compiled\ndef g(): return 2\n")
    assert forgets()
    assert not forgets()
    callee.rename(package / "renamed.py")
    assert forgets()


PROBE = """
from labs.compiled import compiled

@compiled
def twice(x):
    return x + x
"""
AS_NOBODY = """
import ctypes, os, sys
ctypes.CDLL(None).prctl(24, 1, 0, 0, 0)  # Of root's powers, not to be held by what may be written.
os.execv(sys.executable, [sys.executable, "-c", sys.argv[1]])
"""
WITHOUT_A_HOME = """
import json, sys
from pathlib import Path
from labs.probe import twice
from server.cli import main

assert main(["list"]) == 0
assert main(["run", "joint-control", "--seconds", "0.01"]) == 0
result = twice(2)
from numba.core import config
kept = [path.name for path in Path(config.CACHE_DIR or "/none").rglob("probe.twice*")]
print(json.dumps({"result": result, "folder": config.CACHE_DIR, "kept": kept}))
"""
WITHOUT_ANY_FOLDER = f"""
import tempfile
tempfile._candidate_tempdir_list = lambda: ["/proc/none"]
{WITHOUT_A_HOME}
assert main(["serve", "--port", "0"]) == 2
"""


def test_where_nothing_may_be_written_everything_works() -> None:
    """Installed by somebody else, and used by one without a home: what is compiled is kept in a
    temporary folder of this user's own, or nowhere, and a sentence says which, once."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        for package in ("labs", "server"):
            ignored = shutil.ignore_patterns("__pycache__", "*.webp")
            shutil.copytree(ROOT / package, place / package, ignore=ignored)
        (place / "labs" / "probe.py").write_text(PROBE)
        temporary = place / "tmp"
        temporary.mkdir()
        for path in (place, *place.rglob("*")):
            path.chmod(0o555 if path.is_dir() else 0o444)
        temporary.chmod(0o777)
        environment = {k: v for k, v in os.environ.items() if k not in ("HOME", "ORCLAB_LABS")}
        first, second, nowhere = (
            subprocess.run(
                [sys.executable, "-c", AS_NOBODY, script],
                check=False,
                cwd=place,
                env=environment | {"TMPDIR": str(temporary), "XDG_CACHE_HOME": "/proc/none"},
                capture_output=True,
                text=True,
            )
            for script in (WITHOUT_A_HOME, WITHOUT_A_HOME, WITHOUT_ANY_FOLDER)
        )
        for path in (place, *place.rglob("*")):
            path.chmod(0o755)
    for result in (first, second, nowhere):
        assert result.returncode == 0, result.stderr
        *listed, last = result.stdout.splitlines()
        assert len(listed) > 10
        found = json.loads(last)
        assert found["result"] == 4
        assert bool(found["kept"]) == (result is not nowhere)
        if result is not nowhere:
            assert found["folder"].startswith(str(temporary))
    assert f"kept in {temporary}" in first.stderr
    assert "kept" not in second.stderr
    assert nowhere.stderr.count("is kept nowhere") == 1
    assert "TMPDIR" in nowhere.stderr.splitlines()[-1], "serving needs one"


def test_a_folder_of_somebody_else_holds_no_code(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Code is loaded from there."""
    package = tmp_path / "package"
    inner = package / "inner" / "__pycache__"
    inner.mkdir(parents=True)
    assert cache_folder(package, "abc") == "", "beside the source"
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != inner)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    own = cache_folder(package, "abc")
    assert own == str(tmp_path / "home" / f"numba-orclab-{os.getuid()}" / "abc")
    Path(own).parent.chmod(0o777)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    other = cache_folder(package, "abc")
    assert other == str(tmp_path / f"numba-orclab-{os.getuid()}" / "abc")
    assert Path(other).stat().st_mode & 0o077 == 0
