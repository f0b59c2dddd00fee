"""What a machine is measured by: the least time of many, and the calls of the dynamics that an
iteration cannot do without."""

from collections.abc import Callable
from time import perf_counter

import numpy as np
import pinocchio as pin

from labs.models.mechanisms import Mechanism

ROUNDS = 40


def least_seconds(work: Callable[[], object]) -> float:
    """[s] the least of all rounds: what else the machine does only adds."""
    times = []
    for _ in range(ROUNDS):
        begun = perf_counter()
        work()
        times.append(perf_counter() - begun)
    return min(times)


def bare_calls(m: Mechanism, N: int) -> float:
    """[s] of N calls of `aba` and N of `computeABADerivatives`."""
    model, data = m.model, m.data
    q, v, tau = np.resize(m.arm.home, m.nq), np.full(m.nq, 0.1), np.ones(m.nq)

    def calls() -> None:
        for _ in range(N):
            pin.aba(model, data, q, v, tau)
            pin.computeABADerivatives(model, data, q, v, tau)

    return least_seconds(calls)
