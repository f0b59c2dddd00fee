"""The simulator against the bare Pinocchio calls it needs, side by side."""

import statistics
import time

import numpy as np
import pinocchio as pin

from labs.engine.headless import run_headless
from labs.models.arms import ur5

SECONDS = 1.0
ROUNDS = 41


def ratio_to_bare_calls() -> None:
    """UR5, PD with gravity compensation at 1 kHz, semi-implicit Euler at 1 ms, in CPU time: one
    call of aba and one of computeGeneralizedGravity a step are what it cannot do without."""
    steps = round(SECONDS / 1e-3)
    run_headless("joint-control", seconds=0.5)  # loads the robot
    bare, whole = [], []
    for _ in range(ROUNDS):
        bare.append(_bare(steps))
        whole.append(_whole())
    ratios = [w / b for w, b in zip(whole, bare, strict=True)]
    print(f"bare calls of Pinocchio: {1e6 * statistics.median(bare) / steps:.2f} us a step")
    print(f"headless run, recorded:  {1e6 * statistics.median(whole) / steps:.2f} us a step")
    print(
        f"  ratio: median {statistics.median(ratios):.2f} "
        f"({min(ratios):.2f} to {max(ratios):.2f}); "
        f"{SECONDS / statistics.median(whole):.1f} x real time"
    )


def _bare(steps: int) -> float:
    arm = ur5()
    model, data = arm.model, arm.model.createData()
    q, v, tau = arm.home.copy(), np.zeros(model.nv), np.zeros(model.nv)
    begin = time.process_time()
    for _ in range(steps):
        pin.computeGeneralizedGravity(model, data, q)
        pin.aba(model, data, q, v, tau)
    return time.process_time() - begin


def _whole() -> float:
    begin = time.process_time()
    run_headless("joint-control", {"controller": "pd-gravity"}, seconds=SECONDS)
    return time.process_time() - begin
