"""How soon an optimal motion is on screen after a weight was dragged."""

import statistics
import time
from collections.abc import Mapping

import numpy as np

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.optimal_control.ddp.lab import DdpState
from labs.params import Knob, Value
from tests.labs.solving import solve_to_convergence
from tests.server_process import ServerProcess
from tests.viser_client import SceneClient

MOVES = 40
REACH: Mapping[str, Value] = {"system": "ur5", "horizon": 1.0, "h": 0.01, "goal": 3000.0}
"""100 steps of 10 ms."""


def weight_to_motion() -> None:
    """From the message of a weight's slider, over all iterations of the new solve, to the scene
    message with the path of the UR5's new motion: the same, bit for bit, as a world beside it
    finds from the same changes."""
    twin = World(find_lab("ddp"), REACH)
    knob = twin.params.tunables["control"]
    assert isinstance(knob, Knob)
    solve_to_convergence(twin)
    with (
        ServerProcess() as server,
        server.session("ddp", params=REACH) as session,
        SceneClient(session) as scene,
    ):
        scene.control(knob.label)
        scene.read_for(2.0)
        times, iterations = [], []
        for k in range(MOVES):
            weight = knob.nearest(0.3 + 0.02 * k if k % 2 else 1.5 + 0.02 * k)
            twin.change({"control": weight})
            iterations.append(solve_to_convergence(twin))
            path = _on_the_wire(twin)
            scene.read_for(0.2 + 0.001 * (k % 37))  # not in step with the frames
            begin = time.perf_counter()
            scene.set(knob.label, knob.position(weight))
            while path not in scene.socket.recv(20.0):
                pass
            times.append(time.perf_counter() - begin)
    print(
        f"weight to re-solved UR5 motion, {MOVES} moves of {min(iterations)} to "
        f"{max(iterations)} iterations: median {1e3 * statistics.median(times):.1f} ms, "
        f"p95 {1e3 * statistics.quantiles(times, n=20)[-1]:.1f} ms, most {1e3 * max(times):.1f} ms"
    )


def _on_the_wire(world: World) -> bytes:
    """The path of the plan's tip, as the scene sends it."""
    assert isinstance(world.state, DdpState)
    path = world.state.history.tip_paths[-1]
    return np.stack([path[:-1], path[1:]], axis=1).astype(np.float32).tobytes()
