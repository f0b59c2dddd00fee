"""Four iterations in one pass are the four alone."""

import math
from itertools import pairwise

import numpy as np
import pytest

from labs.algorithms import policy_evaluation, policy_iteration, value_iteration
from labs.algorithms.policy_iteration import optimum
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.reinforcement_learning.dynamic_programming import iteration_comparison
from labs.reinforcement_learning.dynamic_programming.iteration_comparison import (
    GIVEN_UP,
    RANDOM_CONTROL,
    Iterates,
    IterationSettings,
    convergence_curves,
    initial_iterates,
    iteration_report,
    progress,
    run_passes,
)
from labs.rounding import round_up
from tests.labs.algorithms.random_mdps import random_mdp

SETTINGS = IterationSettings(3, 1e-8)


def race(gamma: float = 0.95) -> tuple[FiniteMDP, Iterates, np.ndarray]:
    """A random MDP, the start of all four under the random policy, and their limits."""
    mdp = random_mdp(5, X=12, U=3, gamma=gamma, deterministic=True, ends=False)
    best, _, _ = optimum(mdp, np.zeros(12, np.int64))
    limits = np.stack([policy_evaluation.exact_values(mdp, random_policy(mdp)), best, best, best])
    policy = np.zeros((4, 12), np.int16)
    policy[:2] = RANDOM_CONTROL
    return mdp, initial_iterates(mdp, np.zeros((4, 12)), policy, limits), limits


def test_each_goes_as_if_it_were_alone() -> None:
    mdp, at, limits = race()
    *_, (last, _) = run_passes(mdp, at, SETTINGS, limits)
    V, evenly = np.zeros(12), random_policy(mdp)
    alone = [
        list(policy_evaluation.iterate(mdp, V, evenly, 1e-8)),
        list(policy_iteration.iterate(mdp, V, evenly, math.inf, 1e-8)),
        list(policy_iteration.iterate(mdp, V, None, 3, 1e-8)),
        list(value_iteration.iterate(mdp, V, 1e-8)),
    ]
    for i, sweeps in enumerate(alone):
        np.testing.assert_array_equal(last.V[i], sweeps[-1].V)
        assert (last.count[i], last.done[i]) == (len(sweeps), sweeps[-1].done)
        errors = [np.abs(sweep.V - limits[i]).max() for sweep in sweeps]
        np.testing.assert_array_equal(last.errors[1 : len(sweeps) + 1, i], errors)
        np.testing.assert_array_equal(last.errors[len(sweeps) :, i], errors[-1])
        made = [sweep.backups for sweep in sweeps]
        np.testing.assert_array_equal(last.backups[1 : len(sweeps) + 1, i], made)
    assert last.stop_reason == (
        "All four iterations have converged: the largest distance left is "
        f"{round_up(last.errors[-1].max())}."
    )
    assert not at.stop_reason


def test_passes_grow_and_are_no_longer_than_they_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    mdp, at, limits = race(0.99)

    def lengths() -> list[int]:
        made = [1] + [len(now.errors) for now, _ in run_passes(mdp, at, SETTINGS, limits)]
        return np.diff(made).tolist()

    usual = lengths()
    assert usual[:60] == [1] * 60
    assert 1 < max(usual[:-1]) <= 100
    monkeypatch.setattr(iteration_comparison, "BACKUPS_PER_PASS", 5 * mdp.X * mdp.U)
    assert max(lengths()) == 5
    assert sum(lengths()) >= sum(usual) - max(usual)


def test_the_seconds_are_those_of_the_pass() -> None:
    mdp, at, limits = race()
    spent = np.array([seconds for _, seconds in run_passes(mdp, at, SETTINGS, limits)])
    assert (spent[0] > 0.0).all()
    assert (spent >= 0.0).all()
    assert (spent[-1] == 0.0).any(), "who is done spends nothing"


def test_progress_counts_decades_and_says_nothing_of_policy_iteration() -> None:
    mdp, at, limits = race()
    stands = [now for now, _ in run_passes(mdp, at, SETTINGS, limits)]
    parts = [progress(now, SETTINGS.tolerance) for now in stands]
    assert progress(at, SETTINGS.tolerance) == 0.0
    assert parts[-1] == 1.0
    alone = [[i for i in range(4) if not now.done[i]] == [1] for now in stands]
    assert any(alone)
    assert [part is None for part in parts] == alone
    known = [part for part in parts if part is not None]
    assert all(a <= b for a, b in pairwise(known))
    slowest = max(stands[-1].count[[0, 2, 3]])
    for now, part in zip(stands, parts, strict=True):
        if part is not None and not now.over:
            assert part == pytest.approx((len(now.errors) - 1) / slowest, abs=0.2)


def test_an_iteration_without_end_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(iteration_comparison, "MAX_SWEEPS", 65)
    mdp, at, limits = race(0.999)
    *_, (last, _) = run_passes(mdp, at, SETTINGS, limits)
    assert (last.count[[0, 3]] == 65).all()
    assert last.done[0] == f"{GIVEN_UP} after 65 sweeps."
    assert "Policy evaluation: given up after 65 sweeps." in last.stop_reason


def test_what_each_took_is_told() -> None:
    mdp, at, limits = race()
    assert iteration_report(at, {}).count("0 sweeps, 0 backups. On its way.") == 4
    (first, _), *_, (last, _) = run_passes(mdp, at, SETTINGS, limits)
    assert "Value iteration: 1 sweep, " in iteration_report(first, {})
    lines = iteration_report(last, {"value": 0.0123}).splitlines()
    assert lines[3].startswith(f"Value iteration: {last.count[3]} sweeps, ")
    assert " backups, 12.3 ms. " in lines[3]
    assert " ms" not in lines[0]


def test_curves_are_thinned_but_keep_their_ends() -> None:
    mdp, at, limits = race(0.99)
    *_, (last, _) = run_passes(mdp, at, SETTINGS, limits)
    found = convergence_curves(last, mdp.gamma, 50)
    for i, method in enumerate(iteration_comparison.ITERATION_METHODS):
        sweeps = found[f"sweep_{method}"]
        assert len(sweeps) <= 50
        assert (sweeps[0], sweeps[-1]) == (0.0, last.count[i])
        assert found[f"error_{method}"][-1] == max(last.errors[-1, i], 1e-12)
        assert found[f"backups_{method}"][-1] == last.backups[-1, i]
    assert (found["error_value"] <= found["bound"] + 1e-12).all()
