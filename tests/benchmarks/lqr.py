"""The linear quadratic regulator: Riccati's recursion, and against least squares over N."""

import statistics
from time import perf_counter

import numpy as np

from labs.algorithms.riccati import prepare, solve
from labs.optimal_control.lqr.comparison import COMPARED_HORIZONS, compare
from labs.optimal_control.lqr.linear_systems import linear_system
from labs.problems.linear_quadratic import LqrProblem

ROUNDS = 101


def riccati() -> None:
    """n = 12, m = 6, N = 1000, in wall-clock time, from the matrices to all gains and values;
    then both ways of solving the labs' problems, in processor time."""
    prepare()
    rng = np.random.default_rng(0)
    n, m, steps = 12, 6, 1000
    a, b = 0.35 * rng.normal(size=(n, n)), rng.normal(size=(n, m))
    durations = []
    for _ in range(ROUNDS):
        begin = perf_counter()
        solve(LqrProblem(steps, a, b, np.eye(n), np.eye(m), np.eye(n)))
        durations.append(1e3 * (perf_counter() - begin))
    print(
        f"n = {n}, m = {m}, N = {steps}: median {statistics.median(durations):.2f} ms "
        f"({min(durations):.2f} to {max(durations):.2f})"
    )
    for name in ("cart-pole", "ur5"):
        _over_horizons(name)


def _over_horizons(name: str) -> None:
    a, b = linear_system(name).linear(0.02)
    n, m = b.shape
    print(f"{name}, n = {n}, m = {m}\n    N   Riccati [ms]   least squares [ms]   difference")
    rows = []
    for horizon in COMPARED_HORIZONS[name]:
        problem = LqrProblem(horizon, a, b, np.eye(n), 0.1 * np.eye(m), np.eye(n))
        found = [compare(problem) for _ in range(11)]
        fast = 1e3 * min(c.riccati for c in found)
        slow = 1e3 * min(c.least_squares for c in found)
        rows.append((horizon, fast, slow))
        print(f"{horizon:5d} {fast:14.3f} {slow:20.3f} {found[0].difference:12.1e}")
    last = np.log(np.array(rows[-3:]))
    slopes = [np.polyfit(last[:, 0], last[:, column], 1)[0] for column in (1, 2)]
    print(f"  slope of the last three: {slopes[0]:.1f} and {slopes[1]:.1f}")
