"""Tables in the scene: boards that are clicked, surfaces, and many arrows at once."""

import io
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import trimesh
import viser

from server import boards
from server.boards import SurfaceNode, surface_glb
from server.mailbox import Mailbox
from server.messages import View
from server.viser_scene import ViserScene
from tests.server_process import ServerProcess
from tests.viser_client import SceneClient, message

LOW = View(graphics="low")


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server
    server.stop()


def click(x: float, y: float) -> bytes:
    """On the board of the sample lab, along a ray that falls slantwise on (x, y, 0.02)."""
    return message(
        "SceneNodeClickMessage",
        name="/board",
        instance_index=0,
        ray_origin=(x + 0.5, y - 1.0, 2.02),
        ray_direction=(-0.25, 0.5, -1.0),
        screen_pos=(0.5, 0.5),
        modifier=None,
        owner="",
    )


# Boards ---------------------------------------------------------------------------------------


def test_a_click_on_a_board_is_an_edit(shared_server: ServerProcess) -> None:
    with (
        shared_server.session("board") as session,
        session.stream() as stream,
        SceneClient(session) as scene,
    ):
        rows = session.info["params"]["map"].split("\n")
        assert rows[2][4] == "#"
        freed = [*rows[:2], rows[2][:4] + "." + rows[2][5:], *rows[3:]]

        def becomes(expected: list[str]) -> None:
            stream.next("status", lambda s: s["params"]["map"] == "\n".join(expected))

        scene.wait_for_node("/board")
        scene.socket.send(click(0.05, 0.05))
        becomes(freed)
        scene.socket.send(click(0.05, 0.05))
        becomes(rows)
        scene.socket.send(click(0.05, 0.45))  # beside the board
        scene.socket.send(click(-0.35, -0.25))
        becomes([*rows[:5], "#" + rows[5][1:]])


def test_a_click_is_never_lost_among_others() -> None:
    mailbox = Mailbox()
    for point in ((0.0, 0.0, 0.0), None, (1.0, 0.0, 0.0), None):
        mailbox.put("hold", handle="board", point=point)
    seen = [item.arguments["point"] for item in mailbox.take(0.0)]
    assert seen == [(0.0, 0.0, 0.0), None, (1.0, 0.0, 0.0), None]


def test_a_drag_merges_and_its_last_point_is_kept() -> None:
    mailbox = Mailbox()
    for x in (0.0, 1.0, 2.0):
        mailbox.put("hold", handle="ball", point=(x, 0.0, 0.0))
    mailbox.put("hold", handle="ball", point=None)
    seen = [item.arguments["point"] for item in mailbox.take(0.0)]
    assert seen == [(2.0, 0.0, 0.0), None]


def test_only_the_colours_of_a_board_are_sent_again_and_only_while_they_change(
    shared_server: ServerProcess,
) -> None:
    def updates(end: str) -> list[dict[str, Any]]:
        """What scene nodes are sent until the theme changes."""
        session.command("view", view={"dark": end == "dark", "graphics": "low"})
        found: list[dict[str, Any]] = []
        for m in scene.messages():
            if m["type"] == "ThemeConfigurationMessage" and m["dark_mode"] == (end == "dark"):
                return found
            if m["type"] == "SceneNodeUpdateMessage":
                found.append(m)
        raise AssertionError

    with shared_server.session("board") as session, SceneClient(session) as scene:
        scene.wait_for_node("/board")
        updates("dark")  # what belongs to the first picture
        updates("light")
        waving = {m["name"].partition("#")[0]: m["updates"] for m in _advance_clock(scene, 120)}
        assert set(waving["/board"]) == {"batched_colors"}
        session.set(rate=0.0)
        updates("dark")  # what was under way
        updates("light")
        assert updates("dark") == []


def _advance_clock(scene: SceneClient, count: int) -> list[dict[str, Any]]:
    found = (m for m, _ in zip(scene.messages(), range(count), strict=False))
    return [m for m in found if m["type"] == "SceneNodeUpdateMessage"]


# Surfaces -------------------------------------------------------------------------------------


def wavy_surface(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-1, 1, rows))
    points = np.stack([x, y, np.sin(3 * x) * y], axis=-1)
    return points, np.asarray(np.random.default_rng(0).uniform(0, 1, points.shape))


@pytest.mark.parametrize(("rows", "columns"), [(2, 2), (3, 7), (300, 300)])
def test_a_surface_is_sound_gltf_that_others_read(rows: int, columns: int) -> None:
    points, colors = wavy_surface(rows, columns)
    scene: Any = trimesh.load_scene(io.BytesIO(surface_glb(points, colors, 1.0)), file_type="glb")
    (mesh,) = scene.geometry.values()
    np.testing.assert_allclose(mesh.vertices, points.reshape(-1, 3), atol=1e-6)
    assert len(mesh.faces) == 2 * (rows - 1) * (columns - 1)
    assert mesh.area > 4.0, "no less than the square it stands on"
    projected = mesh.triangles[:, :, :2]
    one, other = projected[:, 1] - projected[:, 0], projected[:, 2] - projected[:, 0]
    turns = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    assert np.abs(turns).sum() / 2 == pytest.approx(4.0, rel=1e-5), "it is covered once"
    assert len(set(np.sign(turns))) == 1, "all faces look the same way"


