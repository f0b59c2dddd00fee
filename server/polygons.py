"""Filled polygons on Viser."""

import numpy as np
import viser

from labs.colors import from_linear, to_linear
from labs.scene import Color
from labs.shapes import Vector3
from server.boards import exposure
from server.messages import View
from server.nodes import COLORS, Node

CORNER_MULTIPLE = 8
"""The corners of a mesh are a multiple of so many, the last one several times: one that gains a
corner is most often the same mesh, and only its corners are sent."""


def padded_count(corners: np.ndarray) -> int:
    """How many corners the mesh of a polygon with these has."""
    return -(-len(corners) // CORNER_MULTIPLE) * CORNER_MULTIPLE


class PolygonNode(Node):
    """A convex polygon, as triangles about its first corner."""

    def __init__(
        self,
        server: viser.ViserServer,
        path: str,
        corners: np.ndarray,
        color: Color | Vector3,
        opacity: float,
        view: View,
    ) -> None:
        shade = np.array(COLORS[color]) / 255 if isinstance(color, str) else np.array(color)
        light = to_linear(shade) / exposure(view, corners)
        others = np.arange(1, padded_count(corners) - 1, dtype=np.uint32)
        super().__init__(
            server.scene.add_mesh_simple(
                path,
                _pad_corners(corners),
                np.stack([np.zeros_like(others), others, others + 1], axis=1),
                color=np.round(255 * from_linear(np.minimum(light, 1.0))).astype(np.uint8),
                opacity=opacity if opacity < 1.0 else None,
                flat_shading=True,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
        )

    def draw(self, corners: np.ndarray) -> None:
        """Sends the corners (k, 3) [m] if they changed."""
        self.set_property("vertices", _pad_corners(corners))


def _pad_corners(corners: np.ndarray) -> np.ndarray:
    missing = padded_count(corners) - len(corners)
    return np.pad(corners.astype(np.float32), ((0, missing), (0, 0)), mode="edge")
