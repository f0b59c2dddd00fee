"""How soon the UR5's optimal reach is on screen after its target was dragged, and whether the scene
keeps moving meanwhile."""

import math
import statistics
import time
from collections.abc import Mapping

import numpy as np

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.params import Value
from labs.tasks.direct.picture import join_pieces
from labs.tasks.direct.player import DirectState
from tests.labs.solving import solve_to_convergence
from tests.server_process import ServerProcess
from tests.viser_client import SceneClient, message

MOVES = 30
LAB = "collocation"
REACH: Mapping[str, Value] = {"system": "ur5", "horizon": 1.0}
"""From rest to rest, 30 steps."""
START = (0.4, -0.35, 0.25)
"""[m] where the target is at first."""


def target_to_motion() -> None:
    """From a drag's message, over all iterations of the new solve, to the scene message with the
    path of the UR5's new motion: the same, bit for bit, as a world beside it finds from the same
    changes. At most 300 ms (median), with 30 scene messages a second in every solve."""
    twin = World(find_lab(LAB), REACH)
    solve_to_convergence(twin)
    with (
        ServerProcess() as server,
        server.session(LAB, params=dict(REACH)) as session,
        SceneClient(session) as scene,
    ):
        with session.stream() as stream:
            stream.next("status", lambda s: s["solver"]["done"])
        scene.wait_for_node("/target")
        scene.read_for(1.0)
        scene.socket.send(_drag("start", START))
        times, rates, iterations = [], [], []
        for k in range(1, MOVES + 1):
            angle = 2.0 * math.pi * k / MOVES
            place = (0.4 + 0.1 * math.sin(angle), -0.25 - 0.1 * math.cos(angle), 0.25)
            twin.change(twin.lab.edit(twin.params, "target", place))
            iterations.append(solve_to_convergence(twin))
            path = _on_the_wire(twin)
            scene.read_for(0.3 + 0.001 * (k % 37))  # not in step with the frames
            begin, frames = time.perf_counter(), 0
            scene.socket.send(_drag("update", place))
            while path not in _window(scene):
                frames += 1
            times.append(time.perf_counter() - begin)
            rates.append((frames + 1) / times[-1])
        scene.socket.send(_drag("end", place))
    print(
        f"target to re-solved UR5 reach, {MOVES} moves of {min(iterations)} to "
        f"{max(iterations)} iterations: median {1e3 * statistics.median(times):.0f} ms, "
        f"p95 {1e3 * statistics.quantiles(times, n=20)[-1]:.0f} ms, most {1e3 * max(times):.0f} ms"
    )
    print(
        f"scene messages while it solves: median {statistics.median(rates):.0f}/s, "
        f"slowest solve {min(rates):.0f}/s"
    )


def _window(scene: SceneClient) -> bytes:
    found = scene.socket.recv(20.0)
    assert isinstance(found, bytes)
    return found


def _on_the_wire(world: World) -> bytes:
    """The path of the plan's tip, as the scene sends it."""
    assert isinstance(world.state, DirectState)
    (path,) = join_pieces(world.state.history.tips[-1])
    return np.stack([path[:-1], path[1:]], axis=1).astype(np.float32).tobytes()


def _drag(phase: str, place: tuple[float, float, float]) -> bytes:
    return message(
        "SceneNodeDragMessage",
        phase=phase,
        name="/target",
        instance_index=None,
        start_position=START,
        start_screen_pos=(0.0, 0.0),
        end_position=place,
        end_screen_pos=(0.0, 0.0),
        button="left",
        modifier=None,
        owner="",
    )
