"""How soon a hand's doing shows: from a slider to the plots, from a page's request to motion."""

import contextlib
import json
import statistics
import threading
import time
from queue import Queue
from typing import Any

from websockets.exceptions import ConnectionClosed

from labs.engine.catalog import find_lab
from tests.server_process import ServerProcess, SessionClient
from tests.viser_client import SceneClient

TRIES = 150


def slider_to_telemetry() -> None:
    """From a slider's message on the scene's socket to the first telemetry computed with it: the
    amplitude of a set point is moved, and shows in the reference."""
    params = {"reference": "set-point", "amplitude": 0.2}
    with (
        ServerProcess() as server,
        server.session("joint-control", params=params) as session,
        SceneClient(session) as scene,
    ):
        times = _moves(session, scene)
    print(
        f"slider to telemetry, {len(times)} moves: median {1e3 * statistics.median(times):.1f} ms, "
        f"p95 {1e3 * _p95(times):.1f} ms, most {1e3 * max(times):.1f} ms"
    )


def _moves(session: SessionClient, scene: SceneClient) -> list[float]:
    label = next(label for label in _labels(scene) if "mplitude" in label)
    heard: Queue[tuple[float, float]] = Queue()
    with session.stream() as stream:
        columns = stream.next("hello")["columns"]
        reference = columns.index("q_ref[0]")

        def listen() -> None:
            for text in stream.socket:
                now = time.perf_counter()
                message = json.loads(text)
                if message["type"] == "telemetry" and message["rows"]:
                    heard.put((now, message["rows"][-1][reference]))

        def look() -> None:
            with contextlib.suppress(ConnectionClosed):  # at the end
                for _ in scene.messages():
                    pass

        threading.Thread(target=listen, daemon=True).start()
        threading.Thread(target=look, daemon=True).start()
        times = []
        for k in range(TRIES):
            while not heard.empty():
                last = heard.get()[1]
            before = heard.get()[1]
            begin = time.perf_counter()
            scene.set(label, 0.125 if k % 2 else 0.375)  # of 0.8 rad
            while True:
                now, last = heard.get(timeout=5)
                if abs(last - before) > 1e-3:
                    break
            times.append(now - begin)
            time.sleep(0.05 + 0.001 * (k % 37))  # not in step with the frames
    return times


def _labels(scene: SceneClient) -> list[str]:
    scene.read_until(lambda _: any("mplitude" in label for label in scene.controls))
    return list(scene.controls)


def slider_to_scene() -> None:
    """From a joint slider's message to the scene message that turns the joint, in a lab where
    nothing else moves."""
    with (
        ServerProcess() as server,
        server.session("kinematics") as session,
        SceneClient(session) as scene,
    ):
        label = find_lab("kinematics").lab.Params.tunables["q1"].label
        scene.control(label)
        times = []
        for k in range(TRIES):
            scene.read_for(0.05 + 0.001 * (k % 37))  # not in step with the frames
            begin = time.perf_counter()
            scene.set(label, 0.6 if k % 2 else 0.4)
            scene.read_until(_turns_first_joint)
            times.append(time.perf_counter() - begin)
    print(
        f"slider to scene, {len(times)} moves: median {1e3 * statistics.median(times):.1f} ms, "
        f"p95 {1e3 * _p95(times):.1f} ms, most {1e3 * max(times):.1f} ms"
    )


def _turns_first_joint(found: dict[str, Any]) -> bool:
    return found["type"] == "SetOrientationMessage" and str(found["name"]).endswith(
        "shoulder_pan_joint"
    )


def page_to_motion() -> None:
    """From the page's request to the first scene message in which the robot moves."""
    with ServerProcess() as server:
        warm = []
        for _ in range(5):
            warm.append(_open(server))
            time.sleep(3.0)  # the next spare warms up
    with ServerProcess(ORCLAB_SPARES="0") as server:
        first = _open(server)
        cold = [_open(server) for _ in range(3)]
    print(
        f"page to motion, warm spare: median {statistics.median(warm):.2f} s, "
        f"most {max(warm):.2f} s"
    )
    print(
        f"page to motion, no spare: {statistics.median(cold):.2f} s; "
        f"the first after the server's start: {first:.2f} s"
    )


def _open(server: ServerProcess) -> float:
    begin = time.perf_counter()
    server.http.get("/labs/joint-control")
    with server.session("joint-control") as session:
        server.http.get(session.info["scene"])
        with SceneClient(session) as scene:
            seen: set[str] = set()
            while True:
                name = scene.read_until(lambda m: m["type"] == "SetOrientationMessage")["name"]
                if name.endswith("_joint") and name in seen:
                    return time.perf_counter() - begin
                seen.add(name)


def _p95(times: list[float]) -> float:
    return statistics.quantiles(times, n=20)[-1]
