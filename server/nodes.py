"""What the scene is made of on Viser: nodes that are sent only what changed."""

from typing import Any

import numpy as np
import pinocchio as pin
import viser

from labs.scene import Color
from labs.shapes import Body, Visual
from server import meshes
from server.messages import View

COLORS: dict[Color, tuple[int, int, int]] = {
    "actual": (37, 99, 235),
    "reference": (234, 128, 28),
    "force": (190, 24, 130),
    "warning": (220, 38, 38),
    "muted": (140, 152, 168),
}
LIGHT, DARK = (255, 255, 255), (26, 27, 30)
"""What Viser draws behind everything."""
AMBER = (245, 166, 35)
GHOST_OPACITY = 0.3
GHOST_SCALE = 0.95
"""A ghost is a little thinner: where the arm is on its reference, it hides the ghost."""
POSE_TOLERANCE = 2e-5
"""A pose entry that moved less [m, or of a unit quaternion] is not sent again."""


def blend_with_background(color: Color, strength: float, dark: bool) -> np.ndarray:
    """(3,) a colour mixed towards what is behind it: lines cannot be translucent."""
    behind = np.array(DARK if dark else LIGHT)
    mixed: np.ndarray = behind + strength * (np.array(COLORS[color]) - behind)
    return np.round(mixed).astype(np.uint8)


class Node:
    """A Viser node that is sent only what changed."""

    def __init__(self, handle: Any) -> None:
        self.appearance: object = None
        self._handle = handle
        self._visible = True
        self._position = np.full(3, np.nan)
        self._wxyz = np.full(4, np.nan)
        self._sent: dict[str, Any] = {}

    def set_visible(self, visible: bool) -> None:
        if visible != self._visible:
            self._visible = visible
            self._handle.visible = visible

    def set_position(self, position: np.ndarray) -> None:
        if not np.abs(position - self._position).max() < POSE_TOLERANCE:
            self._position = position.copy()
            self._handle.position = position

    def set_orientation(self, wxyz: np.ndarray) -> None:
        if not np.abs(wxyz - self._wxyz).max() < POSE_TOLERANCE:
            self._wxyz = wxyz.copy()
            self._handle.wxyz = wxyz

    def set_property(self, prop: str, value: Any) -> None:
        if prop not in self._sent or not np.array_equal(self._sent[prop], value):
            self._sent[prop] = value
            setattr(self._handle, prop, value)

    def remove(self) -> None:
        self._handle.remove()


