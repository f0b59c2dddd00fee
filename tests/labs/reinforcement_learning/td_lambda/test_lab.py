"""The lab td-lambda: what its article claims, in numbers; what is learned step by step is what the
algorithms learn of whole episodes.

What a hundred learners do on average is a statistic: tolerances are about three standard errors."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from labs.algorithms import prediction
from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.errors import ParameterError
from labs.lab import Inputs
from labs.params import Value
from labs.reinforcement_learning.td_lambda.lab import TdLambda
from labs.reinforcement_learning.td_lambda.params import METHOD_NUMBERS, TD_METHODS, TdLambdaParams
from labs.reinforcement_learning.td_lambda.partial_episode import (
    PartialEpisode,
    draw_episode,
    eligibility,
    n_step_returns,
    return_weights,
    updated_values,
)
from labs.reinforcement_learning.td_lambda.sweep import ALPHAS, LAMBDA_VALUES, N_VALUES
from labs.tasks.grid_world.map import MAPS, grid_world
from labs.tasks.grid_world.picture import board
from tests.labs.experiments import ArticleExperiments
from tests.labs.solving import readouts, solve, solved_world

EXPERIMENTS = ArticleExperiments("labs.reinforcement_learning", "td_lambda")
ENTRY = find_lab("td-lambda")
LAB = TdLambda()
NEAR = 0.012
"""Three standard errors of a mean of 100 learners, and more."""


def params_of(world: World) -> TdLambdaParams:
    assert isinstance(world.params, TdLambdaParams)
    return world.params


def curves(world: World, part: str) -> np.ndarray:
    """(k, A) errors over step sizes, a curve a row, of the whole sweep."""
    errors: np.ndarray = world.state.sweep[part]["errors"].reshape(-1, len(ALPHAS))
    return errors


def least_errors(world: World) -> np.ndarray:
    """(k,) the least error of each curve of the family."""
    return np.asarray(curves(world, "family").min(axis=1))


def walked(setting: Mapping[str, Value], episodes: int, **changes: Value) -> World:
    """A world after so many episodes in the scene, or in trouble."""
    world = World(ENTRY, {**setting, "rate": 100.0, **changes})
    while world.state.episodes < episodes and not world.trouble:
        world.advance()
    return world


# The experiments --------------------------------------------------------------------------------


@EXPERIMENTS.verify("Neither end is best")
def test_an_intermediate_n_is_best(setting: Mapping[str, Value]) -> None:
    world = solved_world("td-lambda", setting)
    best, shown = dict(zip(N_VALUES, least_errors(world), strict=True)), readouts(world)
    assert shown["best_member"] == 4.0 == setting["n"]
    assert shown["best_alpha"] == pytest.approx(0.4, abs=0.05)
    assert best[4] == shown["best_error"] == pytest.approx(0.27, abs=NEAR)
    assert best[1] == pytest.approx(0.35, abs=NEAR)
    assert best[128] == pytest.approx(0.46, abs=NEAR)
    assert curves(world, "family")[:, 0] == pytest.approx(0.5477, abs=1e-4)
    minima = ALPHAS[curves(world, "family").argmin(axis=1)]
    assert (np.diff(minima) <= 0.0).all(), "the larger n, the smaller the steps"
    assert EXPERIMENTS.answer("Neither end is best") == "n = 4."


@EXPERIMENTS.verify("Who has the say")
def test_weights_sum_to_one_and_seven_have_half(setting: Mapping[str, Value]) -> None:
    params = TdLambdaParams().change(setting)
    weights = return_weights("forward", params.rule("forward"), round(params.ahead))
    assert weights.sum() == pytest.approx(1.0, abs=1e-15)
    assert weights[:7].sum() == pytest.approx(0.52, abs=0.005)
    assert weights[:6].sum() < 0.5
    assert EXPERIMENTS.answer("Who has the say") == 7
    assert (weights[0], weights[-1]) == pytest.approx((0.1, 0.9**19))
    assert weights.argmax() == 19


@EXPERIMENTS.verify("No need to choose")
def test_an_intermediate_lambda_is_as_good_as_the_best_n(setting: Mapping[str, Value]) -> None:
    world = solved_world("td-lambda", setting)
    best, shown = dict(zip(LAMBDA_VALUES, least_errors(world), strict=True)), readouts(world)
    assert (shown["best_member"], shown["best_alpha"]) == pytest.approx((0.8, 0.4), abs=0.051)
    assert best[0.8] == pytest.approx(0.27, abs=NEAR)
    assert (best[0.0], best[1.0]) == pytest.approx((0.37, 0.49), abs=NEAR)
    n_step = solved_world("td-lambda", {"method": "n-step"})
    assert best[0.8] == pytest.approx(least_errors(n_step).min(), abs=0.005)
    assert EXPERIMENTS.answer("No need to choose") == "Yes, it is about as good."
    longer = solved_world("td-lambda", {**setting, "episodes": 40.0})
    assert least_errors(longer).argmin() == least_errors(world).argmin()
    minima = [curves(w, "family").argmin(axis=1) for w in (longer, world)]
    assert (minima[0] <= minima[1]).all(), "who has time takes smaller steps"
    assert (minima[0] < minima[1]).sum() >= 7


@EXPERIMENTS.verify("One surprise, many cells")
def test_one_surprise_moves_all_states_on_the_way(setting: Mapping[str, Value]) -> None:
    world = World(ENTRY, setting)
    while world.t < EXPERIMENTS.blocks["One surprise, many cells"]["hold"] - 1e-9:
        world.advance()
    state, shown = world.state, readouts(world)
    assert state.steps.over
    assert state.steps.costs[-1] == -1.0
    assert not state.steps.costs[:-1].any()
    assert (shown["changed_first"], shown["changed_second"]) == (10.0, 1.0)
    visited = np.unique(state.steps.states[:-1])
    assert np.array_equal(np.flatnonzero(state.values[0]), visited)
    assert np.flatnonzero(state.values[1]).tolist() == [state.steps.states[-2]]
    trace = LAB.fields(params_of(world), state)["trace"]
    assert state.values[0, 1:-1] == pytest.approx(-0.4 * trace)


@EXPERIMENTS.verify("Two views, one update")
def test_both_views_agree_offline(setting: Mapping[str, Value]) -> None:
    world = walked(setting, 20)
    assert world.state.gaps.max() < 1e-13
    assert np.abs(world.state.values).max() > 0.3
    assert readouts(world)["gap"] == world.state.gaps[-1]
    assert EXPERIMENTS.answer("Two views, one update") == "Not at all, but for rounding."
    # "There is no difference at all, to the last bit."
    for first, second, lam in (("forward", "monte-carlo", 1.0), ("backward", "td0", 0.0)):
        same = walked(setting, 10, method=first, second=second, lam=lam)
        assert not same.state.gaps.any()
        assert same.state.values.any()


@EXPERIMENTS.verify("And at once")
def test_both_views_part_online(setting: Mapping[str, Value]) -> None:
    world = walked(setting, 20)
    gaps = world.state.gaps
    assert gaps[0] == pytest.approx(0.13, abs=0.005)
    assert np.mean((gaps >= 0.1) & (gaps <= 0.3)) > 0.7
    assert EXPERIMENTS.answer("And at once") == "By a tenth or so."
    diverged = walked(setting, 10, lam=1.0)
    assert "values diverged (Backward view)" in diverged.trouble


@EXPERIMENTS.verify("Traces that know the step size")
def test_true_online_bears_large_steps(setting: Mapping[str, Value]) -> None:
    world = solved_world("td-lambda", setting)
    shown = readouts(world)
    assert shown["here_first"] == pytest.approx(0.33, abs=NEAR)
    assert shown["here_second"] == pytest.approx(0.54, abs=2 * NEAR)
    online, traces = curves(world, "own")
    assert online[:6] == pytest.approx(traces[:6], abs=0.015)
    assert traces[ALPHAS >= 0.8].min() > 2.0, "some leave all bounds"
    at = int(online.argmin())
    assert online[np.isclose(ALPHAS, 2 * ALPHAS[at])][0] < online[at] + 0.05
    others = [least_errors(solved_world("td-lambda", {"method": m})).min() for m in
              ("n-step", "forward", "backward")]  # fmt: skip
    assert least_errors(world).min() == pytest.approx(0.259, abs=NEAR)
    assert min(others) == pytest.approx(0.266, abs=NEAR)
    assert least_errors(world).min() < min(others)
    assert EXPERIMENTS.answer("Traces that know the step size") == "Only true online learns."


@EXPERIMENTS.verify("A long way to tell")
def test_bias_hurts_where_every_step_costs(setting: Mapping[str, Value]) -> None:
    world = solved_world("td-lambda", setting)
    place, best = params_of(world).place, dict(zip(LAMBDA_VALUES, least_errors(world), strict=True))
    assert place.mean_steps == pytest.approx(32, abs=0.5)
    assert place.mean_steps == pytest.approx(place.task.truth[place.start])
    assert place.initial_error == pytest.approx(19.1, abs=0.05)
    assert (best[0.975], best[0.8], best[0.0]) == pytest.approx((5.9, 8.9, 15.0), abs=0.25)
    assert readouts(world)["best_member"] > 0.9
    assert setting["lam"] == 0.95
    assert pytest.approx(0.2, abs=0.02) == 0.95**30
    assert EXPERIMENTS.answer("A long way to tell") == "Closer to 1."


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()


# What is learned step by step -----------------------------------------------------------------


@cache
def some_params(**changes: Value) -> TdLambdaParams:
    return TdLambdaParams().change(changes)


@pytest.mark.parametrize("system", ["walk", "grid"])
@pytest.mark.parametrize("offline", [False, True])
@pytest.mark.parametrize("method", TD_METHODS)
def test_walking_learns_what_the_algorithms_learn(method: str, offline: bool, system: str) -> None:
    """Of the same three episodes; and no method learns from what has not happened yet."""
    params = some_params(method=method, offline=offline, system=system, alpha=0.2, n=3)
    place, rule = params.place, params.rule(method)
    learners = prediction.init(place.task, 1, np.random.default_rng(5))
    random, V = learners.random[0].copy(), learners.V[0]
    for _ in range(3):
        steps = draw_episode(place, random)
        half = steps._replace(done=len(steps.costs) // 2)
        other = half._replace(
            states=np.r_[steps.states[: half.done + 1], np.full(5, place.start)],
            costs=np.r_[steps.costs[: half.done], np.full(5, 99.0)],
        )
        now = updated_values(place, method, rule, V, half)
        assert np.array_equal(now, updated_values(place, method, rule, V, other))
        V = updated_values(place, method, rule, V, steps._replace(done=len(steps.costs)))
    after = prediction.step(place.task, rule, METHOD_NUMBERS[method], learners, 3)
    assert np.array_equal(V, after.V[0])


def test_n_step_td_learns_as_its_costs_come() -> None:
    """Of four states in a row, n = 2: x_0 after two costs, x_1 after three, the rest at the end."""
    params = some_params(method="n-step", n=2, alpha=0.5)
    steps = PartialEpisode(np.array([10, 9, 8, 9, 0]), np.array([1.0, 2.0, 3.0, 4.0]))
    V = np.where(np.arange(21) % 20 == 0, 0.0, 0.1 * np.arange(21))
    moved = [
        np.flatnonzero(updated_values(params.place, "n-step", params.rule("n-step"), V, done) != V)
        for done in (steps._replace(done=t) for t in range(5))
    ]
    assert [m.tolist() for m in moved] == [[], [], [10], [9, 10], [8, 9, 10]]
    after = updated_values(params.place, "n-step", params.rule("n-step"), V, steps._replace(done=2))
    assert after[10] == pytest.approx(1.0 + 0.5 * (1.0 + 2.0 + 0.8 - 1.0))


@pytest.mark.parametrize("method", [name for name in TD_METHODS if name != "true-online"])
@pytest.mark.parametrize("gamma", [1.0, 0.9])
def test_the_credit_of_every_step_adds_up_to_the_update(method: str, gamma: float) -> None:
    """Offline, V changes by alpha times the sum over all steps of delta_t e_t, by any method."""
    params = some_params(method=method, offline=True, gamma=gamma, lam=0.7, n=3, alpha=0.1)
    place, rule = params.place, params.rule(method)
    V = np.random.default_rng(1).uniform(-1.0, 1.0, 21) * place.nonterminal
    steps = draw_episode(place, np.arange(1, 5, dtype=np.uint64))
    total = np.zeros(21)
    for t, cost in enumerate(steps.costs):
        x, y = steps.states[t : t + 2]
        e = eligibility(gamma, method, rule, steps._replace(done=t + 1), 21)
        total += (cost + gamma * V[y] - V[x]) * e
    after = updated_values(place, method, rule, V, steps._replace(done=len(steps.costs)))
    assert after - V == pytest.approx(0.1 * total, abs=1e-12)


def test_the_trace_of_true_online_is_its_update_before_anything_was_learned() -> None:
    params = some_params(method="true-online", lam=0.9, alpha=0.5)
    steps = draw_episode(params.place, np.arange(1, 5, dtype=np.uint64))
    steps = steps._replace(done=len(steps.costs))
    V = updated_values(params.place, "true-online", params.rule("true-online"), np.zeros(21), steps)
    e = eligibility(1.0, "true-online", params.rule("true-online"), steps, 21)
    assert pytest.approx(0.5 * steps.costs[-1] * e) == V
    assert e.max() <= 1.0 / 0.5


@pytest.mark.parametrize("method", TD_METHODS)
@pytest.mark.parametrize("ahead", [0, 1, 2, 40])
def test_weights_and_returns_make_the_target(method: str, ahead: int) -> None:
    """The weights sum to 1, and of a state met once the weighted returns are its target."""
    params = some_params(method=method, offline=True, gamma=0.9, lam=0.7, n=3, alpha=1.0)
    rule, place = params.rule(method), params.place
    weights = return_weights(method, rule, ahead)
    assert weights.shape == (ahead,)
    assert weights.sum() == pytest.approx(float(ahead > 0))
    if 0 < ahead < 10 and method != "true-online":
        states = np.r_[np.arange(10, 10 - ahead, -1), 0]
        steps = PartialEpisode(states, np.arange(1.0, ahead + 1.0), ahead)
        V = np.linspace(0.0, 1.0, 21) * place.nonterminal
        returns = n_step_returns(0.9, V, steps)
        target = updated_values(place, method, rule, V, steps)[10]
        assert weights @ returns == pytest.approx(target)


def test_a_slider_acts_on_the_episode_that_goes_on() -> None:
    """A slider of learning acts on the whole episode at once, and leaves its steps alone."""
    world = World(ENTRY, {})
    for _ in range(100):
        world.advance()
    states, before = world.state.steps.states, world.state.values
    world.change({"lam": 0.0})
    while world.state.episodes < 1:
        world.advance()
    assert np.array_equal(world.state.steps.states, states)
    assert (world.state.values != 0.0).sum() == 1, "as if lambda had been 0 all along"
    assert not before.any()


# The sweep --------------------------------------------------------------------------------------


def test_a_sweep_goes_on_where_it_was_and_measures_only_what_changed() -> None:
    world = World(ENTRY, {"method": "td0", "second": "backward", "episodes": 1.0})
    whole = solve(world)
    assert whole == 2 + 2 * len(ALPHAS) + len(ALPHAS)
    family = world.state.sweep["family"]["errors"]
    world.change({"alpha": 0.3})
    assert solve(world) == 2, "the setting of now"
    world.change({"lam": 0.5})
    assert solve(world) == 2 + 2 * len(ALPHAS)
    assert np.array_equal(world.state.sweep["family"]["errors"], family)
    own = curves(world, "own")
    assert np.array_equal(own[0], family), "TD(0) is a family of one"
    fields = world.lab.fields(world.params, world.state)
    assert np.isnan(fields["family_errors"]).sum() == 0
    at = np.isclose(ALPHAS, 0.3)
    assert fields["here"] == pytest.approx(own[:, at][:, 0])
    world.change({"episodes": 2.0})
    assert np.isnan(world.lab.fields(world.params, world.state)["family_errors"]).all()


def test_a_point_is_what_the_algorithms_measure() -> None:
    params = some_params(method="n-step", n=8, alpha=0.25)
    state = LAB.init(params, np.random.default_rng(0))
    first = next(snapshot for snapshot in LAB.solve(params, state) if snapshot)
    learners = prediction.init(params.place.task, 100, np.random.default_rng(state.seed))
    rule = params.rule("n-step")
    errors = prediction.step(params.place.task, rule, prediction.N_STEP, learners, 10).errors
    assert first.data["here"]["errors"][0] == pytest.approx(errors.mean(), rel=1e-12)


# Maps ------------------------------------------------------------------------------------------


def test_a_map_without_a_way_to_the_goal_is_refused() -> None:
    params = TdLambdaParams(system="grid")
    for text, words in (("S.#G", "row 1, column 1 no way leads"), ("GG", "every cell")):
        with pytest.raises(ParameterError, match=words):
            params.change({"map": text})
    world = grid_world(MAPS["room"], False)
    point = board(world).centers[4, 0]
    changes = LAB.edit(params, "board", (point[0], point[1], point[2]))
    assert params.change(changes).place.world != params.place.world


def test_diverged_values_stop_the_walk_with_a_sentence() -> None:
    world = walked({"lam": 1.0, "alpha": 1.0}, 20)
    assert "Take a smaller step size" in world.trouble
    state = replace(world.state)
    assert LAB.step(params_of(world), Inputs(), state) is state


def test_a_map_of_any_size_is_taken_and_what_was_translated_is_said() -> None:
    corridor = ["#" * 30 + "SF", *["F" * 32] * 30, "F" * 30 + "HG"]
    world = World(ENTRY, {"system": "grid", "map": "\n".join(corridor)})
    about = LAB.notes(params_of(world), world.state)["about"]
    assert about.startswith("994 states and 4 controls, 2 of the states terminal")
    assert "Read F as . (free)." in about
    assert "A hole H ends an episode and costs 100" in about
