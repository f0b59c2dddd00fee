"""What the article of the lab lyapunov claims, in numbers."""

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest

from labs.appendix.lyapunov.analysis import LyapunovAnalysis
from labs.appendix.lyapunov.closed_loop import STATE_LIMIT, clip_states
from labs.appendix.lyapunov.lab import Lyapunov, LyapunovState
from labs.appendix.lyapunov.params import LyapunovParams
from labs.appendix.lyapunov.state_ensemble import StateEnsemble
from labs.lab import Inputs, Snapshot
from labs.params import Value
from tests.labs.experiments import ArticleExperiments

EXPERIMENTS = ArticleExperiments("labs.appendix", "lyapunov")
verify = EXPERIMENTS.verify
Settings = Mapping[str, Value]


@cache
def _after(seconds: float, items: tuple[tuple[str, Value], ...]) -> LyapunovState:
    lab, params = Lyapunov(), LyapunovParams().change(dict(items))
    state = lab.init(params, np.random.default_rng(0))
    for snapshot in lab.solve(params, state):
        if isinstance(snapshot, Snapshot):
            state = lab.accept(params, state, snapshot)
    for _ in range(round(seconds / lab.period)):
        state = lab.step(params, Inputs(), state)
    return state


def state_after(seconds: float, setting: Settings, **others: Value) -> LyapunovState:
    """With the study done at the start."""
    return _after(seconds, tuple({**setting, **others}.items()))


def study(setting: Settings, **others: Value) -> LyapunovAnalysis:
    found = state_after(0.0, setting, **others).study
    assert found is not None
    return found


def runs(seconds: float, setting: Settings, **others: Value) -> StateEnsemble:
    found = state_after(seconds, setting, **others).runs
    assert found is not None
    return found


@verify("A round bowl")
def test_a_round_bowl_proves_nothing(setting: Settings) -> None:
    round_ = study(setting)
    assert 100 * round_.decreasing == pytest.approx(76, abs=0.5)
    assert round_.constants.alpha_3 < 0.0
    assert round_.level_max == 0.0
    assert np.abs(np.linalg.eigvals(LyapunovParams().loop.A)).max() < 0.9, "the loop is stable"
    tilted = study(setting, angle=-80.0, axis_1=1.0, axis_2=0.78)
    assert tilted.constants.holds
    assert tilted.covered > 0.39


@verify("The bowl that fits")
def test_no_state_leaves_a_level_set_of_the_lyapunov_equation(setting: Settings) -> None:
    found, many = study(setting), runs(5.0, setting)
    assert 100 * found.covered == pytest.approx(40, abs=0.5)
    assert not many.left.any()
    assert (np.diff(many.V, axis=0) < 0.0).all()
    assert (many.V[0] <= found.level).all()
    assert many.V[0].min() > 0.97 * found.level, "they start on its edge"
    params = LyapunovParams().change(setting)
    A, P = params.loop.A, params.V.P
    np.testing.assert_allclose(A.T @ P @ A - P, -params.loop.Q, atol=1e-9)
    assert found.decreasing < 0.8, "far from the rest there is amber"


@verify("Energy")
def test_energy_does_not_fall_everywhere(setting: Settings) -> None:
    found = study(setting)
    assert found.constants.alpha_1 > 0.0 > found.constants.alpha_3
    grows = np.argwhere(found.change > 1e-9)
    grid = LyapunovParams().plane.grid(*found.V.shape)
    at = grid[tuple(grows.T)]
    assert len(at) > 50
    assert np.abs(at[:, 1]).max() < 0.25 * grid[-1, -1, 1], "a band along v = 0"
    assert study(setting, period=0.05).decreasing > found.decreasing
    assert EXPERIMENTS.answer("Energy") == "No: somewhere it does not fall."


