"""The lab of function approximation: what its article claims, in numbers.

What six learners do on average is a statistic: tolerances leave about three standard errors."""

from collections.abc import Mapping
from itertools import product

import numpy as np
import pytest

from labs import resumable
from labs.algorithms.approximation import weighted_least_squares
from labs.algorithms.features import fourier_basis, polynomial_basis
from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.lab import Snapshot
from labs.params import Choice, Knob, Value
from labs.reinforcement_learning.function_approximation import (
    convergence_table,
    prediction,
    spiral,
    triad,
)
from labs.reinforcement_learning.function_approximation.example_worlds import convergence_labels
from labs.reinforcement_learning.function_approximation.given_policy import (
    PENDULUM_GRID,
    pendulum_policy,
    pendulum_prediction_task,
    walk_policy,
)
from labs.reinforcement_learning.function_approximation.params import ApproximationParams
from tests.labs.contract import bitwise_equal
from tests.labs.experiments import ArticleExperiments
from tests.labs.solving import solved_world, stop_reason

SLUG = "function-approximation"
EXPERIMENTS = ArticleExperiments("labs.reinforcement_learning", "function_approximation")
Settings = Mapping[str, Value]


def world_of(setting: Settings, **changes: Value) -> World:
    """A world whose learning has ended."""
    return solved_world(SLUG, {**setting, **changes})


def measured(world: World, name: str) -> float:
    return float(world.lab.measure(world.params, world.state)[name])


