"""Value iteration on the pendulum, and what it costs as the grid grows."""

import resource
import time

import numpy as np

from labs.algorithms import value_iteration
from labs.problems.finite_mdp import FiniteMDP
from labs.tasks.pendulum_table.table import PendulumGrid

GAMMA, LEVELS, TOLERANCE = 0.98, 11, 1e-6
SIDES = (11, 21, 51, 101, 201, 501, 1001)


def on_the_pendulum() -> None:
    """101 x 101 states, 11 torques, until no value changes by more than 1e-6; then the same for
    grids from 11 x 11 to 1001 x 1001. All from V = 0, on one core."""
    _value_iteration(_mdp(11)[0])  # compiles
    mdp, _ = _mdp(101)
    seconds, sweeps = min(_value_iteration(mdp) for _ in range(5))
    print(f"101 x 101 states, {LEVELS} torques, gamma {GAMMA}, to {TOLERANCE:g}, best of 5:")
    print(f"  {sweeps} sweeps in {seconds:.3f} s: {sweeps / seconds:.0f} sweeps a second,")
    print(f"  {1e9 * seconds / (sweeps * mdp.X * mdp.U):.2f} ns a backup")
    print(
        "states per axis     states  entries X U   table s   sweeps      s  ms a sweep  ns a backup"
    )
    for side in SIDES:
        mdp, building = _mdp(side)
        seconds, sweeps = _value_iteration(mdp)
        entries = mdp.X * mdp.U
        print(
            f"{side:15d} {mdp.X:10d} {entries:12d} {building:9.3f} {sweeps:8d} {seconds:6.2f}"
            f" {1e3 * seconds / sweeps:11.3f} {1e9 * seconds / sweeps / entries:12.2f}",
            flush=True,
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"memory at most: {peak:.0f} MB")


def _mdp(side: int) -> tuple[FiniteMDP, float]:
    """The pendulum with `side` angles and velocities, and the seconds its table took."""
    begin = time.perf_counter()
    mdp = PendulumGrid(q_nodes=side, v_nodes=side, levels=LEVELS).mdp(GAMMA)
    return mdp, time.perf_counter() - begin


def _value_iteration(mdp: FiniteMDP) -> tuple[float, int]:
    """Seconds and sweeps."""
    begin = time.perf_counter()
    sweeps = 0
    for sweep in value_iteration.iterate(mdp, np.zeros(mdp.X), TOLERANCE):
        sweeps = sweep.count
    return time.perf_counter() - begin, sweeps
