"""Hot loops, compiled by Numba on their first call and kept beside their source for the next.

A lab calls what it needs once in `Lab.prepare`, before anybody waits for it."""

import contextlib
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """The function as machine code. Products may be fused with sums; sums keep their order and
    nothing is assumed of NaN and infinity, so that results are reproducible and trouble is seen.
    It runs without holding Python's lock."""
    return _compiled(function, inline=False)


def inlined(function: F) -> F:
    """The same, copied into each compiled function that calls it instead of called: for what is
    asked for at every turn of a hot loop."""
    return _compiled(function, inline=True)


def _compiled(function: F, inline: bool) -> F:
    machine_code = numba.njit(
        cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, forceinline=inline
    )
    return cast(F, machine_code(function))


def forget_stale(package: Path) -> bool:
    """Deletes what was compiled in a package if a source with compiled functions has changed since;
    whether it did. Numba sees that a function's own file changed, but not the file of a function
    it calls."""
    sources = [(path, path.read_bytes()) for path in sorted(package.rglob("*.py"))]
    digest = hashlib.sha256()
    for path, text in sources:
        if b"compiled" in text:
            digest.update(str(path.relative_to(package)).encode() + b"\0" + text)
    stamp = package / "__pycache__" / "compiled.sha256"
    known = stamp.read_text() if stamp.exists() else ""
    if known == digest.hexdigest():
        return False
    for pattern in ("*.nbi", "*.nbc"):
        for path in package.rglob(f"__pycache__/{pattern}"):
            path.unlink(missing_ok=True)
    stamp.parent.mkdir(exist_ok=True)
    stamp.write_text(digest.hexdigest())
    return True


# Where nothing may be written, nothing is kept beside the source, and nothing there is stale.
with contextlib.suppress(PermissionError):
    forget_stale(Path(__file__).parent)
