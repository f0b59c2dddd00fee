"""The scene protocol on Viser.

An arm is a tree of nodes, one a joint, each placed in its parent: moving the arm sends one
quaternion a joint, and one that has not moved sends nothing. What a frame does not draw is
hidden."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import viser
from numpy.typing import ArrayLike

from labs.models.arms import Arm, Visual
from labs.run import World
from labs.scene import Color
from server import meshes
from server.mailbox import Mailbox
from server.messages import View

COLORS: dict[Color, tuple[int, int, int]] = {
    "actual": (37, 99, 235),
    "reference": (234, 128, 28),
    "force": (200, 30, 110),
    "warning": (220, 38, 38),
    "muted": (140, 152, 168),
}
AMBER = (245, 166, 35)
GHOST_OPACITY = 0.3
GHOST_SCALE = 0.95
"""A ghost is a little thinner: where the arm is on its reference, it hides the ghost."""
STILL = 2e-5
"""A pose entry that moved less [m, or of a unit quaternion] is not sent again."""
TRAIL_EVERY = 3
"""Frames between two updates of a trail: they are long messages."""


class ViserScene:
    """Draws a world's frames into a Viser server."""

    def __init__(self, server: viser.ViserServer, mailbox: Mailbox, view: View) -> None:
        self._server, self._mailbox = server, mailbox
        self._nodes: dict[str, _Node] = {}
        self._drawn: set[str] = set()
        self._frame = 0
        self._camera: tuple[tuple[float, ...], tuple[float, ...]] | None = None
        server.gui.main_panel.dock_right()
        self.set_view(view)

    def set_view(self, view: View) -> None:
        """Light or dark; low graphics means no environment light, no shadows, plain meshes."""
        self._view = view
        self._clear()
        self._server.gui.configure_theme(
            dark_mode=view.dark,
            show_logo=False,
            show_share_button=False,
            control_width="small",
            brand_color=COLORS["actual"],
        )
        scene = self._server.scene
        high = view.graphics == "high"
        scene.configure_default_lights(enabled=True, cast_shadow=high)
        scene.configure_environment_map(
            "studio" if high else None, environment_intensity=0.25 if view.dark else 0.45
        )
        # Without an environment map nothing lights what faces away from the lamps.
        scene.add_light_ambient("/ambient", intensity=0.0 if high else 1.2)
        scene.add_grid(
            "/floor",
            infinite_grid=True,
            cell_size=0.1,
            section_size=0.5,
            cell_color=(52, 58, 70) if view.dark else (226, 230, 236),
            section_color=(74, 84, 100) if view.dark else (196, 204, 214),
            fade_distance=9.0,
            shadow_opacity=0.25 if high else 0.0,
        )

    def draw(self, world: World) -> None:
        """One frame of a lab, to whoever looks."""
        if not self._server.get_clients() and self._frame:
            return  # Nobody looks; the first frame is drawn for whoever comes.
        self._drawn.clear()
        # One window a frame: what moves together arrives together, and Viser's loop wakes once.
        with self._server.atomic():
            world.lab.draw(self, world.params, world.state)
            for name, node in self._nodes.items():
                node.show(name in self._drawn)
        self._frame += 1

    # What a lab draws -----------------------------------------------------------------------

    def camera(self, position: ArrayLike, look_at: ArrayLike) -> None:
        wanted = (_three(position), _three(look_at))
        if wanted == self._camera:
            return
        self._camera = wanted
        self._server.initial_camera.position, self._server.initial_camera.look_at = wanted
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = wanted

    def arm(
        self,
        name: str,
        arm: Arm,
        q: np.ndarray,
        *,
        ghost: bool = False,
        effort: np.ndarray | None = None,
    ) -> None:
        look = (id(arm), ghost)
        node = self._node(name, look, lambda: _ArmNode(self._server, name, arm, ghost, self._view))
        assert isinstance(node, _ArmNode)
        node.move(q)
        if effort is not None:
            node.rings(effort)

    def trail(self, name: str, points: np.ndarray, color: Color = "actual") -> None:
        if len(points) < 2:
            return
        segments = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)

        def make() -> _Node:
            return _Node(
                self._server.scene.add_line_segments(
                    f"/{name}", segments, COLORS[color], thickness=2.5, thickness_units="screen"
                )
            )

        node = self._node(name, color, make)
        if self._frame % TRAIL_EVERY == 0:
            node.send("points", segments)

    def arrow(self, name: str, start: ArrayLike, end: ArrayLike, color: Color = "force") -> None:
        points = np.array([[_three(start), _three(end)]], np.float32)

        def make() -> _Node:
            return _Node(
                self._server.scene.add_arrows(
                    f"/{name}",
                    points,
                    COLORS[color],
                    shaft_radius=0.012,
                    head_radius=0.03,
                    head_length=0.07,
                )
            )

        self._node(name, color, make).send("points", points)

    def sphere(self, name: str, center: ArrayLike, radius: float, color: Color = "actual") -> None:
        def make() -> _Node:
            return _Node(self._server.scene.add_icosphere(f"/{name}", radius, color=COLORS[color]))

        self._node(name, (radius, color), make).place(np.asarray(center))

    def frame(self, name: str, placement: pin.SE3, length: float = 0.15) -> None:
        def make() -> _Node:
            return _Node(
                self._server.scene.add_frame(
                    f"/{name}", axes_length=length, axes_radius=0.04 * length, origin_radius=0.0
                )
            )

        node = self._node(name, length, make)
        node.place(placement.translation)
        node.turn(pin.SE3ToXYZQUAT(placement)[[6, 3, 4, 5]])

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

        def make() -> _Node:
            return _Node(
                self._server.scene.add_line_segments(
                    f"/{name}", segments, COLORS[color], thickness=4.0, thickness_units="screen"
                )
            )

        self._node(name, color, make).send("points", segments)

    def ellipsoid(
        self, name: str, center: ArrayLike, axes: np.ndarray, color: Color = "actual"
    ) -> None:
        vertices, faces = meshes.ball()

        def make() -> _Node:
            return _Node(
                self._server.scene.add_mesh_simple(
                    f"/{name}",
                    vertices @ axes.T,
                    faces,
                    color=COLORS[color],
                    opacity=0.3,
                    side="double",
                    cast_shadow=False,
                )
            )

        node = self._node(name, color, make)
        node.send("vertices", (vertices @ axes.T).astype(np.float32))
        node.place(np.asarray(center))

    def handle(self, name: str, position: ArrayLike, radius: float = 0.05) -> None:
        def make() -> _Node:
            ball = self._server.scene.add_icosphere(
                f"/{name}", radius, color=COLORS["force"], opacity=0.35, cast_shadow=False
            )

            # Asynchronous: these run in order on Viser's event loop.
            async def dragged(event: Any) -> None:
                held = event.phase != "end"
                point = tuple(map(float, event.end_position)) if held else None
                self._mailbox.put("hold", handle=name, point=point)

            ball.on_drag("left")(dragged)
            return _Node(ball)

        self._node(name, radius, make).place(np.asarray(position))

    def label(self, name: str, text: str, position: ArrayLike) -> None:
        def make() -> _Node:
            return _Node(self._server.scene.add_label(f"/{name}", text))

        node = self._node(name, "label", make)
        node.send("text", text)
        node.place(np.asarray(position))

    # Nodes ----------------------------------------------------------------------------------

    def _node(self, name: str, look: object, make: "Callable[[], _Node]") -> "_Node":
        """The node of this name, made anew where it must look different."""
        node = self._nodes.get(name)
        if node is None or node.look != look:
            if node is not None:
                node.remove()
            node = self._nodes[name] = make()
            node.look = look
        self._drawn.add(name)
        return node

    def _clear(self) -> None:
        for node in self._nodes.values():
            node.remove()
        self._nodes.clear()
        self._frame = 0


