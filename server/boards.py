"""Boards of cells and coloured surfaces on Viser: what a table of values looks like."""

import json
import time
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import viser

from labs.colors import to_linear
from labs.scene import cell_centers
from server.messages import View
from server.nodes import Node

GAP = 0.06
"""The part of a cell's side that stays free."""
CELLS_EVERY = 0.09
"""[s] Between two updates of a board's colours."""
SURFACE_EVERY = 0.19
"""[s] Between two updates of a surface: they are long messages."""
PREPARE_SECONDS = 0.12
"""[s] A viewer has to prepare a surface it was sent, before it shows it."""

FLAT = 1e-6
"""[m] So little is as good as nothing."""

ClickCallback = Callable[[tuple[float, float, float]], None]


def cell_corners(
    origin: tuple[float, float, float], size: float, rows: int, columns: int
) -> np.ndarray:
    """The corners (rows + 1, columns + 1, 3) [m] of the cells of `Scene.cells`."""
    outward = np.array([0.5 * size, 0.5 * size, 0.0])
    return cell_centers(np.array(origin) - outward, size, rows + 1, columns + 1)


class CellsNode(Node):
    """A board: one instance of a square a cell; only their colours are sent again."""

    def __init__(
        self,
        server: viser.ViserServer,
        path: str,
        origin: tuple[float, float, float],
        size: float,
        colors: np.ndarray,
        clicked: ClickCallback | None,
        view: View,
    ) -> None:
        self._exposure = exposure(view)
        rows, columns, _ = colors.shape
        centers = cell_centers(origin, size, rows, columns).reshape(-1, 3)
        half = 0.5 * size * (1.0 - GAP)
        square = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
        board: Any = server.scene.add_batched_meshes_simple(
            path,
            square,
            np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
            batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (rows * columns, 1)),
            batched_positions=centers,
            batched_colors=_instance_colors(colors, self._exposure),
            lod="off",
            side="double",
            cast_shadow=False,
        )
        if clicked:

            async def on_click(event: Any) -> None:
                point = _intersect_plane(event.ray_origin, event.ray_direction, origin[2])
                if point is not None:
                    clicked(point)

            board.on_click(on_click)
        super().__init__(board)
        self._when = 0.0

    def set_colors(self, colors: np.ndarray) -> None:
        """Gives the cells these colours."""
        now = time.monotonic()
        if now - self._when > CELLS_EVERY:
            self._when = now
            self.set_property("batched_colors", _instance_colors(colors, self._exposure))


class SurfaceNode(Node):
    """A surface, in two copies: a viewer needs some time to prepare one it is sent, and shows the
    other meanwhile."""

    def __init__(
        self,
        server: viser.ViserServer,
        path: str,
        points: np.ndarray,
        colors: np.ndarray,
        view: View,
    ) -> None:
        super().__init__(server.scene.add_frame(path, show_axes=False))
        self._exposure = exposure(view, points)
        data = surface_glb(points, colors, self._exposure)
        self._shown, self._hidden = (
            server.scene.add_glb(f"{path}/{copy}", data, visible=copy == 0, cast_shadow=False)
            for copy in range(2)
        )
        # A speck that stays: while something wears a shader, the viewer need not compile it again.
        speck = np.broadcast_to(points.reshape(-1, 3).mean(axis=0), (2, 2, 3))
        data = surface_glb(speck, np.ones((2, 2, 3)), self._exposure)
        server.scene.add_glb(f"{path}/speck", data, cast_shadow=False)
        self._last = np.stack([points, colors])
        self._when = time.monotonic()
        self._preparing = False

    def draw(self, points: np.ndarray, colors: np.ndarray) -> None:
        """Sends what changed, and shows what was sent some time ago."""
        since = time.monotonic() - self._when
        if self._preparing and since > PREPARE_SECONDS:
            self._shown.visible, self._hidden.visible = False, True
            self._shown, self._hidden = self._hidden, self._shown
            self._preparing = False
        now = np.stack([points, colors])
        if since > SURFACE_EVERY and not np.array_equal(now, self._last):
            self._hidden.glb_data = surface_glb(points, colors, self._exposure)
            self._last = now
            self._when = time.monotonic()
            self._preparing = True


