"""Robot meshes as the scene wants them: glTF with materials, or bare triangles. Cached, so that a
worker forked from a process that has loaded them finds them in memory."""

from functools import cache
from typing import Any

import numpy as np
import trimesh

from labs.models.arms import Box, Cylinder, Sphere, Visual

Triangles = tuple[np.ndarray, np.ndarray]
"""Vertices (k, 3) [m] and faces (m, 3)."""


def gltf(visual: Visual) -> bytes:
    """A mesh file with its own materials as binary glTF, scaled [m], in its own frame."""
    return _gltf(visual.mesh, visual.scale)


def triangles(visual: Visual) -> Triangles:
    """A mesh file or a primitive as triangles, in its own frame."""
    return _triangles(visual.mesh, visual.scale, visual.shape)


@cache
def torus(radius: float, thickness: float) -> Triangles:
    """A ring about z."""
    return _arrays(trimesh.creation.torus(radius, thickness, major_sections=40, minor_sections=12))


@cache
def ball() -> Triangles:
    """A ball of radius 1."""
    return _arrays(trimesh.creation.icosphere(3, 1.0))


@cache
def _gltf(path: str, scale: tuple[float, float, float]) -> bytes:
    scene: Any = trimesh.load_scene(path)  # its types are partial
    scene.apply_scale(scale)
    data = scene.export(file_type="glb")
    assert isinstance(data, bytes)
    return data


@cache
def _triangles(
    path: str, scale: tuple[float, float, float], shape: Box | Cylinder | Sphere | None
) -> Triangles:
    match shape:
        case Box(size=size):
            return _arrays(trimesh.creation.box(size))
        case Cylinder(radius=radius, length=length):
            return _arrays(trimesh.creation.cylinder(radius, length, sections=48))
        case Sphere(radius=radius):
            return _arrays(trimesh.creation.icosphere(3, radius))
        case None:
            mesh: Any = trimesh.load_mesh(path)
            mesh.apply_scale(scale)
            return _arrays(mesh)


def _arrays(mesh: trimesh.Trimesh) -> Triangles:
    return np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32)
