"""Shapes as the scene wants them: glTF with materials, bare triangles, segments of lines. Meshes
are cached, so that a worker forked from a process that has loaded them finds them in memory."""

import itertools
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import trimesh

from labs.scene import arc_point
from labs.shapes import Box, Cylinder, Sphere, Visual

Triangles = tuple[np.ndarray, np.ndarray]
"""Vertices (k, 3) [m] and faces (m, 3)."""


def to_gltf(visual: Visual) -> bytes:
    """A mesh file with its own materials as binary glTF, scaled [m], in its own frame."""
    return _load_gltf(visual.mesh, visual.scale)


def to_triangles(visual: Visual) -> Triangles:
    """A mesh file or a primitive as triangles, in its own frame."""
    return _load_triangles(visual.mesh, visual.scale, visual.shape)


def outline_points(pieces: Sequence[Visual]) -> dict[int, np.ndarray]:
    """Points (k, 3) [m] that reach as far as the pieces do, by the joint they move with."""
    found: dict[int, list[np.ndarray]] = {}
    for piece in pieces:
        local = _extreme_vertices(piece.mesh, piece.scale, piece.shape)
        place = piece.placement
        found.setdefault(piece.joint, []).append(local @ place.rotation.T + place.translation)
    return {joint: np.concatenate(points) for joint, points in found.items()}


@cache
def torus(radius: float, thickness: float) -> Triangles:
    """A ring about z."""
    return _mesh_arrays(
        trimesh.creation.torus(radius, thickness, major_sections=40, minor_sections=12)
    )


@cache
def ball() -> Triangles:
    """A ball of radius 1."""
    return _mesh_arrays(trimesh.creation.icosphere(3, 1.0))


def arc_with_head(center: np.ndarray, axis: np.ndarray, angle: float, radius: float) -> np.ndarray:
    """Segments (k, 2, 3) of an arc about `axis`, with an arrow's head where it ends."""
    turns = np.linspace(0.0, angle, 25)
    points = arc_point(center, axis, turns, radius)
    back = turns[-1] - np.sign(angle) * min(0.3, abs(angle) / 2)
    head = [[points[-1], arc_point(center, axis, back, r * radius)] for r in (0.85, 1.15)]
    return np.concatenate([np.stack([points[:-1], points[1:]], 1), head]).astype(np.float32)


@cache
def _extreme_vertices(
    path: str, scale: tuple[float, float, float], shape: Box | Cylinder | Sphere | None
) -> np.ndarray:
    """(k, 3) [m]: the vertices that reach farthest along 26 directions."""
    vertices = _load_triangles(path, scale, shape)[0].astype(float)
    ways = np.array([way for way in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    farthest: np.ndarray = vertices[np.unique(np.argmax(vertices @ ways.T, axis=0))]
    return farthest


@cache
def _load_gltf(path: str, scale: tuple[float, float, float]) -> bytes:
    scene: Any = trimesh.load_scene(path)  # its types are partial
    scene.apply_scale(scale)
    data = scene.export(file_type="glb")
    assert isinstance(data, bytes)
    return data


@cache
def _load_triangles(
    path: str, scale: tuple[float, float, float], shape: Box | Cylinder | Sphere | None
) -> Triangles:
    match shape:
        case Box(size=size):
            return _mesh_arrays(trimesh.creation.box(size))
        case Cylinder(radius=radius, length=length):
            return _mesh_arrays(trimesh.creation.cylinder(radius, length, sections=48))
        case Sphere(radius=radius):
            return _mesh_arrays(trimesh.creation.icosphere(3, radius))
        case None:
            mesh: Any = trimesh.load_mesh(path)
            mesh.apply_scale(scale)
            return _mesh_arrays(mesh)


def _mesh_arrays(mesh: trimesh.Trimesh) -> Triangles:
    return np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32)
