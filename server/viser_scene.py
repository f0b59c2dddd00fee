"""The scene protocol on Viser.

An arm is a tree of nodes, one a joint, each in its parent: moving it sends one quaternion a joint,
and one that has not moved sends nothing. What a frame does not draw is hidden."""

import math

import numpy as np
import pinocchio as pin
import viser
from numpy.typing import ArrayLike

from labs.engine.run import World
from labs.scene import Color
from labs.shapes import Body, Vector3
from server import meshes
from server.boards import CellsNode, SurfaceNode, cell_corners
from server.camera import BALL_CORNERS, Cameras
from server.handles import HandleNode
from server.labels import LabelNode, place_labels
from server.mailbox import Mailbox
from server.messages import View
from server.node_table import NodeTable
from server.nodes import (
    COLORS,
    ArmNode,
    DotsNode,
    EllipsoidNode,
    Node,
    blend_with_background,
)
from server.polygons import PolygonNode, padded_count
from server.scene_setup import configure_scene

TRAIL_EVERY = 3
"""Frames between two updates of a trail or of many arrows: they are long messages."""
LABELS_EVERY = 12
"""Frames between two looks at where labels stand."""


class ViserScene:
    """Draws a world's frames into a Viser server."""

    def __init__(self, server: viser.ViserServer, mailbox: Mailbox, view: View) -> None:
        self._server, self._mailbox = server, mailbox
        self._nodes = NodeTable()
        self._frame = 0
        self._shown: list[object] = []
        """The run that was drawn, and what its bodies and boards looked like."""
        self._cameras = Cameras(server)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.minimize()  # one tap away: the page has knobs of its own
        self.set_view(view)

    def set_view(self, view: View) -> None:
        """Light or dark; low graphics means no environment light, no shadows, plain meshes."""
        self._view = view
        self._nodes.clear()
        self._frame = 0
        configure_scene(self._server, view)

    def draw(self, world: World) -> None:
        """One frame of a lab, to whoever looks."""
        if not self._server.get_clients() and self._frame:
            return  # Nobody looks; the first frame is drawn for whoever comes.
        # One window a frame, sent at once: by itself Viser collects messages for 17 ms.
        with self._server.atomic():
            world.lab.draw(self, world.params, world.state)
            drawn = self._nodes.end_frame()
            shown = [node.appearance for node in drawn if isinstance(node, ArmNode | CellsNode)]
            held = any(node.held for node in drawn if isinstance(node, HandleNode))
            self._cameras.follow(changed=[world.runs, *shown] != self._shown, held=held)
            if self._frame % LABELS_EVERY == 0:
                place_labels(drawn, self._cameras)
        self._server.flush()
        self._shown = [world.runs, *shown]
        self._frame += 1

    def reset_view(self) -> None:
        """Looks as if nobody had moved a camera."""
        self._cameras.reset()

    # What a lab draws -----------------------------------------------------------------------

    def camera(self, position: ArrayLike, look_at: ArrayLike, core: ArrayLike = ()) -> None:
        self._cameras.set_home_view(position, look_at, core)

    def arm(
        self,
        name: str,
        arm: Body,
        q: np.ndarray,
        *,
        ghost: bool = False,
        effort: np.ndarray | None = None,
    ) -> None:
        appearance = (id(arm), ghost)
        node = self._nodes.node(
            name, appearance, lambda path: ArmNode(self._server, path, arm, ghost, self._view)
        )
        assert isinstance(node, ArmNode)
        node.set_configuration(q)
        outline = node.outline_points()
        self._cameras.include_points(outline)
        self._cameras.add_obstacles(outline)
        if effort is not None:
            node.mark_torque_limits(effort)

    def trail(
        self, name: str, points: np.ndarray, color: Color = "actual", strength: float = 1.0
    ) -> None:
        pairs = np.stack([points[..., :-1, :], points[..., 1:, :]], axis=-2)
        if not pairs.size:
            return
        segments = pairs.reshape(-1, 2, 3).astype(np.float32)
        mixed = blend_with_background(color, strength, self._view.dark)
        node = self._line_node(name, segments, mixed, 2.5)
        if color != "muted":
            self._cameras.include_points(points.reshape(-1, 3))
        if self._frame % TRAIL_EVERY == 0:
            node.set_property("points", segments)

    def arrow(self, name: str, start: ArrayLike, end: ArrayLike, color: Color = "force") -> None:
        points = np.array([[_to_tuple(start), _to_tuple(end)]], np.float32)

        self._arrow_node(name, points, color, 0.07).set_property("points", points)
        self._cameras.include_points(points)

    def sphere(self, name: str, center: ArrayLike, radius: float, color: Color = "actual") -> None:
        def make(path: str) -> Node:
            return Node(self._server.scene.add_icosphere(path, radius, color=COLORS[color]))

        self._nodes.node(name, (radius, color), make).set_position(np.asarray(center))
        self._cameras.include_ball(center, radius)

    def frame(self, name: str, placement: pin.SE3, length: float = 0.15) -> None:
        def make(path: str) -> Node:
            return Node(
                self._server.scene.add_frame(
                    path, axes_length=length, axes_radius=0.04 * length, origin_radius=0.0
                )
            )

        node = self._nodes.node(name, length, make)
        node.set_position(placement.translation)
        node.set_orientation(pin.SE3ToXYZQUAT(placement)[[6, 3, 4, 5]])
        self._cameras.include_points(placement.translation + length * placement.rotation.T)

    def arc(
        self,
        name: str,
        center: ArrayLike,
        axis: ArrayLike,
        angle: float,
        radius: float,
        color: Color = "force",
    ) -> None:
        segments = meshes.arc_with_head(np.asarray(center), np.asarray(axis), angle, radius)

        node = self._line_node(name, segments, np.array(COLORS[color], np.uint8), 4.0)
        node.set_property("points", segments)
        self._cameras.include_points(segments)

    def ellipsoid(
        self, name: str, center: ArrayLike, axes: np.ndarray, color: Color = "actual"
    ) -> None:
        node = self._nodes.node(name, color, lambda path: EllipsoidNode(self._server, path, color))
        assert isinstance(node, EllipsoidNode)
        node.set_axes(axes)
        node.set_position(np.asarray(center))
        self._cameras.include_points(np.asarray(center) + np.concatenate([axes.T, -axes.T]))

    def handle(self, name: str, position: ArrayLike, radius: float = 0.05) -> None:
        def make(path: str) -> Node:
            return HandleNode(self._server, path, name, radius, self._mailbox)

        node = self._nodes.node(name, radius, make)
        assert isinstance(node, HandleNode)
        point = np.asarray(position, float)
        node.set_position(point)
        shown = node.scale_to_screen(self._cameras.metres_per_pixel(point))
        self._cameras.include_ball(point, radius)
        self._cameras.add_obstacles(point + shown * BALL_CORNERS)

    def label(self, name: str, text: str, position: ArrayLike) -> None:
        node = self._nodes.node(name, "label", lambda path: LabelNode(self._server, path, text))
        assert isinstance(node, LabelNode)
        node.set_text(text, np.asarray(position, float))
        self._cameras.include_label(node.point, text)

    def cells(
        self,
        name: str,
        origin: ArrayLike,
        size: float,
        colors: np.ndarray,
        *,
        clickable: bool = True,
    ) -> None:
        corner = _to_tuple(origin)

        def clicked(point: tuple[float, float, float]) -> None:
            self._mailbox.put("hold", handle=name, point=point)
            self._mailbox.put("hold", handle=name, point=None)

        def make(path: str) -> Node:
            on_click = clicked if clickable else None
            return CellsNode(self._server, path, corner, size, colors, on_click, self._view)

        node = self._nodes.node(name, (corner, size, colors.shape, clickable), make)
        assert isinstance(node, CellsNode)
        node.set_colors(colors)
        self._cameras.include_points(cell_corners(corner, size, *colors.shape[:2]))

    def surface(self, name: str, points: np.ndarray, colors: np.ndarray) -> None:
        def make(path: str) -> Node:
            return SurfaceNode(self._server, path, points, colors, self._view)

        node = self._nodes.node(name, "surface", make)
        assert isinstance(node, SurfaceNode)
        node.draw(points, colors)
        self._cameras.include_points(points)

    def arrows(
        self, name: str, starts: np.ndarray, ends: np.ndarray, color: Color = "force"
    ) -> None:
        lengths = np.linalg.norm(ends - starts, axis=1)
        if not lengths.any():
            return
        points = np.stack([starts, ends], axis=1)[lengths > 0.0].astype(np.float32)
        # A head by steps of its size: the longest arrow may change a little each frame.
        head = 0.35 * 1.25 ** round(math.log(float(lengths.max()), 1.25))

        node = self._arrow_node(name, points, color, head)
        self._cameras.include_points(points)
        if self._frame % TRAIL_EVERY == 0:
            node.set_property("points", points)

    def polygon(
        self,
        name: str,
        corners: np.ndarray,
        color: Color | Vector3 = "actual",
        opacity: float = 1.0,
    ) -> None:
        def make(path: str) -> Node:
            return PolygonNode(self._server, path, corners, color, opacity, self._view)

        node = self._nodes.node(name, (color, opacity, padded_count(corners)), make)
        assert isinstance(node, PolygonNode)
        node.draw(corners)
        self._cameras.include_points(corners)

    def dots(
        self, name: str, centers: np.ndarray, diameter: float, color: Color = "actual"
    ) -> None:
        if not len(centers):
            return
        node = self._nodes.node(
            name, (diameter, color), lambda path: DotsNode(self._server, path, diameter, color)
        )
        node.set_property("points", centers.astype(np.float32))
        self._cameras.include_points(centers)

    # Nodes ----------------------------------------------------------------------------------

    def _line_node(
        self, name: str, segments: np.ndarray, color: np.ndarray, thickness: float
    ) -> Node:
        def make(path: str) -> Node:
            return Node(
                self._server.scene.add_line_segments(
                    path, segments, color, thickness=thickness, thickness_units="screen"
                )
            )

        node = self._nodes.node(name, thickness, make)
        node.set_property("colors", color)
        return node

    def _arrow_node(self, name: str, points: np.ndarray, color: Color, head: float) -> Node:
        def make(path: str) -> Node:
            return Node(
                self._server.scene.add_arrows(
                    path,
                    points,
                    COLORS[color],
                    shaft_radius=0.18 * head,
                    head_radius=0.45 * head,
                    head_length=head,
                )
            )

        return self._nodes.node(name, (color, head), make)


def _to_tuple(point: ArrayLike) -> tuple[float, float, float]:
    x, y, z = np.asarray(point, float)
    return (float(x), float(y), float(z))
