"""What is advised where a run diverged: followed, the run does not diverge."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict

import numpy as np
import pytest

from labs.algorithms.integrators import INTEGRATORS
from labs.params import Value
from labs.reactive_control.joint_control.lab import JointState
from labs.reactive_control.joint_control.linearisation import loops_along_reference
from labs.reactive_control.joint_control.params import (
    AVAILABLE_SETTINGS,
    CONTROLLERS,
    REFERENCES,
    JointParams,
)
from labs.reactive_control.joint_control.remedies import find_remedies
from labs.tasks.arm.postures import POSED_ARMS
from tests.labs.reactive_control.joint_control.runs import final_state, parameters

CHOICES: Mapping[str, Iterable[str]] = {
    "robot": POSED_ARMS,
    "reference": REFERENCES,
    "controller": CONTROLLERS,
    "integrator": INTEGRATORS,
}
SETTINGS = ("controller", "control_period", "integrator", "step")


def diverging(rng: np.random.Generator, steps: Sequence[float]) -> tuple[JointParams, JointState]:
    """A random setting that diverges within half a second, and how it ended."""

    def log_uniform(low: float, high: float) -> float:
        return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.3g}")

    for _ in range(1000):
        params = parameters(
            {},
            **{name: str(rng.choice(list(options))) for name, options in CHOICES.items()},
            amplitude=round(rng.uniform(0.0, 0.8), 2),
            frequency=round(rng.uniform(0.05, 1.0), 2),
            kp=log_uniform(1.0, 2000.0),
            ki=log_uniform(1.0, 2000.0) if rng.random() < 0.7 else 0.0,
            kd=log_uniform(0.1, 200.0) if rng.random() < 0.9 else 0.0,
            payload=round(rng.uniform(0.0, 10.0), 1) if rng.random() < 0.3 else 0.0,
            friction=round(rng.uniform(0.0, 20.0), 1) if rng.random() < 0.3 else 0.0,
            torque_limits=bool(rng.random() < 0.3),
            control_period=float(rng.choice(list(AVAILABLE_SETTINGS.periods))),
            step=float(rng.choice(list(steps))),
        )
        stopped = final_state(params, 0.5)
        if stopped.trouble:
            return params, stopped
    raise AssertionError("nothing diverges")


def check_advice(seed: int, count: int, seconds: float, steps: Sequence[float]) -> None:
    """Whatever is advised where a run diverged, the run with it does not diverge."""
    rng, advised = np.random.default_rng(seed), 0
    for _ in range(count):
        params, stopped = diverging(rng, steps)
        proposals = find_remedies(
            loops_along_reference(params, stopped.q_ref), params.loop_settings, AVAILABLE_SETTINGS
        )
        advised += bool(proposals)
        for proposal in proposals:
            assert proposal.text in stopped.trouble
            for setting in proposal.settings:
                followed = params.change(
                    {name: getattr(setting, name) for name in SETTINGS} | asdict(setting.gains)
                )
                ended = final_state(followed, seconds)
                assert not ended.trouble, (proposal.text, params)
    assert advised > 0.6 * count


def test_advice_helps_where_it_is_given() -> None:
    check_advice(seed=0, count=3, seconds=1.0, steps=(0.005, 0.01))


@pytest.mark.study
def test_advice_helps_wherever_it_is_given() -> None:
    check_advice(seed=1, count=150, seconds=8.0, steps=(0.001, 0.002, 0.005, 0.01))


def test_too_much_damping_is_answered_by_an_interval() -> None:
    """At 10 ms, explicit Euler, too little is as bad: 60 and 1.5 diverge, what is named does
    not."""
    setting: dict[str, Value] = {
        "controller": "pid",
        "reference": "set-point",
        "kp": 330.0,
        "kd": 60.0,
        "step": 0.01,
        "control_period": 0.01,
        "integrator": "explicit-euler",
        "torque_limits": False,
    }
    stopped = final_state(parameters(setting), 5.0)
    found = re.search(r"k_d from (\S+) to (\d[\d.]*\d)", stopped.trouble)
    assert found, stopped.trouble
    low, high = map(float, found.groups())
    assert final_state(parameters(setting, kd=1.5), 20.0).trouble
    for kd in (low, 0.5 * (low + high), high):
        assert not final_state(parameters(setting, kd=kd), 20.0).trouble
