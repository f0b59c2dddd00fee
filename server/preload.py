"""What every worker needs: imported, loaded and compiled once, where they are forked from."""

import gc
import os
import threading

import server.worker  # noqa: F401  (imports Viser, Pinocchio and all labs' code)
from labs.engine.catalog import catalog
from labs.models.arms import ARMS, load
from server import meshes

PATIENCE = 2.0
"""[s] Compiling that takes longer is told on the terminal."""


def _announce_compilation(parent: int, over: threading.Event) -> None:
    """Says why it takes long, and ends with the server: who compiles hears of nothing else."""
    if not over.wait(PATIENCE):
        print("First start: compiling the solvers, once; this may take a minute ...", flush=True)
    while not over.wait(0.25):
        if os.getppid() != parent:
            os._exit(1)


def _prepare() -> None:
    """Compiled code is kept on disk: a second start finds it."""
    over = threading.Event()
    waiting = threading.Thread(target=_announce_compilation, args=(os.getppid(), over))
    waiting.start()
    try:
        for entry in catalog().values():
            entry.lab.prepare()
    finally:
        over.set()
        waiting.join()  # a process with a second thread had better not be forked


_prepare()
for _name in ARMS:
    _arm = load(_name)
    for _piece in _arm.visuals:
        if _piece.mesh:
            meshes.gltf(_piece)
    for _piece in (*_arm.collisions, *(p for p in _arm.visuals if not p.mesh)):
        meshes.triangles(_piece)
    meshes.outline(_arm.collisions)
meshes.torus(0.095, 0.009)
meshes.ball()
# What is loaded now is never collected: its pages stay shared among all workers.
gc.freeze()
