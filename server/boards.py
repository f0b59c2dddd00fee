"""Boards of cells and coloured surfaces on Viser: what a table of values looks like."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from labs.scene import cell_centers
from server.nodes import Node

GAP = 0.06
"""The part of a cell's side that stays free."""
SWAP = 0.1
"""[s] A viewer has to prepare a surface before it is shown in place of the last one."""

Clicked = Callable[[tuple[float, float, float]], None]


class CellsNode(Node):
    """A board: one instance of a square a cell; only their colours are sent again."""

    def __init__(
        self,
        server: viser.ViserServer,
        name: str,
        origin: tuple[float, float, float],
        size: float,
        colors: np.ndarray,
        clicked: Clicked | None,
    ) -> None:
        rows, columns, _ = colors.shape
        centers = cell_centers(origin, size, rows, columns).reshape(-1, 3)
        half = 0.5 * size * (1.0 - GAP)
        square = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
        board: Any = server.scene.add_batched_meshes_simple(
            f"/{name}",
            square,
            np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
            batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (rows * columns, 1)),
            batched_positions=centers,
            batched_colors=_bytes(colors),
            lod="off",
            side="double",
            cast_shadow=False,
        )
        if clicked:

            async def on_click(event: Any) -> None:
                point = _on_plane(event.ray_origin, event.ray_direction, origin[2])
                if point is not None:
                    clicked(point)

            board.on_click(on_click)
        super().__init__(board)

    def paint(self, colors: np.ndarray) -> None:
        self.send("batched_colors", _bytes(colors))


def glb(points: np.ndarray, colors: np.ndarray) -> bytes:
    """A surface through `points` (rows, columns, 3) with a colour (rows, columns, 3) a point, in
    binary glTF; the viewer adds the normals."""
    rows, columns, _ = points.shape
    number = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    faces = np.stack([a, d, c, a, c, b], axis=-1).astype(np.uint32)
    corners = points.reshape(-1, 3).astype("<f4")
    linear = np.ones((rows * columns, 4))
    linear[:, :3] = _linear(colors.reshape(-1, 3))
    tints = np.round(65535 * linear).astype("<u2")
    parts = [corners.tobytes(), tints.tobytes(), faces.tobytes()]
    starts = np.cumsum([0, *map(len, parts)])
    count = rows * columns
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 0, "COLOR_0": 1, "NORMAL": 3},
                        "indices": 2,
                        "material": 0,
                    }
                ]
            }
        ],
        "materials": [
            {
                "doubleSided": True,
                "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0},
            }
        ],
        "buffers": [{"byteLength": int(starts[-1])}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(start), "byteLength": len(part)}
            for start, part in zip(starts, parts, strict=False)
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": count,
                "type": "VEC3",
                "min": corners.min(axis=0).tolist(),
                "max": corners.max(axis=0).tolist(),
            },
            {
                "bufferView": 1,
                "componentType": 5123,
                "normalized": True,
                "count": count,
                "type": "VEC4",
            },
            {"bufferView": 2, "componentType": 5125, "count": faces.size, "type": "SCALAR"},
            # Without data these are zeros: the viewer computes them, smooth ones.
            {"componentType": 5126, "count": count, "type": "VEC3"},
        ],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary = b"".join(parts)
    binary += b"\0" * (-len(binary) % 4)
    chunks = _chunk(text, b"JSON") + _chunk(binary, b"BIN\0")
    return b"glTF" + np.array([2, 12 + len(chunks)], "<u4").tobytes() + chunks


def _chunk(data: bytes, kind: bytes) -> bytes:
    return np.array([len(data)], "<u4").tobytes() + kind + data


def _bytes(colors: np.ndarray) -> np.ndarray:
    """Per-instance colours as Viser takes them: linear, not sRGB."""
    return np.round(255 * _linear(colors.reshape(-1, 3))).astype(np.uint8)


def _linear(srgb: np.ndarray) -> np.ndarray:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _on_plane(
    origin: tuple[float, float, float], direction: tuple[float, float, float], height: float
) -> tuple[float, float, float] | None:
    """Where a ray meets the horizontal plane at `height`; None where it never does."""
    if direction[2] == 0.0:
        return None
    along = (height - origin[2]) / direction[2]
    x, y, _ = np.asarray(origin) + along * np.asarray(direction)
    return (float(x), float(y), height)
