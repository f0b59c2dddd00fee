"""How soon the sets of the plane are on screen after a limit was dragged."""

import json
import statistics
import time
from collections.abc import Mapping, Sequence
from typing import Any

from labs.algorithms.admissible_set import maximal_output_admissible_set
from labs.optimal_control.mpc_feasibility.params import MpcFeasibilityParams
from labs.optimal_control.mpc_feasibility.problem import feasibility
from labs.optimal_control.mpc_feasibility.sets import compute_sets
from labs.params import Value
from tests.server_process import ServerProcess
from tests.viser_client import SceneClient

MOVES = 60
SETTING: Mapping[str, Value] = {"u_max": 0.5, "horizon": 20.0, "terminal": "admissible"}


def wall_to_sets() -> None:
    """The wall of mpc-feasibility is dragged, N = 20: from the message of its knob to the scene's
    with the new terminal set, drawn above all X_i. Each wall is a new one: nothing is cached."""
    with (
        ServerProcess() as server,
        server.session("mpc-feasibility", params=SETTING) as session,
        session.stream() as stream,
        SceneClient(session) as scene,
    ):
        scene.read_for(3.0)
        times: list[float] = []
        for wall in _walls():
            scene.read_for(0.2 + 0.001 * (len(times) % 37))  # not in step with the frames
            message = {"type": "params", "ref": 1, "changes": {"p_max": wall}}
            begin = time.perf_counter()
            stream.socket.send(json.dumps(message))
            scene.read_until(_is_terminal_set)
            times.append(time.perf_counter() - begin)
    _report("wall dragged to sets drawn, N = 20, live", times)
    computed, admissible = [], []
    for wall in _walls():
        setup = MpcFeasibilityParams.model_validate({**SETTING, "p_max": wall}).setup
        begin = time.perf_counter()
        at = feasibility(setup)
        assert len(compute_sets(setup).chain) == 21
        computed.append(time.perf_counter() - begin)
        assert at.regulated_limits is not None
        begin = time.perf_counter()
        assert maximal_output_admissible_set(at.closed_loop_matrix, at.regulated_limits).found
        admissible.append(time.perf_counter() - begin)
    _report("of this, all sets computed", computed)
    _report("of those, the maximal output admissible set", admissible)


def _walls() -> Sequence[float]:
    return [round(0.85 + 0.005 * k, 4) for k in range(MOVES)]


def _is_terminal_set(found: dict[str, Any]) -> bool:
    return "X_f" in str(found.get("name"))


def _report(what: str, times: Sequence[float]) -> None:
    print(
        f"{what}: median {1e3 * statistics.median(times):.1f} ms, "
        f"p95 {1e3 * statistics.quantiles(times, n=20)[-1]:.1f} ms, most {1e3 * max(times):.1f} ms"
    )
