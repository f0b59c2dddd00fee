"""What is compiled: ahead of the first click, and again when its source has changed."""

import json
import subprocess
import sys
from pathlib import Path

from labs.compiled import forget_stale

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
        for _ in range(5):
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
        said = forget_stale(package)
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
