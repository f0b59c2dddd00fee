"""Whether the scene keeps moving while a solver works as fast as it can."""

import threading
import time
from collections.abc import Mapping

from labs.params import Value
from tests.server_process import ServerProcess
from tests.viser_client import SceneClient

SOLVES: Mapping[str, tuple[str, Mapping[str, Value]]] = {
    "deep Q-learning, pendulum, 3 learners": ("dqn", {"learners": 3.0, "steps": 100000.0}),
    "deep Q-learning, double pendulum": ("dqn", {"system": "double-pendulum", "width": 128.0}),
    "Q-learning and SARSA, pendulum": ("td-control", {"system": "pendulum", "episodes": 2000.0}),
    "Q-learning and SARSA, cliff": ("td-control", {"episodes": 2000.0}),
    "TD(lambda), 19 states": ("td-lambda", {"episodes": 100.0}),
    "value iteration, pendulum": (
        "dynamic-programming",
        {"world": "pendulum", "nodes": 101.0, "gamma": 0.995},
    ),
    "UR5 reach by DDP, with f''": ("ddp", {"system": "ur5", "method": "ddp"}),
}


def while_solving() -> None:
    """Windows of scene messages a second from a reset until the solver is done."""
    print("                                   solved in   scene, mean   slowest half second")
    with ServerProcess() as server:
        for name, (lab, params) in SOLVES.items():
            times, seconds = _arrival_times(server, lab, params)
            rate, worst = _rates(times)
            print(f"{name:34} {seconds:7.2f} s {rate:11.1f}/s {worst:16.1f}/s")


def _arrival_times(
    server: ServerProcess, lab: str, params: Mapping[str, Value]
) -> tuple[list[float], float]:
    """When windows of the scene came, from a reset until the solver was done; and that time."""
    with server.session(lab, params=dict(params)) as session, SceneClient(session) as scene:
        with session.stream() as stream:
            stream.next("status", lambda s: s["solver"]["done"])
        scene.read_for(1.0)
        times: list[float] = []
        done = threading.Event()

        def listen() -> None:
            with session.stream() as stream:
                run = stream.next("status")["run"]
                session.command("reset")
                again = stream.next("status", lambda s: s["run"] != run)
                while not again["solver"]["done"]:
                    again = stream.next("status")
            done.set()

        listener = threading.Thread(target=listen)
        listener.start()
        begin = time.perf_counter()
        while not done.is_set():
            scene.socket.recv(5.0)
            times.append(time.perf_counter())
        seconds = time.perf_counter() - begin
        listener.join()
    return times, seconds


def _rates(times: list[float]) -> tuple[float, float]:
    """[1/s] mean, and least over any half second (or over all, if it was shorter)."""
    mean = (len(times) - 1) / (times[-1] - times[0])
    counts = []
    for k, begin in enumerate(times):
        within = [t for t in times[k:] if t <= begin + 0.5]
        if begin + 0.5 <= times[-1]:
            counts.append(2.0 * len(within))
    return mean, min(counts, default=mean)