class _Node:
    """A Viser node that is sent only what changed."""

    def __init__(self, handle: Any) -> None:
        self.look: object = None
        self._handle = handle
        self._visible = True
        self._position = np.full(3, np.nan)
        self._wxyz = np.full(4, np.nan)
        self._sent: dict[str, Any] = {}

    def show(self, visible: bool) -> None:
        if visible != self._visible:
            self._visible = visible
            self._handle.visible = visible

    def place(self, position: np.ndarray) -> None:
        if not np.abs(position - self._position).max() < STILL:
            self._position = position.copy()
            self._handle.position = position

    def turn(self, wxyz: np.ndarray) -> None:
        if not np.abs(wxyz - self._wxyz).max() < STILL:
            self._wxyz = wxyz.copy()
            self._handle.wxyz = wxyz

    def send(self, prop: str, value: Any) -> None:
        if prop not in self._sent or not np.array_equal(self._sent[prop], value):
            self._sent[prop] = value
            setattr(self._handle, prop, value)

    def remove(self) -> None:
        self._handle.remove()


class _ArmNode(_Node):
    """An arm: a node a joint, nested as the joints are, with its pieces fixed to them."""

    def __init__(
        self, server: viser.ViserServer, name: str, arm: Arm, ghost: bool, view: View
    ) -> None:
        self._scene = server.scene
        super().__init__(self._scene.add_frame(f"/{name}", show_axes=False))
        self._model, self._data = arm.model, arm.model.createData()
        self._paths = [f"/{name}"]
        self._joints: list[Any] = []
        for joint in range(1, self._model.njoints):
            path = f"{self._paths[self._model.parents[joint]]}/{self._model.names[joint]}"
            self._paths.append(path)
            self._joints.append(self._scene.add_frame(path, show_axes=False))
        self._poses = np.full((self._model.njoints - 1, 7), np.nan)
        pieces = arm.visuals if view.graphics == "high" and not ghost else arm.collisions
        for index, piece in enumerate(pieces):
            self._piece(f"{self._paths[piece.joint]}/piece{index}", piece, ghost, view)
        self._rings: list[Any] = []
        self._levels: list[int] = []

    def move(self, q: np.ndarray) -> None:
        """Places every joint that moved in its parent's frame."""
        pin.forwardKinematics(self._model, self._data, q)
        in_parent = self._data.liMi
        poses = np.array([pin.SE3ToXYZQUAT(in_parent[j]) for j in range(1, self._model.njoints)])
        # Not "moved by more": the first poses are compared with NaN.
        still = np.abs(poses - self._poses) < STILL
        for joint in np.flatnonzero(~still[:, 3:].all(axis=1)):
            self._joints[joint].wxyz = poses[joint, [6, 3, 4, 5]]
            self._poses[joint, 3:] = poses[joint, 3:]
        for joint in np.flatnonzero(~still[:, :3].all(axis=1)):
            self._joints[joint].position = poses[joint, :3]
            self._poses[joint, :3] = poses[joint, :3]

    def rings(self, effort: np.ndarray) -> None:
        """A ring on every joint near its torque limit: amber from 0.8, red at the limit."""
        if not self._rings:
            self._rings = [self._ring(joint) for joint in range(1, self._model.njoints)]
            self._levels = [0] * len(self._rings)
        for joint, handle in enumerate(self._rings):
            level = int(effort[joint] >= 0.8) + int(effort[joint] >= 0.999)
            if level != self._levels[joint]:
                self._levels[joint] = level
                handle.visible = level > 0
                handle.color = COLORS["warning"] if level == 2 else AMBER

    def _ring(self, joint: int) -> Any:
        subspace = np.reshape(self._model.joints[joint].createData().S, (6, -1))[:, 0]
        # About the axis a joint turns about; where it slides, around the direction it slides in.
        axis = subspace[3:] if subspace[3:].any() else subspace[:3]
        vertices, faces = meshes.torus(0.095, 0.009)
        return self._scene.add_mesh_simple(
            f"{self._paths[joint]}/ring",
            vertices,
            faces,
            color=AMBER,
            wxyz=_turn_z_to(axis),
            visible=False,
            cast_shadow=False,
        )

    def _piece(self, path: str, piece: Visual, ghost: bool, view: View) -> None:
        pose = pin.SE3ToXYZQUAT(piece.placement)
        place = {"position": pose[:3], "wxyz": pose[[6, 3, 4, 5]]}
        if piece.mesh and view.graphics == "high" and not ghost:
            self._scene.add_glb(path, meshes.gltf(piece), **place)
            return
        vertices, faces = meshes.triangles(piece)
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


def _turn_z_to(axis: np.ndarray) -> np.ndarray:
    quaternion = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis)
    return np.asarray(quaternion.coeffs()[[3, 0, 1, 2]])


def _three(point: ArrayLike) -> tuple[float, float, float]:
    x, y, z = np.asarray(point, float)
    return (float(x), float(y), float(z))