def exposure(view: View, points: np.ndarray | None = None) -> float:
    """How much brighter the scene's light makes a colour (linear): a value's colour is made so
    much darker, to be about the one its legend shows. A flat thing through `points` (..., 3) that
    stands upright along an axis, though it is no more than a line yet, has less light than what
    lies."""
    lying, standing = (1.5, 0.55) if view.graphics == "low" else (2.7, 1.4)
    if points is None:
        return lying
    along = np.ptp(points.reshape(-1, 3)[:, :2], axis=0)
    return standing if along.min() < FLAT else lying


def surface_glb(points: np.ndarray, colors: np.ndarray, exposure: float) -> bytes:
    """A surface through `points` (rows, columns, 3) with a colour (rows, columns, 3) a point, in
    binary glTF 2.0. The viewer computes the normals."""
    corners = points.reshape(-1, 3).astype("<f4")
    faces = _faces(*points.shape[:2])
    tints = np.full((len(corners), 4), 65535, "<u2")
    tints[:, :3] = np.round(65535 * np.minimum(to_linear(colors.reshape(-1, 3)) / exposure, 1.0))
    parts = [corners.tobytes(), tints.tobytes(), faces.tobytes()]
    starts = np.cumsum([0, *map(len, parts)]).tolist()
    float32, uint16, uint32 = 5126, 5123, 5125
    points_of = {"componentType": float32, "count": len(corners), "type": "VEC3"}
    attributes = {"POSITION": 0, "COLOR_0": 1, "NORMAL": 2}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 3, "material": 0}]}],
        "materials": [
            {
                "doubleSided": True,
                "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0},
            }
        ],
        "buffers": [{"byteLength": starts[-1]}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": len(part)}
            for start, part in zip(starts, parts, strict=False)
        ],
        "accessors": [
            points_of
            | {
                "bufferView": 0,
                "min": corners.min(axis=0).tolist(),
                "max": corners.max(axis=0).tolist(),
            },
            {
                "bufferView": 1,
                "componentType": uint16,
                "normalized": True,
                "count": len(tints),
                "type": "VEC4",
            },
            # Without data these are zeros: asked for here, computed there. A mesh that does not
            # ask is drawn facet by facet.
            points_of,
            {
                "bufferView": 2,
                "componentType": uint16 if faces.dtype == "<u2" else uint32,
                "count": faces.size,
                "type": "SCALAR",
            },
        ],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    chunks = _chunk(b"JSON", text, b" ") + _chunk(b"BIN\0", b"".join(parts), b"\0")
    return b"glTF" + np.array([2, 12 + len(chunks)], "<u4").tobytes() + chunks


@lru_cache(maxsize=8)
def _faces(rows: int, columns: int) -> np.ndarray:
    """Two triangles for every four neighbours in a grid of points."""
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    return np.stack([a, d, c, a, c, b], axis=-1).astype("<u2" if number.size < 65535 else "<u4")


def _chunk(kind: bytes, data: bytes, filler: bytes) -> bytes:
    data += filler * (-len(data) % 4)
    return np.array([len(data)], "<u4").tobytes() + kind + data


def _instance_colors(colors: np.ndarray, exposure: float) -> np.ndarray:
    """Per-instance colours as Viser takes them: linear, not sRGB."""
    return np.round(255 / exposure * to_linear(colors.reshape(-1, 3))).astype(np.uint8)


def _intersect_plane(
    origin: tuple[float, float, float], direction: tuple[float, float, float], height: float
) -> tuple[float, float, float] | None:
    """Where a ray meets the horizontal plane at `height`; None where it never does."""
    if direction[2] == 0.0:
        return None
    along = (height - origin[2]) / direction[2]
    x, y, _ = np.asarray(origin) + along * np.asarray(direction)
    return (float(x), float(y), height)