class ArmNode(Node):
    """An arm: a node a joint, nested as the joints are, with its pieces fixed to them."""

    def __init__(
        self, server: viser.ViserServer, path: str, arm: Body, ghost: bool, view: View
    ) -> None:
        self._scene = server.scene
        super().__init__(self._scene.add_frame(path, show_axes=False))
        self._model, self._data = arm.model, arm.model.createData()
        self._paths = [path]
        self._joints: list[Any] = []
        for joint in range(1, self._model.njoints):
            path = f"{self._paths[self._model.parents[joint]]}/{self._model.names[joint]}"
            self._paths.append(path)
            self._joints.append(self._scene.add_frame(path, show_axes=False))
        self._poses = np.full((self._model.njoints - 1, 7), np.nan)
        pieces = arm.visuals if view.graphics == "high" and not ghost else arm.collisions
        for index, piece in enumerate(pieces):
            self._add_piece(f"{self._paths[piece.joint]}/piece{index}", piece, ghost, view)
        self._outline = meshes.outline_points(arm.collisions)
        self._rings: list[Any] = []
        self._levels: list[int] = []

    def set_configuration(self, q: np.ndarray) -> None:
        """Places every joint that moved in its parent's frame."""
        pin.forwardKinematics(self._model, self._data, q)
        in_parent = self._data.liMi
        poses = np.array([pin.SE3ToXYZQUAT(in_parent[j]) for j in range(1, self._model.njoints)])
        # Not "moved by more": the first poses are compared with NaN.
        still = np.abs(poses - self._poses) < POSE_TOLERANCE
        for joint in np.flatnonzero(~still[:, 3:].all(axis=1)):
            self._joints[joint].wxyz = poses[joint, [6, 3, 4, 5]]
            self._poses[joint, 3:] = poses[joint, 3:]
        for joint in np.flatnonzero(~still[:, :3].all(axis=1)):
            self._joints[joint].position = poses[joint, :3]
            self._poses[joint, :3] = poses[joint, :3]

    def outline_points(self) -> np.ndarray:
        """(k, 3) [m]: points on what can be seen of it, where it was moved last."""
        at = self._data.oMi
        return np.concatenate(
            [points @ at[j].rotation.T + at[j].translation for j, points in self._outline.items()]
        )

    def mark_torque_limits(self, effort: np.ndarray) -> None:
        """A ring on every joint near its torque limit: amber from 0.8, red at the limit."""
        if not self._rings:
            self._rings = [self._add_ring(joint) for joint in range(1, self._model.njoints)]
            self._levels = [0] * len(self._rings)
        for joint, handle in enumerate(self._rings):
            level = int(effort[joint] >= 0.8) + int(effort[joint] >= 0.999)
            if level != self._levels[joint]:
                self._levels[joint] = level
                handle.visible = level > 0
                handle.color = COLORS["warning"] if level == 2 else AMBER

    def _add_ring(self, joint: int) -> Any:
        subspace = np.reshape(self._model.joints[joint].createData().S, (6, -1))[:, 0]
        # About the axis a joint turns about; where it slides, around the direction it slides in.
        axis = subspace[3:] if subspace[3:].any() else subspace[:3]
        vertices, faces = meshes.torus(0.095, 0.009)
        return self._scene.add_mesh_simple(
            f"{self._paths[joint]}/ring",
            vertices,
            faces,
            color=AMBER,
            wxyz=_rotation_from_z(axis),
            visible=False,
            cast_shadow=False,
        )

    def _add_piece(self, path: str, piece: Visual, ghost: bool, view: View) -> None:
        pose = pin.SE3ToXYZQUAT(piece.placement)
        place = {"position": pose[:3], "wxyz": pose[[6, 3, 4, 5]]}
        if piece.mesh and view.graphics == "high" and not ghost:
            self._scene.add_glb(path, meshes.to_gltf(piece), **place)
            return
        vertices, faces = meshes.to_triangles(piece)
        if ghost:
            center = vertices.mean(axis=0)
            vertices = center + GHOST_SCALE * (vertices - center)
        color = (
            COLORS["reference"] if ghost else np.round(255 * np.array(piece.color)).astype(np.uint8)
        )
        self._scene.add_mesh_simple(
            path,
            vertices,
            faces,
            color=color,
            opacity=GHOST_OPACITY if ghost else None,
            flat_shading=bool(piece.mesh),
            cast_shadow=not ghost,
            receive_shadow=not ghost,
            **place,
        )


class EllipsoidNode(Node):
    """A translucent ball under a linear map."""

    def __init__(self, server: viser.ViserServer, path: str, color: Color) -> None:
        self._vertices, faces = meshes.ball()
        super().__init__(
            server.scene.add_mesh_simple(
                path,
                self._vertices,
                faces,
                color=COLORS[color],
                opacity=0.3,
                side="double",
                cast_shadow=False,
            )
        )

    def set_axes(self, axes: np.ndarray) -> None:
        """The image of the unit ball under `axes` (3, 3) [m]."""
        self.set_property("vertices", (self._vertices @ axes.T).astype(np.float32))


class DotsNode(Node):
    """Many dots, which all face whoever looks: their places are sent as "points"."""

    def __init__(self, server: viser.ViserServer, path: str, diameter: float, color: Color) -> None:
        super().__init__(
            server.scene.add_point_cloud(
                path,
                np.zeros((0, 3), np.float32),
                COLORS[color],
                point_size=diameter,
                point_shape="circle",
                precision="float32",
                point_shading="flat",
            )
        )


def _rotation_from_z(axis: np.ndarray) -> np.ndarray:
    quaternion = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis)
    return np.asarray(quaternion.coeffs()[[3, 0, 1, 2]])
