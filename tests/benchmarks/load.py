"""Many live sessions at once: real-time factors, memory, and the time of a step."""

import os
import statistics
import time
from contextlib import ExitStack

import psutil

from tests.benchmarks.viewers import ViewerProcess
from tests.server_process import ServerProcess, SessionClient

LAB = "joint-control"


def twelve_sessions(seconds: float = 60.0) -> None:
    """12 live sessions, each with a viewer."""
    with ServerProcess(ORCLAB_MAX_SESSIONS="32") as server:
        _measure(server, 12, seconds, details=True)


def step_time_by_sessions(seconds: float = 10.0) -> None:
    """The time of a step as sessions grow in number."""
    print(f"{'sessions':>8} {'step [ms]':>10} {'RTF least':>10} {'RTF median':>11} {'CPU [%]':>8}")
    for count in (1, 2, 4, 8, 12, 16, 24):
        with ServerProcess(ORCLAB_MAX_SESSIONS="32") as server:
            _measure(server, count, seconds, details=False)


def _measure(server: ServerProcess, count: int, seconds: float, details: bool) -> None:
    with ExitStack() as stack:
        opened = [stack.enter_context(server.session(LAB)) for _ in range(count)]
        crowd = stack.enter_context(ViewerProcess(server.address, [o.info for o in opened]))
        time.sleep(5.0)
        crowd.statuses()
        cpu, begin = _cpu(server), time.perf_counter()
        time.sleep(seconds)
        heard = crowd.statuses()
        elapsed = time.perf_counter() - begin
        cpu = _cpu(server) - cpu
        factors = [_real_time_factor(heard[o.info["id"]]) for o in opened]
        steps = [s["step_seconds"] for o in opened for s in heard[o.info["id"]]]
        share = 100 * cpu / elapsed
        if details:
            _report(server, opened, factors, share, seconds)
        else:
            print(
                f"{count:8d} {1e3 * statistics.mean(steps):10.2f} {min(factors):10.3f} "
                f"{statistics.median(factors):11.3f} {share:8.0f}"
            )


def _real_time_factor(statuses: list[dict[str, float]]) -> float:
    """Simulated over wall-clock time, from the first status heard to the last."""
    return (statuses[-1]["t"] - statuses[0]["t"]) / (statuses[-1]["wall"] - statuses[0]["wall"])


def _cpu(server: ServerProcess) -> float:
    """[s] of CPU the server and all below it have used."""
    processes = [psutil.Process(server.process.pid), *server.workers()]
    return sum(sum(p.cpu_times()[:2]) for p in processes)


def _report(
    server: ServerProcess,
    opened: list[SessionClient],
    factors: list[float],
    share: float,
    seconds: float,
) -> None:
    workers = [psutil.Process(pid) for pid in server.listeners()]
    own = sorted(p.memory_full_info().uss / 2**20 for p in workers)
    print(f"{len(opened)} sessions, each with a viewer, {seconds:g} s, {os.cpu_count()} cores")
    print(f"  real-time factor: least {min(factors):.3f}, median {statistics.median(factors):.3f}")
    print(f"  memory of its own: most {own[-1]:.0f} MB, median {statistics.median(own):.0f} MB")
    print(f"  CPU of the server and its workers: {share:.0f} % of one core")
