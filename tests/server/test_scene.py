"""The scene and its panel through the proxy, as a browser's client sees them."""

import contextlib
import re
from collections import Counter

import numpy as np
import pytest
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from labs.engine.catalog import find_lab
from labs.models.arms import load_arm
from server.mailbox import Mailbox
from server.messages import View
from server.nodes import COLORS, DARK, LIGHT, blend_with_background
from server.viser_scene import ViserScene
from tests.server_process import ServerProcess, wait_until
from tests.viser_client import PROTOCOL, SceneClient, camera_message, message


def test_the_viewers_script_comes_after_the_element_it_draws_in(
    shared_server: ServerProcess,
) -> None:
    """A load that is broken off may run the script, and then has what it draws in."""
    with shared_server.session("oscillator") as session:
        whole = shared_server.http.get(session.info["scene"]).text
        plain = shared_server.http.get(
            session.info["scene"], headers={"Accept-Encoding": "identity"}
        )
    assert whole == plain.text
    assert "content-encoding" not in plain.headers
    ours, script = (found.start() for found in re.finditer("<script", whole))
    (root,) = (found.start() for found in re.finditer('<div id="root"></div>', whole))
    assert whole.index("/static/css/scene.css") < ours < whole.index("</head>") < root < script
    assert whole[whole.rindex("</script>") :].split() == ["</script></body>", "</html>"]


