"""Hot loops, compiled by Numba on their first call and kept beside their source for the next.

A lab calls what it needs once in `Lab.prepare`, before anybody waits for it."""

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import config, event

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
        cache=CACHE_FOLDER is not None,
        nogil=True,
        error_model="numpy",
        fastmath={"contract"},
        forceinline=inline,
    )
    return cast(F, machine_code(function))


def source_digest(package: Path) -> str:
    """Of all sources of a package with compiled functions."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        text = path.read_bytes()
        if b"compiled" in text:
            digest.update(str(path.relative_to(package)).encode() + b"\0" + text)
    return digest.hexdigest()


def delete_stale_cache(package: Path, digest: str) -> bool:
    """Deletes what was compiled in a package from sources of another digest; whether it did. Numba
    sees that a function's own file changed, but not the file of a function it calls."""
    stamp = package / "__pycache__" / "compiled.sha256"
    known = stamp.read_text() if stamp.exists() else ""
    if known == digest:
        return False
    for pattern in ("*.nbi", "*.nbc"):
        for path in package.rglob(f"__pycache__/{pattern}"):
            path.unlink(missing_ok=True)
    stamp.parent.mkdir(exist_ok=True)
    stamp.write_text(digest)
    return True


class _CompilationListener(event.Listener):
    def __init__(self, tell: Callable[[], None]) -> None:
        self._tell = tell

    def on_start(self, event: Any) -> None:
        self._tell()

    def on_end(self, event: Any) -> None:
        pass


@contextlib.contextmanager
def on_compilation(tell: Callable[[], None]) -> Iterator[None]:
    """Within it, `tell` is called whenever a function is compiled that was not found on disk."""
    with event.install_listener("numba:compile", _CompilationListener(tell)):
        yield


def cache_folder(package: Path, digest: str) -> str | None:
    """Where Numba may keep what it compiles: "" beside the source, as usual, or where that cannot
    be written, as by one who did not install it, a folder of this user's own. None: nowhere."""
    beside = (package, *package.rglob("__pycache__"))
    if all(os.access(path, os.W_OK) for path in beside):
        return ""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    parents = [home] if os.path.isabs(home) else []  # "~": nobody knows where it is
    with contextlib.suppress(FileNotFoundError):
        parents.append(tempfile.gettempdir())
    for parent in parents:
        folder = Path(parent) / f"numba-orclab-{os.getuid()}" / digest
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _is_private(folder.parent) and _is_private(folder):
                return str(folder)
    return None


def _is_private(folder: Path) -> bool:
    """Whether nobody else may write to it: code is loaded from there."""
    about = folder.lstat()
    safe = about.st_uid == os.getuid() and not about.st_mode & 0o022
    return safe and not folder.is_symlink() and os.access(folder, os.W_OK)


def _is_writable(folder: Path) -> bool:
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return os.access(folder, os.W_OK)


def _prepare_cache(package: Path) -> str | None:
    if (chosen := os.environ.get("NUMBA_CACHE_DIR")) and _is_writable(Path(chosen)):
        return ""
    digest = source_digest(package)
    folder = cache_folder(package, digest[:16])
    if folder:
        os.environ["NUMBA_CACHE_DIR"] = folder
        config.reload_config()  # type: ignore[no-untyped-call]
    elif folder == "":
        delete_stale_cache(package, digest)
    return folder


def cache_note(folder: str | None) -> str:
    """What somebody should know of the cache, in a sentence; nothing where it is as usual, or was
    used before."""
    if folder is None:
        return (
            "What is compiled is kept nowhere, for no folder can be written: each start compiles "
            "again. NUMBA_CACHE_DIR or TMPDIR may name one that can."
        )
    if folder and not any(Path(folder).iterdir()):
        return f"What is compiled is kept in {folder}, for the labs' own folder cannot be written."
    return ""


CACHE_FOLDER = _prepare_cache(Path(__file__).parent)
"""As `cache_folder` says."""
CACHE_NOTE = cache_note(CACHE_FOLDER)