def error(world: World) -> float:
    """Of the last quarter, the mean of all learners: one moment is noisy."""
    curve = world.state.training["error"]
    return float(curve[:, -(curve.shape[1] // 4) :].mean())


# The experiments


@EXPERIMENTS.verify("Ten weights for a thousand states")
def test_monte_carlo_comes_close_to_the_best_staircase(setting: Settings) -> None:
    world = world_of(setting)
    assert measured(world, "error_best") == pytest.approx(0.054, abs=5e-4)
    assert error(world) == pytest.approx(0.07, abs=0.015)
    patient = world_of(setting, alpha=5e-5, episodes=20_000.0)
    assert error(patient) < error(world)
    noise = [float(w.state.training["error"][:, -20:].std(axis=1).mean()) for w in (world, patient)]
    assert noise[1] < 0.7 * noise[0]


@EXPERIMENTS.verify("TD stops short")
def test_td_comes_to_its_fixed_point(setting: Settings) -> None:
    world = world_of(setting)
    best, fixed = measured(world, "error_best"), measured(world, "error_fixed")
    assert fixed == pytest.approx(0.117, abs=1e-3)
    assert 2.0 < fixed / best < 2.3
    assert error(world) == pytest.approx(fixed, abs=0.015)
    given = walk_policy("aggregation", 10)
    middle = given.values(given.fixed)[1:-1]
    assert np.ptp(middle) < np.ptp(given.values(given.best)[1:-1])  # flatter
    nearer = error(world_of(setting, target="td-lambda", decay=0.9, alpha=2e-3))
    assert nearer < 0.09


@EXPERIMENTS.verify("Waves or powers")
def test_cosines_learn_faster_than_powers(setting: Settings) -> None:
    assert error(world_of(setting)) == pytest.approx(
        float(EXPERIMENTS.answer("Waves or powers")), abs=0.02
    )
    powers = error(world_of(setting, features="polynomial", alpha=1e-4))
    assert powers == pytest.approx(0.14, abs=0.02)
    given = walk_policy("table", 1)
    line = np.linspace(0.0, 1.0, 1000)[:, None]
    mu, truth = given.task.weight[1:-1], given.task.truth[1:-1]
    for make in (fourier_basis, polynomial_basis):
        phi = make(line, 5).dense
        assert np.sqrt(mu @ (phi @ weighted_least_squares(truth, phi, mu) - truth) ** 2) < 0.01


@EXPERIMENTS.verify("A cliff under a soft blanket")
def test_a_few_waves_miss_where_the_truth_jumps(setting: Settings) -> None:
    world = world_of(setting)
    best, fixed = measured(world, "error_best"), measured(world, "error_fixed")
    assert best == pytest.approx(0.34, abs=0.005)
    assert fixed == pytest.approx(0.36, abs=0.005)
    assert measured(world, "bound") == pytest.approx(6.8, abs=0.1)
    assert error(world) < 0.45
    fields = world.lab.fields(world.params, world.state)
    truth, miss = fields["truth_map"], np.abs(fields["error_map"])
    jump = np.maximum(
        np.abs(np.diff(truth, axis=0, append=truth[-1:])),
        np.abs(np.diff(truth, axis=1, append=truth[:, :1])),
    )
    steep = jump > np.quantile(jump, 0.9)
    assert miss[steep].mean() > 1.8 * miss[~steep].mean()
    tiles = pendulum_policy("tiles", 10)
    assert tiles.error(tiles.best) == pytest.approx(0.5 * best, rel=0.1)
    assert tiles.features.size > 10 * 45


@EXPERIMENTS.verify("45 numbers a torque")
def test_a_few_waves_swing_up_sooner_than_a_table(setting: Settings) -> None:
    world = world_of(setting)
    training, best = world.state.training, measured(world, "greedy_best")
    assert best == pytest.approx(6.75, abs=5e-3)
    assert measured(world, "size") == 45 * 5
    median = np.median(training["greedy"], axis=0)
    first = float(training["steps"][median < 1.15 * best][0])
    assert 60 <= first <= 250
    assert np.median(median[50:]) < 1.15 * best
    # It chatters: all six still change their policy for the worse now and then.
    assert (training["greedy"][:, 60:].max(axis=1) > 1.15 * best).all()
    table = world_of(setting, features="table", alpha=0.5).state.training["greedy"]
    assert np.median(table[:, -20:]) > 1.3 * best


@EXPERIMENTS.verify("All three together")
def test_the_star_diverges_with_all_three_and_with_no_two(setting: Settings) -> None:
    world = world_of(setting)
    assert world.state.trouble
    assert measured(world, "growth") > 0.2
    assert np.abs(world.state.training["w"]).max() > 1e5
    for switches in product((False, True), repeat=3):
        if all(switches):
            continue
        names = ("approximate", "bootstrap", "off_policy")
        calm = world_of(setting, **dict(zip(names, switches, strict=True)))
        assert not calm.state.trouble
        assert measured(calm, "growth") < 1e-12
        # No value ever gets larger than the largest at first was.
        assert np.abs(calm.state.training["path"]).max() <= 12.0


@EXPERIMENTS.verify("From which discount on")
def test_two_states_diverge_beyond_the_threshold(setting: Settings) -> None:
    threshold = 5.0 / (6.0 - 4.0 * 0.1)
    assert EXPERIMENTS.answer("From which discount on") == pytest.approx(threshold, abs=5e-4)
    assert error(world_of(setting)) < 0.05
    for gamma, grows in ((0.88, False), (0.91, True)):
        world = world_of(setting, gamma=gamma, updates=20_000.0)
        assert (measured(world, "growth") > 0.0) == grows
        path = np.abs(world.state.training["path"][0, :, 0])
        assert (path[-1] > 1.5 * path[0]) == grows
    calm = world_of(setting, gamma=0.99, off_policy=False)
    assert error(calm) < 1e-2


@EXPERIMENTS.verify("A true gradient")
def test_gradient_correction_holds_the_star(setting: Settings) -> None:
    world = world_of(setting)
    assert not world.state.trouble
    assert world.state.training["error"][:, 0] == pytest.approx(5.3, abs=0.05)
    assert error(world) == pytest.approx(1.93, abs=0.05)
    values = world.state.training["w"] @ triad.counterexample(_params(world)).features.dense.T
    assert np.abs(values - 0.99 * values[:, 6:]).max() < 0.1


@EXPERIMENTS.verify("Outwards")
def test_td_runs_outwards_and_monte_carlo_inwards(setting: Settings) -> None:
    world = world_of(setting)
    assert world.state.trouble
    assert (np.diff(world.state.training["error"].mean(axis=0)[::4]) > 0.0).all()
    inwards = world_of(setting, bootstrap=False)
    assert error(inwards) < 0.9 * 7.26
    assert spiral.divergence_threshold() == pytest.approx(0.129, abs=5e-4)
    below = world_of(setting, gamma=0.05, updates=20_000.0).state.training
    above = world_of(setting, gamma=0.3, updates=20_000.0).state.training
    assert below["w"].mean() < 0.0 < above["w"].mean()


@EXPERIMENTS.verify("The table, alive")
def test_three_settle_two_chatter_one_turns_three_leave(setting: Settings) -> None:
    """All nine cells of the notes' table: yes, chatters, no."""
    training = world_of(setting).state.training
    words = np.array([said.split(":")[0] for said, _ in convergence_labels(training)]).reshape(3, 3)
    assert words.tolist() == [
        ["settled", "chatters", "turns on"],
        ["settled", "chatters", "left all bounds"],
        ["settled", "left all bounds", "left all bounds"],
    ]
    assert (words == "settled").sum() == EXPERIMENTS.answer("The table, alive")
    late = training["distance"][:, 60:]
    assert (late[[0, 3, 6]] < 0.15).all()
    # Chattering is about the best that such features can express, and goes nowhere.
    assert np.ptp(late[[1, 4]], axis=1).max() < 0.3
    # The wheel goes round, each belief in its turn.
    beliefs = training["shown"][2, 60:] > 0.0
    assert 0.2 < beliefs.mean() < 0.8


@EXPERIMENTS.verify("Does the chatter fade?")
def test_policies_go_on_changing_where_rooms_look_alike(setting: Settings) -> None:
    training = world_of(setting).state.training
    half = int(np.searchsorted(training["steps"], convergence_table.EPISODES / 2))
    changes = training["changes"]
    for cell in (1, 4):
        assert changes[cell, -1] - changes[cell, half] > 0.25 * changes[cell, -1]
    assert (changes[[0, 3, 6], -1] <= 4).all()
    assert (changes[[0, 3, 6], -1] == changes[[0, 3, 6], 20]).all()


@EXPERIMENTS.verify("Use a sample fifty times")
def test_replay_comes_to_least_squares(setting: Settings) -> None:
    world = world_of(setting)
    squares = measured(world, "error_squares")
    assert error(world) == pytest.approx(squares, abs=0.01)
    answer = float(EXPERIMENTS.answer("Use a sample fifty times"))
    assert squares == pytest.approx(answer, abs=0.03)
    assert measured(world_of(setting, data="batch"), "error_now") == pytest.approx(squares)
    once = world_of(setting, data="latest", episodes=100.0, alpha=2e-4).state.training
    assert once["error"][:, 0].mean() == pytest.approx(0.41, abs=0.01)
    assert once["error"][:, -1].mean() == pytest.approx(0.36, abs=0.02)
    by_td = world_of(setting, batch_target="td", alpha=0.01)
    assert error(by_td) == pytest.approx(measured(by_td, "error_squares"), abs=0.03)


@EXPERIMENTS.verify("Swing up from scraps")
def test_most_learn_to_swing_up_from_random_scraps(setting: Settings) -> None:
    world = world_of(setting)
    greedy = world.state.training["greedy"]
    assert not world.state.trouble
    assert (greedy.min(axis=1) < 8.0).sum() >= 5
    assert 6.75 < np.median(greedy[:, 50:]) < 9.5
    fitted = world_of(setting, data="batch").state.training["greedy"]
    assert (fitted[:, -1] < 9.5).all()


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()


# What else must hold


def _params(world: World) -> ApproximationParams:
    assert isinstance(world.params, ApproximationParams)
    return world.params


def test_the_given_policy_is_judged_where_it_goes() -> None:
    """The weights of the pendulum's states are its visits: simulated anew."""
    task, mdp, policy = pendulum_prediction_task()
    visits = np.zeros(PENDULUM_GRID.X)
    for start in task.task.starts:
        x = int(start)
        while not mdp.terminal[x]:
            visits[x] += 1.0
            x = int(mdp.successors[x, policy[x]])
    np.testing.assert_allclose(task.weight, visits / visits.sum(), atol=1e-12)
    assert len(task.task.starts) > 0.95 * PENDULUM_GRID.X


def test_the_spiral_is_the_published_one() -> None:
    """V(w) solves dV/dw = (Q + eps I) V, and the mean step of TD(0) along it is as derived."""
    for w in (-5.0, 0.0, 3.7):
        V, h = spiral.spiral_values(np.array(w)), 1e-5
        slope = (spiral.spiral_values(np.array(w + h)) - spiral.spiral_values(np.array(w - h))) / (
            2.0 * h
        )
        growth = spiral.Q + spiral.EPS * np.eye(3)
        np.testing.assert_allclose(slope, growth @ V, atol=1e-6)
        for gamma in (0.0, 0.5, 1.0):
            step = slope @ (gamma * spiral.P - np.eye(3)) @ V / 3.0
            derived = 3.0 * gamma / 8.0 - spiral.EPS * (1.0 - gamma / 4.0)
            assert step == pytest.approx(derived * (V @ V) / 3.0, rel=1e-6)


def test_learning_goes_on_from_where_it_was() -> None:
    """A solution loaded, or a step size turned, does not begin anew."""
    world = world_of({"episodes": 500.0})
    weights = world.state.training["w"]
    world.change({"alpha": 1e-4})
    world.iterate()
    assert isinstance(world.latest, Snapshot)
    after = world.state.training
    assert after["steps"][-1] > 500
    assert 0.0 < np.abs(after["w"] - weights).max() < 0.1


def test_what_diverges_says_so() -> None:
    world = world_of({"alpha": 1.0, "features": "polynomial", "n": 9.0})
    assert "step size" in world.state.trouble
    assert np.isfinite(world.state.training["w"]).all()
    assert stop_reason(world) == "The weights left all bounds."


def begun(setting: Settings, iterations: int = 3) -> World:
    """A world that has learned a little."""
    world = World(find_lab(SLUG), setting)
    for _ in range(iterations):
        if world.solving:
            world.iterate()
    return world


SMALL = {"batch": 20.0, "passes": 5.0, "updates": 500.0, "episodes": 100.0}
SHORT_SWING_UP = {**SMALL, "world": "swing", "features": "fourier", "m": 3.0, "alpha": 0.02}


@pytest.mark.parametrize(
    ("setting", "menu"),
    [
        ({"data": "latest"}, "target"),
        ({"data": "replay"}, "batch_target"),
        ({"data": "batch"}, "batch_target"),
        ({}, "data"),
        (SHORT_SWING_UP, "data"),
        (SHORT_SWING_UP, "controller"),
    ],
    ids=str,
)
def test_every_entry_of_a_menu_learns_something_of_its_own(setting: Settings, menu: str) -> None:
    choice = ApproximationParams.tunables[menu]
    assert isinstance(choice, Choice)
    learned = [begun({**SMALL, **setting, menu: entry}) for entry in choice.options]
    assert all(world.params.acts(menu) for world in learned)
    weights = [world.state.training["w"].tobytes() for world in learned]
    assert len(set(weights)) == len(weights)


def test_an_oracle_fits_the_truth_where_the_batch_has_been() -> None:
    """With a table, exactly: however few its episodes are."""
    for world, tolerance in (("walk", 1e-12), ("surface", 1e-12)):
        setting = {"data": "batch", "batch_target": "oracle", "features": "table", "world": world}
        learned = begun({**SMALL, **setting})
        given = prediction.given_policy(_params(learned))
        v = given.values(learned.state.training["w"][0])
        met = v != 0.0
        assert met.sum() > 100
        np.testing.assert_allclose(v[met], given.task.truth[met], atol=tolerance)


@pytest.mark.parametrize(
    ("setting", "idle"),
    [
        ({"data": "batch"}, ("alpha", "omega", "passes", "episodes")),
        ({**SHORT_SWING_UP, "data": "batch"}, ("alpha", "omega", "passes", "episodes")),
        ({"features": "table"}, ("n",)),
        ({"world": "surface", "features": "table"}, ("m",)),
        ({"world": "star", "bootstrap": False}, ("gamma", "correct", "beta")),
        ({"world": "pair", "bootstrap": False}, ("gamma", "ending", "correct", "beta")),
        ({"world": "spiral", "bootstrap": False}, ("gamma",)),
        ({"data": "replay", "target": "td-lambda"}, ("decay",)),
    ],
    ids=str,
)
def test_a_knob_is_shown_where_it_acts(setting: Settings, idle: tuple[str, ...]) -> None:
    world = begun({**SMALL, **setting})
    for name in idle:
        assert not world.params.acts(name)
        tunable, value = ApproximationParams.tunables[name], getattr(world.params, name)
        other = tunable.at(0.37) if isinstance(tunable, Knob) else not value
        assert other != value
        assert bitwise_equal(begun({**SMALL, **setting, name: other}).state, world.state)
    on_policy = ApproximationParams(world="pair", bootstrap=False, off_policy=False)
    assert on_policy.acts("ending")


@pytest.mark.parametrize(
    ("world", "curve"), [("star", "weights"), ("pair", "weights"), ("spiral", "way_y")]
)
def test_the_learner_chosen_is_the_one_shown(world: str, curve: str) -> None:
    shown = begun({**SMALL, "world": world})
    fields = []
    for learner in (1.0, 2.0):
        shown.change({"learner": learner})
        fields.append(shown.lab.fields(shown.params, shown.state)[curve])
    assert not np.array_equal(fields[0], fields[1])
    training = shown.state.training
    np.testing.assert_array_equal(training["path"][:, -1], training["w"])


def test_no_two_of_the_nine_panels_are_the_same_curve() -> None:
    shown = begun({"world": "nine"}, 50).state.training["shown"]
    assert len({curve.tobytes() for curve in shown}) == 9


@pytest.mark.parametrize(
    ("setting", "pauses"),
    [
        ({"episodes": 20000.0, "features": "table", "target": "td-lambda"}, 50),
        ({"world": "surface", "features": "fourier", "m": 4.0, "data": "replay"}, 6),
        ({**SHORT_SWING_UP, "m": 10.0, "alpha": 0.005, "episodes": 2000.0}, 12),
        (
            {
                **SHORT_SWING_UP,
                "m": 10.0,
                "alpha": 0.005,
                "data": "replay",
                "batch": 300.0,
                "passes": 200.0,
            },
            30,
        ),
        ({**SHORT_SWING_UP, "data": "batch"}, 30),
    ],
    ids=str,
)
def test_long_work_pauses_and_comes_to_the_same(
    setting: Settings, pauses: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for piece in (resumable.OPERATIONS_BETWEEN_PAUSES, 1e12):
        monkeypatch.setattr(resumable, "OPERATIONS_BETWEEN_PAUSES", piece)
        world = World(find_lab(SLUG), setting)
        for waits, snapshot in enumerate(world.lab.solve(world.params, world.state)):
            if snapshot is not None:
                found.append((waits, snapshot.data))
                break
    (paused, learned), (_, at_once) = found
    assert paused >= pauses
    assert bitwise_equal(dict(learned), dict(at_once))
