"""How soon a knob that is turned on the page, in Chromium, shows: in the telemetry the page
receives, and in the message that moves the scene. Beside it, the same change sent by a bare client
of the session's WebSocket: what the page itself costs."""

import contextlib
import json
import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any

from playwright.sync_api import Page, sync_playwright
from websockets.sync.connection import Connection

from tests import chromium
from tests.browser.lab_page import LabPage
from tests.server_process import ServerProcess, SessionClient
from tests.viser_client import SceneClient

TRIES = 100
PAUSE = 0.05
"""[s] Between two moves, and a little more each time: not in step with the frames."""

TAP = """(() => {
  const Real = WebSocket;
  window.WebSocket = class extends Real {
    constructor(...given) {
      super(...given);
      if (!String(given[0]).endsWith("/stream")) return;
      this.addEventListener("message", (event) => {
        const now = performance.now();
        const message = JSON.parse(event.data);
        if (message.type === "hello") window.columns = message.columns;
        if (message.type === "telemetry") window.heard?.(message, now);
      });
    }
  };
})()"""
TURN = """([name, position, channel]) => new Promise((done) => {
  const track = document.getElementById(`track-${name}`);
  const column = window.columns.indexOf(channel);
  const latest = (message) => (message.rows.at(-1) ?? message.now)?.[column];
  let before, begin;
  window.heard = (message, now) => {
    const value = latest(message);
    if (begin === undefined) before = value;
    else if (Math.abs(value - before) > 1e-3) done(now - begin);
  };
  setTimeout(() => {
    track.value = position;
    begin = performance.now();
    track.dispatchEvent(new Event("input"));
  }, 100 + 20 * Math.random());
})"""
TURN_LATER = """([name, position]) => setTimeout(() => {
  const track = document.getElementById(`track-${name}`);
  track.value = position;
  window.begin = performance.timeOrigin + performance.now();
  track.dispatchEvent(new Event("input"));
}, 30 + 20 * Math.random())"""


def knob_to_telemetry() -> None:
    """joint-control's amplitude is turned, and shows in the reference."""
    params = {"reference": "set-point", "amplitude": 0.2}
    with ServerProcess() as server, _chromium(server) as open_page:
        with server.session("joint-control", params=params) as session:
            _report("bare client, knob to telemetry", _bare_telemetry(session))
        for scene in (False, True):
            page = open_page()
            LabPage(page, scene).open("joint-control", "?reference=set-point&amplitude=0.2")
            times = []
            for k in range(TRIES):
                position = 0.2 + 0.2 * (k % 2)
                times.append(page.evaluate(TURN, ["amplitude", position, "q_ref[0]"]))
            page.close()
            _report(f"page {'with' if scene else 'without'} its scene, knob to telemetry", times)


def knob_to_scene() -> None:
    """kinematics' first joint is turned where nothing else moves; a second viewer looks on."""
    with ServerProcess() as server, _chromium(server) as open_page:
        with server.session("kinematics") as session:
            _report("bare client, knob to scene", _bare_scene(session))
        page = open_page()
        lab = LabPage(page, scene=False).open("kinematics")
        times = []
        with SceneClient(SessionClient(server, lab.status())) as onlooker:
            for k in range(TRIES):
                onlooker.read_for(PAUSE)
                page.evaluate(TURN_LATER, ["q1", 0.4 + 0.1 * (k % 2)])
                onlooker.read_until(_turns_first_joint)
                seen = 1e3 * time.time()
                times.append(seen - page.evaluate("window.begin"))
        _report("page, knob to scene", times)


@contextlib.contextmanager
def _chromium(server: ServerProcess) -> Iterator[Callable[[], Page]]:
    path = chromium.find_browser()
    assert path, "needs a Chromium"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=chromium.ARGUMENTS)
        context = browser.new_context(
            base_url=server.address, viewport={"width": 1366, "height": 650}
        )
        context.add_init_script(TAP)
        yield context.new_page
        browser.close()


def _bare_telemetry(session: SessionClient) -> list[float]:
    times = []
    with session.stream() as stream:
        reference = stream.next("hello")["columns"].index("q_ref[0]")
        for k in range(TRIES):
            end = time.perf_counter() + PAUSE + 0.001 * (k % 37)
            last = stream.next("telemetry", lambda m: m["rows"] and time.perf_counter() > end)  # noqa: B023
            before = last["rows"][-1][reference]
            time.sleep(0.001 * (7 * k % 33))  # telemetry is thirty a second: not in step with it
            begin = time.perf_counter()
            _set(stream.socket, amplitude=0.1 if k % 2 else 0.3)
            stream.next("telemetry", lambda m: _moved(m["rows"], reference, before))  # noqa: B023
            times.append(1e3 * (time.perf_counter() - begin))
    return times


def _moved(rows: list[list[float]], column: int, before: float) -> bool:
    return any(abs(row[column] - before) > 1e-3 for row in rows)


def _bare_scene(session: SessionClient) -> list[float]:
    times = []
    with session.stream() as stream, SceneClient(session) as scene:
        for k in range(TRIES):
            scene.read_for(PAUSE + 0.001 * (k % 37))
            begin = time.perf_counter()
            _set(stream.socket, q1=0.5 if k % 2 else -0.5)
            scene.read_until(_turns_first_joint)
            times.append(1e3 * (time.perf_counter() - begin))
    return times


def _set(socket: Connection, **changes: float) -> None:
    socket.send(json.dumps({"type": "params", "ref": 1, "changes": changes}))


def _turns_first_joint(found: dict[str, Any]) -> bool:
    name = str(found.get("name"))
    return found["type"] == "SetOrientationMessage" and name.endswith("shoulder_pan_joint")


def _report(what: str, times: list[float]) -> None:
    print(
        f"{what:42} {len(times)} turns: median {statistics.median(times):5.1f} ms, "
        f"p95 {statistics.quantiles(times, n=20)[-1]:5.1f} ms, most {max(times):5.1f} ms"
    )