def test_a_colour_is_sent_linear_and_darker_where_the_light_is_brighter() -> None:
    """sRGB 0.5 is 0.2140 of full light."""
    points, _ = wavy_surface(2, 2)
    grey = np.full((2, 2, 3), 0.5)
    for exposure in (1.0, 2.0):
        sent = np.frombuffer(surface_glb(points, grey, exposure)[-12 - 32 : -12], "<u2").reshape(
            4, 4
        )
        np.testing.assert_allclose(sent[:, :3] / 65535, 0.2140 / exposure, atol=1e-4)
        assert (sent[:, 3] == 65535).all(), "opaque"


def test_a_surface_is_replaced_only_once_the_new_one_is_there(
    server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 100.0
    monkeypatch.setattr("server.boards.time.monotonic", lambda: now)
    points, colors = wavy_surface(4, 5)
    node = SurfaceNode(server, "wave", points, colors, LOW)
    first, second = node._shown, node._hidden
    assert (first.visible, second.visible) == (True, False)
    now += 1.0
    node.draw(points, colors)
    assert node._shown is first, "nothing changed"
    node.draw(points + 1.0, colors)
    assert second.glb_data == surface_glb(points + 1.0, colors, boards.exposure(LOW))
    assert (first.visible, second.visible) == (True, False)
    now += 0.05
    node.draw(points + 2.0, colors)
    assert (first.visible, second.visible) == (True, False), "not yet prepared"
    now += 0.1
    node.draw(points + 2.0, colors)
    assert (first.visible, second.visible) == (False, True)
    now += 0.1
    node.draw(points + 2.0, colors)
    assert first.glb_data == surface_glb(points + 2.0, colors, boards.exposure(LOW))
    assert (first.visible, second.visible) == (False, True)


def test_what_stands_upright_is_made_less_dark_than_what_lies() -> None:
    flat = np.stack([*np.meshgrid([0.0, 1.0], [0.0, 1.0]), np.zeros((2, 2))], axis=-1)
    relief, _ = wavy_surface(4, 5)
    for view in (LOW, View(graphics="high")):
        lying = boards.exposure(view)
        assert boards.exposure(view, flat) == boards.exposure(view, relief) == lying
        for way in ([2, 0, 1], [1, 2, 0]):
            assert boards.exposure(view, flat[..., way]) < lying
            grown_from = flat[..., way] * [1.0, 1.0, 0.0]  # a line along x or y
            assert boards.exposure(view, grown_from) == boards.exposure(view, flat[..., way])


# Arrows ---------------------------------------------------------------------------------------


def test_many_arrows_are_one_node_without_those_of_no_length(server: viser.ViserServer) -> None:
    scene = ViserScene(server, Mailbox(), LOW)
    starts = np.zeros((600, 3))
    ends = np.tile([0.1, 0.0, 0.0], (600, 1))
    ends[7] = 0.0
    scene.arrows("policy", starts, ends)
    node = scene._nodes["policy"]
    assert node._handle.points.shape == (599, 2, 3)
    assert 0.02 < node._handle.head_length < 0.05, "a head fits its arrow"
    ends[1:] = 0.0
    scene.arrows("policy", starts, ends)
    assert scene._nodes["policy"] is node
    assert node._handle.points.shape == (1, 2, 3)
    assert scene._nodes.end_frame() == [node]
    for none in (starts, np.empty((0, 3))):
        scene.arrows("policy", none, none)
    assert scene._nodes.end_frame() == [], "where there is no arrow nothing is shown"


# Polygons and dots ----------------------------------------------------------------------------


def test_a_polygon_keeps_its_mesh_while_it_gains_corners(server: viser.ViserServer) -> None:
    scene = ViserScene(server, Mailbox(), LOW)

    def drawn(corners: int) -> tuple[Any, float]:
        """Its node, and the area of its triangles."""
        angles = np.linspace(0.0, 2 * np.pi, corners, endpoint=False)
        round_ = np.stack([np.cos(angles), np.sin(angles), np.ones(corners)], axis=1)
        scene.polygon("set", round_, (0.2, 0.5, 0.7), 0.5)
        node = scene._nodes["set"]
        mesh = trimesh.Trimesh(node._handle.vertices, node._handle.faces, process=False)
        return node, float(mesh.area)

    triangle, area = drawn(3)
    assert area == pytest.approx(3 * np.sqrt(3) / 4)
    octagon, area = drawn(8)
    assert octagon is triangle
    assert area == pytest.approx(2 * np.sqrt(2))
    more, area = drawn(9)
    assert more is not triangle
    assert area == pytest.approx(4.5 * np.sin(2 * np.pi / 9))


def test_many_dots_and_many_lines_are_one_node_each(server: viser.ViserServer) -> None:
    scene = ViserScene(server, Mailbox(), LOW)
    places = np.random.default_rng(0).normal(size=(500, 4, 3))
    scene.trail("runs", places)
    np.testing.assert_allclose(
        scene._nodes["runs"]._handle.points,
        np.stack([places[:, :-1], places[:, 1:]], axis=2).reshape(-1, 2, 3),
        rtol=1e-6,
    )
    scene.dots("states", places[:, 0], 0.02)
    node = scene._nodes["states"]
    np.testing.assert_allclose(node._handle.points, places[:, 0], rtol=1e-6)
    scene.dots("states", places[:7, 1], 0.02)
    assert scene._nodes["states"] is node
    assert node._handle.points.shape == (7, 3)
    scene._nodes.end_frame()
    scene.dots("states", np.empty((0, 3)), 0.02)
    scene.trail("runs", np.empty((0, 4, 3)))
    assert scene._nodes.end_frame() == []
