"""What every worker needs: imported, loaded and compiled once, where they are forked from."""

import gc
import os
import sys
import threading

import server.worker  # noqa: F401  (imports Viser, Pinocchio and all labs' code)
from labs import compiled
from labs.engine.catalog import CatalogEntry, catalog
from labs.errors import LabError
from labs.models.arms import ARMS, load_arm
from server import fork_server, meshes

COMPILING_MESSAGE = "compiling the solvers, once; this may take a minute ..."
MESSAGE_DELAY = 1.0
"""[s] Compiling that takes longer is told on the terminal."""


def _watch_parent(parent: int, compiling: threading.Event, over: threading.Event) -> None:
    """Says why it takes long, and ends with the server: who compiles hears of nothing else."""
    since = 0.0
    while not over.wait(0.25):
        if os.getppid() != parent:
            os._exit(1)
        if compiling.is_set() and since < MESSAGE_DELAY:
            since += 0.25
            if since >= MESSAGE_DELAY:
                print(f"First start: {COMPILING_MESSAGE}", flush=True)


def _compile_labs() -> None:
    """Compiled code is kept on disk: a second start finds it."""
    if compiled.CACHE_NOTE:
        print(compiled.CACHE_NOTE, flush=True)
    compiling, over = threading.Event(), threading.Event()
    waiting = threading.Thread(target=_watch_parent, args=(os.getppid(), compiling, over))
    waiting.start()
    try:
        with compiled.on_compilation(compiling.set):
            for entry in _entries():
                entry.lab.prepare()
    finally:
        over.set()
        waiting.join()  # a process with a second thread had better not be forked


def _entries() -> list[CatalogEntry]:
    try:
        return list(catalog().values())
    except LabError:
        sys.exit(1)  # the web process finds it too, and says it


fork_server.tolerate_broken_requests()
_compile_labs()
for _name in ARMS:
    _arm = load_arm(_name)
    for _piece in _arm.visuals:
        if _piece.mesh:
            meshes.to_gltf(_piece)
    for _piece in (*_arm.collisions, *(p for p in _arm.visuals if not p.mesh)):
        meshes.to_triangles(_piece)
    meshes.outline_points(_arm.collisions)
meshes.torus(0.095, 0.009)
meshes.ball()
# What is loaded now is never collected: its pages stay shared among all workers.
gc.freeze()
