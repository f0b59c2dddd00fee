"""What every worker needs: imported, loaded and compiled once, where they are forked from."""

import gc

import server.worker  # noqa: F401  (imports Viser, Pinocchio and all labs' code)
from labs.catalog import catalog
from labs.models.arms import ARMS, load
from server import meshes

for _entry in catalog().values():
    _entry.lab.prepare()
for _name in ARMS:
    _arm = load(_name)
    for _piece in _arm.visuals:
        if _piece.mesh:
            meshes.gltf(_piece)
    for _piece in (*_arm.collisions, *(p for p in _arm.visuals if not p.mesh)):
        meshes.triangles(_piece)
meshes.torus(0.095, 0.009)
meshes.ball()
# What is loaded now is never collected: its pages stay shared among all workers.
gc.freeze()