@verify("Inside the cycle")
def test_a_level_set_is_a_part_of_what_is_stable(setting: Settings) -> None:
    found, params = study(setting), LyapunovParams().change(setting)
    assert 100 * found.covered == pytest.approx(15, abs=0.5)
    assert 100 * study(setting, candidate="energy").covered == pytest.approx(10, abs=0.5)
    X = params.plane.grid(81, 81).reshape(-1, 2)
    for _ in range(300):
        X = clip_states(params.loop.system.step(X, np.zeros((len(X), 1)), 0.1))
    assert 100 * (np.linalg.norm(X, axis=1) < 0.01).mean() == pytest.approx(45, abs=1.0)
    assert not runs(6.0, setting).left.any()


@verify("One level too far")
def test_of_a_set_too_large_some_leave_and_most_come_back(setting: Settings) -> None:
    many = runs(6.0, setting)
    assert many.left.sum() == 40
    lost = np.abs(many.X).max(axis=1) >= STATE_LIMIT
    assert lost.sum() == 2
    assert np.linalg.norm(many.X[~lost], axis=1).max() < np.linalg.norm(many.X[lost], axis=1).min()
    assert np.linalg.norm(runs(11.0, setting).X[~lost], axis=1).max() < 0.1
    assert EXPERIMENTS.answer("One level too far") == "Some leave, most come back."


@verify("A box is not enough")
def test_a_box_is_left_and_come_back_to(setting: Settings) -> None:
    many, params = runs(5.0, setting), LyapunovParams().change(setting)
    assert many.left.sum() == 24
    assert params.box.contains(many.X).all()
    assert many.distances[-1].max() < 0.01 * many.distances[0].max()
    level = study(setting).level
    share = level / study(setting, set="level").level_max
    inside = runs(5.0, {**setting, "set": "level", "share": share})
    assert 0.0 < share < 1.0
    assert not inside.left.any()
    assert params.box.contains(inside.tail.reshape(-1, 2)).all()
    starts = study(setting, set="level", share=share).starts
    corner = np.array([params.box_1, params.box_2]) * params.loop.window
    assert (np.abs(starts) / corner).max() == pytest.approx(1.0, abs=0.02), "it touches the box"


@verify("What the bound is worth")
def test_the_bound_holds_and_is_loose(setting: Settings) -> None:
    constants, many = study(setting).constants, runs(6.0, setting)
    ratios = constants.bound(many.k) / (many.distances / many.distances[0]).max(axis=1)
    assert ratios.min() == pytest.approx(2.3, abs=0.05)
    assert (ratios[12:] > 100.0).all()
    assert constants.gamma == pytest.approx(0.991, abs=5e-4)
    promised = (1 - constants.alpha_3 / constants.alpha_2) ** np.arange(many.k + 1)
    assert (many.V / many.V[0] <= promised[:, None] * (1 + 1e-12)).all()
    assert (
        EXPERIMENTS.answer("What the bound is worth") == "It stays below, by a factor that grows."
    )


@verify("Short-sighted")
def test_a_short_horizon_makes_no_lyapunov_function(setting: Settings) -> None:
    short = study(setting)
    assert short.decreasing < 0.5
    assert short.level_max == 0.0
    assert short.constants.alpha_1 > 0.0 > short.constants.alpha_3
    few, more = (study(setting, terminal="riccati", N=n) for n in (3.0, 10.0))
    long = study(setting, N=20.0)
    assert few.constants.holds
    assert long.constants.holds
    assert more.covered > 2.0 * few.covered > 0.15
    assert EXPERIMENTS.answer("Short-sighted") == "No: in places it grows from step to step."


def test_all_experiments_are_verified() -> None:
    EXPERIMENTS.check_all_are_verified()


def test_what_there_is_to_go_on_is_so() -> None:
    weak, strong = (study({"system": "lqr", "candidate": "riccati", "u_max": u}) for u in (0.5, 2))
    assert weak.covered < 0.1 * strong.covered
    free = state_after(0.0, {"candidate": "lyapunov", "kd": 0.0})
    assert free.study is None
    assert "the system must be stable" in free.failure