def test_a_view_is_reset_after_a_hand_has_moved_it(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session, SceneClient(session) as scene:
        session.command("pause")
        scene.socket.send(camera_message((9.0, 9.0, 9.0)))

        def is_placed() -> bool:
            session.command("reset_view")  # which may overtake the hand, on a way of its own
            with contextlib.suppress(TimeoutError):
                for found in scene.messages(timeout=0.5):
                    if found["type"] == "SetCameraPositionMessage" and not found["initial"]:
                        return bool(np.linalg.norm(found["position"]) < 6.0)
            return False

        wait_until(is_placed)


def test_the_robot_is_a_tree_of_its_joints(shared_server: ServerProcess) -> None:
    chain = (
        "shoulder_pan_joint/shoulder_lift_joint/elbow_joint/wrist_1_joint/wrist_2_joint"
        "/wrist_3_joint"
    )
    with shared_server.session("joint-control") as session, SceneClient(session) as scene:
        turned: Counter[str] = Counter()
        for found, _ in zip(scene.messages(), range(600), strict=False):
            if found["type"] == "SetOrientationMessage":
                turned[found["name"]] += 1
        leaves = {name.split("/")[1] for name in scene.nodes if name.endswith(chain)}
        assert len(leaves) == 2, "the robot and its ghost"
        joints = {f"/{arm}/{'/'.join(chain.split('/')[:n])}" for arm in leaves for n in range(1, 7)}
        assert all(turned[joint] > 3 for joint in joints), "every joint of both turns"
        placed = {name: n for name, n in turned.items() if name not in joints}
        assert set(placed.values()) <= {1}, "what a joint carries is placed once"


def test_a_slider_in_the_panel_changes_the_world_and_the_page(shared_server: ServerProcess) -> None:
    with (
        shared_server.session("oscillator") as session,
        session.stream() as stream,
        SceneClient(session) as scene,
    ):
        scene.set("ω", 0.7475)  # from 0.1 to 10
        changed = stream.next("status", lambda s: s["params"]["omega"] == 7.5)
        assert changed["run"] == 1, "a live parameter restarts nothing"
        scene.wait_for_label("ω", "ω = 7.5 rad/s")
        scene.set("k_p", 1.0)
        stream.next("status", lambda s: s["params"]["gain"] == 1000.0)
        scene.wait_for_label("k_p", "k_p = 1000 1/s")
        scene.set("k_p", 0.0)
        stream.next("status", lambda s: s["params"]["gain"] == 0.0)
        scene.wait_for_label("k_p", "k_p = 0 1/s")


def test_a_change_through_the_api_moves_the_panel(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session, SceneClient(session) as scene:
        session.set(omega=5.05, shape="square", noisy=True, gain=1.2345)
        scene.wait_for_label("ω", "ω = 5.05 rad/s")
        scene.wait_for_value("ω", 0.5)
        scene.wait_for_value("Shape", "Square")
        scene.wait_for_value("Noise", True)
        scene.wait_for_label("k_p", "k_p = 1.2345 1/s")


def test_the_panel_has_what_matters_first_where_it_acts(shared_server: ServerProcess) -> None:
    with shared_server.session("joint-control") as session, SceneClient(session) as scene:
        scene.control("Push")
        keys = {
            tunable.label
            for tunable in find_lab("joint-control").lab.Params.tunables.values()
            if tunable.key
        }
        assert set(scene.controls) == {*keys, "Push"}
        integral = scene.control("k_i")
        session.set(controller="pid")
        scene.read_until(
            lambda m: m.get("uuid") == integral and m.get("updates", {}).get("visible") is True
        )


def test_the_panels_button_presses_the_action(shared_server: ServerProcess) -> None:
    with (
        shared_server.session("oscillator") as session,
        session.stream() as stream,
        SceneClient(session) as scene,
    ):
        scene.set("Kick", True)
        stream.next("telemetry", lambda m: m["rows"] and m["rows"][-1][5] == 1.0)


def test_a_dragged_handle_reaches_the_world(shared_server: ServerProcess) -> None:
    def drag(phase: str, x: float) -> bytes:
        return message(
            "SceneNodeDragMessage",
            phase=phase,
            name="/pull",
            instance_index=None,
            start_position=(0.0, 0.0, 0.8),
            start_screen_pos=(0.0, 0.0),
            end_position=(x, 0.0, 0.8),
            end_screen_pos=(0.0, 0.0),
            button="left",
            modifier=None,
            owner="",
        )

    with (
        shared_server.session("oscillator") as session,
        session.stream() as stream,
        SceneClient(session) as scene,
    ):
        scene.wait_for_node("/pull")
        scene.socket.send(drag("start", 0.1))
        scene.socket.send(drag("update", 0.75))
        stream.next("telemetry", lambda m: m["rows"] and m["rows"][-1][6] == 0.75)
        scene.socket.send(drag("end", 0.8))
        stream.next("telemetry", lambda m: m["rows"] and m["rows"][-1][6] == 0.0)
        changes = session.export()["changes"]
        assert [c["value"] for c in changes if c["kind"] == "hold"][-1] is None


@pytest.mark.parametrize("dark", [False, True])
def test_a_weaker_trail_is_nearer_to_what_is_behind_it(dark: bool) -> None:
    full, half, faint = (
        blend_with_background("actual", s, dark).astype(int) for s in (1.0, 0.5, 0.1)
    )
    behind = np.array(DARK if dark else LIGHT)
    assert full.tolist() == list(COLORS["actual"])
    distances = [np.linalg.norm(color - behind) for color in (full, half, faint)]
    assert distances == pytest.approx([distances[0], 0.5 * distances[0], 0.1 * distances[0]], abs=1)


def test_a_trail_fades_without_being_made_anew() -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        scene = ViserScene(server, Mailbox(), View(dark=True))
        points = np.zeros((3, 3))
        scene.trail("echo", points)
        node = scene._nodes["echo"]
        for strength in (1.0, 0.3):
            scene.trail("echo", points, strength=strength)
            shown = node._handle.colors
            assert shown.tolist() == blend_with_background("actual", strength, dark=True).tolist()
        assert scene._nodes["echo"] is node
    finally:
        server.stop()


def test_a_robot_in_anothers_place_has_nodes_of_its_own() -> None:
    """A viewer keeps the pose of a node that is removed and made again at once, and is not told a
    pose that is a node's default: the base of a UR5 hung where that of a pendulum had been."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)

    def nodes() -> set[str]:
        there = server.scene._handle_from_node_name
        return {name for name in there if name.startswith("/robot")} - {"/robot 1"}

    try:
        scene = ViserScene(server, Mailbox(), View(graphics="low"))
        past: set[str] = set()
        scene.trail("robot 1", np.zeros((2, 3)))  # a name of the lab's own
        trail = server.scene._handle_from_node_name["/robot 1"]
        for arm in (load_arm("double-pendulum"), load_arm("ur5"), load_arm("double-pendulum")):
            for ghost in (False, True):
                scene.arm("robot", arm, arm.home, ghost=ghost)
                assert nodes()
                assert not nodes() & past
                past |= nodes()
        assert server.scene._handle_from_node_name["/robot 1"] is trail
        scene.set_view(View(dark=True, graphics="low"))
        scene.arm("robot", arm, arm.home)
        assert nodes()
        assert not nodes() & past
    finally:
        server.stop()


def test_the_scene_of_an_unknown_session_is_closed_for_good(shared_server: ServerProcess) -> None:
    address = shared_server.address.replace("http", "ws") + "/scene/guess"
    with connect(address, subprotocols=[PROTOCOL]) as socket:  # type: ignore[list-item]
        with pytest.raises(ConnectionClosed) as closed:
            socket.recv()
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4404


def test_a_client_of_another_protocol_is_refused(shared_server: ServerProcess) -> None:
    with shared_server.session("oscillator") as session, pytest.raises(InvalidStatus):
        connect(shared_server.address.replace("http", "ws") + session.info["scene"].rstrip("/"))


def test_the_view_can_be_changed_while_it_runs(shared_server: ServerProcess) -> None:
    with shared_server.session("joint-control") as session, SceneClient(session) as scene:
        session.command("view", view={"dark": True, "graphics": "low"})
        scene.read_until(lambda m: m["type"] == "ThemeConfigurationMessage" and m["dark_mode"])
        scene.read_until(lambda m: "Mesh" in m["type"] and "wrist_3_joint" in m.get("name", ""))
