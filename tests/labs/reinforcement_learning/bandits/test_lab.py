"""The lab of bandits: what its article claims, in numbers, and how a game goes on.

What a thousand players do on average is a statistic: tolerances are about three standard errors."""

import numpy as np
import pytest

from labs import resumable
from labs.algorithms.bandits import SAMPLE_MEAN
from labs.problems.episodes import step_size
from labs.reinforcement_learning.bandits.game import Game, initial_game, play
from labs.reinforcement_learning.bandits.params import TASK_COUNT, BanditParams
from tests.labs.contract import bitwise_equal
from tests.labs.experiments import ArticleExperiments
from tests.labs.solving import Settings, readouts, solve, solved_world, stop_reason

EXPERIMENTS = ArticleExperiments("labs.reinforcement_learning", "bandits")


def regrets(setting: Settings, **changes: float | str | bool) -> tuple[float, float]:
    """Of both strategies, at the end."""
    found = readouts(solved_world("bandits", {**setting, **changes}))
    return found["counted_first"], found["counted_second"]


@EXPERIMENTS.verify("Stuck behind the second best")
def test_the_greedy_one_is_stuck_in_half_of_the_tasks(setting: Settings) -> None:
    world = solved_world("bandits", setting)
    found = readouts(world)
    right = EXPERIMENTS.answer("Stuck behind the second best")
    assert isinstance(right, int)
    assert found["best_first"] == pytest.approx(right, abs=5.0)
    assert found["best_second"] == pytest.approx(95.0, abs=2.0)  # 1 - 0.1/2
    regret = np.sort(world.state.game["regret"][0])
    assert (regret < 10.0).mean() == pytest.approx(0.5, abs=0.05)
    assert (regret > 490.0).mean() == pytest.approx(0.5, abs=0.05)


@EXPERIMENTS.verify("Much at first, little later")
def test_exploring_less_and_less_is_better(setting: Settings) -> None:
    assert regrets(setting) == pytest.approx((363, 158), abs=25.0)
    assert regrets(setting, epsilon=0.1)[0] == pytest.approx(234, abs=12.0)
    assert regrets(setting, decay=1.0)[1] == pytest.approx(339, abs=30.0)
    assert EXPERIMENTS.answer("Much at first, little later") == "Blue, who seldom explores."


@EXPERIMENTS.verify("One unlucky cost")
def test_boltzmann_forgets_who_was_unlucky(setting: Settings) -> None:
    assert regrets(setting) == pytest.approx((396, 531), abs=40.0)
    assert regrets(setting, beta=4.0)[0] == pytest.approx(137, abs=8.0)
    assert EXPERIMENTS.answer("One unlucky cost") == "between 137 and 531."
    sorted_regret = np.sort(solved_world("bandits", setting).state.game["regret"][0])
    assert sorted_regret[TASK_COUNT // 4] < 60.0
    assert sorted_regret[-TASK_COUNT // 4] > 400.0


@EXPERIMENTS.verify("Bounds that close")
def test_the_bound_regrets_little(setting: Settings) -> None:
    found = readouts(solved_world("bandits", setting))
    assert found["counted_first"] == pytest.approx(EXPERIMENTS.answer("Bounds that close"), abs=4.0)
    assert found["counted_second"] == pytest.approx(234, abs=12.0)
    assert found["best_first"] == pytest.approx(89, abs=2.0)


@EXPERIMENTS.verify("Safe is dear")
def test_the_widest_bound_pays_off_late(setting: Settings) -> None:
    world = solved_world("bandits", setting)
    found = readouts(world)
    assert found["counted_first"] == pytest.approx(654, abs=20.0)
    assert found["counted_second"] == pytest.approx(531, abs=45.0)
    assert found["simple_first"] < 0.01
    assert EXPERIMENTS.answer("Safe is dear") == "No, it regrets more."
    safe, greedy = world.state.game["best"]
    assert safe[-100:].mean() > safe[400:500].mean() + 0.05
    assert abs(greedy[-100:].mean() - greedy[400:500].mean()) < 0.02
    assert world.state.game["largest"][0].mean() == pytest.approx(4.7, abs=0.3)


@EXPERIMENTS.verify("Weigh your doubts")
def test_thompson_regrets_least_of_all(setting: Settings) -> None:
    world = solved_world("bandits", setting)
    game, params = world.state.game, world.params
    assert isinstance(params, BanditParams)
    found = dict(zip(params.players, game["regrets"][:, -1], strict=True))
    said = {"Thompson": 75, "LCB": 91, "Boltzmann": 137, "ε decaying": 196}
    said |= {"ε-greedy": 234, "Greedy": 531}
    assert sorted(found, key=lambda name: found[name]) == list(said)
    for name, regret in said.items():
        assert found[name] == pytest.approx(regret, rel=0.08)
    assert 100 * game["best"][0, -100:].mean() == pytest.approx(92, abs=2.0)
    assert EXPERIMENTS.answer("Weigh your doubts") == "Below 91."
    two = solved_world("bandits", {**setting, "everybody": False}).state.game
    assert np.array_equal(two["regrets"], game["regrets"][:2])


@EXPERIMENTS.verify("Free lessons")
def test_free_lessons_go_to_the_doors_that_matter(setting: Settings) -> None:
    found = readouts(solved_world("bandits", setting))
    assert found["counted_first"] == pytest.approx(3.1, abs=0.7)
    assert found["counted_second"] == pytest.approx(7.9, abs=1.5)
    assert found["lessons_first"] == pytest.approx(41, abs=2.0)
    assert found["lessons_second"] == pytest.approx(154, abs=6.0)
    assert EXPERIMENTS.answer("Free lessons") == "Blue, who chose."
    assert float(setting["turns"]) / float(setting["pace"]) == 5.0


@EXPERIMENTS.verify("Over somebody's shoulder")
def test_who_never_tries_teaches_nobody(setting: Settings) -> None:
    world = solved_world("bandits", setting)
    found = readouts(world)
    assert found["counted_first"] == pytest.approx(53, abs=5.0)
    assert found["counted_second"] == pytest.approx(8, abs=1.5)
    assert found["lessons_first"] == pytest.approx(59, abs=5.0)
    assert found["lessons_second"] == pytest.approx(154, abs=6.0)
    assert EXPERIMENTS.answer("Over somebody's shoulder") == "More than 40."
    assert found["best_first"] == pytest.approx(100 / 3, abs=4.0)  # not the best in two of three


@pytest.mark.parametrize("kind", ["active", "offline"])
def test_only_the_test_counts_and_nobody_learns_in_it(kind: str) -> None:
    """Through the lessons all is as online; then Q stands still, and its least is chosen."""
    setting: Settings = {"turns": 200.0, "first": "bound", "second": "thompson"}
    online = solved_world("bandits", setting).state.game
    world = solved_world("bandits", {**setting, "kind": kind})
    game, curves = world.state.game, world.lab.fields(world.params, world.state)
    assert np.array_equal(game["regrets"][:, :200], online["regrets"])
    assert np.array_equal(game["q"], online["q"])
    assert np.array_equal(game["tried"], online["visits"])
    assert (game["visits"].sum(axis=2) == 400).all()
    assert not curves["counted"][:200].any()
    least = np.take_along_axis(game["visits"] - game["tried"], game["q"].argmin(2)[..., None], 2)
    assert (least == 200).all()
    per_turn = np.diff(curves["counted"][199:], axis=0)
    np.testing.assert_allclose(per_turn, np.tile(game["simple"][:, -1], (200, 1)), atol=1e-9)
    assert np.array_equal(curves["counted"][-1], game["regrets"][:, -1] - game["regrets"][:, 199])


def test_means_of_the_notes_two_doors() -> None:
    """Left 0, right -1 and -3: Q = 0 and -2, as the article says."""
    q = np.zeros(2)
    for door, nth, cost in ((0, 1, 0.0), (1, 1, -1.0), (1, 2, -3.0)):
        q[door] += step_size(SAMPLE_MEAN, nth) * (cost - q[door])
    assert q.tolist() == [0.0, -2.0]


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()


def test_means_that_drift_ask_to_forget() -> None:
    setting: Settings = {"first": "epsilon", "second": "bound", "drift": 0.05}
    mean = readouts(solved_world("bandits", setting))
    constant = readouts(solved_world("bandits", {**setting, "forget": True}))
    for name in ("simple_first", "simple_second"):
        assert constant[name] < 0.75 * mean[name]


def test_both_strategies_meet_the_same_luck_and_a_game_begins_anew() -> None:
    """Equal strategies play alike; a changed knob plays the same tasks from the first turn on."""
    world = solved_world("bandits", {"first": "bound", "second": "bound", "turns": 200.0})
    game = world.state.game
    assert np.array_equal(game["regret"][0], game["regret"][1])
    assert stop_reason(world) == f"200 turns of {TASK_COUNT} players each."
    world.change({"bound": 2.0})
    solve(world)
    again = world.state.game
    assert np.array_equal(again["begun"], game["begun"])
    assert again["regrets"].shape == (2, 200)
    assert not np.array_equal(again["regret"], game["regret"])
    world.change({"bound": 1.0})
    solve(world)
    assert np.array_equal(world.state.game["regret"], game["regret"])


def test_the_slow_game_is_one_of_the_thousand() -> None:
    """At its end the players of the scene have done what those of the same task did."""
    setting: Settings = {"turns": 100.0, "pace": 50.0, "task": 3.0, "first": "thompson"}
    world = solved_world("bandits", setting)
    for _ in range(110):
        world.advance()
    game, live = world.state.game, world.state.live
    assert np.array_equal(live["visits"][:, 0], game["visits"][:, 2])
    assert np.array_equal(live["regret"][:, 0], game["regret"][:, 2])
    world.change({"task": 4.0})
    world.advance()
    assert not world.state.live["visits"].any()


def test_long_games_pause_and_come_to_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """250 turns, the last lessons and the first of the test among them."""
    params = BanditParams(everybody=True, turns=150.0, kind="active", drift=0.05)
    found = []
    for piece in (resumable.OPERATIONS_BETWEEN_PAUSES, 1e12):
        monkeypatch.setattr(resumable, "OPERATIONS_BETWEEN_PAUSES", piece)
        found.append(ended(play(params, initial_game(params, np.random.default_rng(1)), 250)))
    (pauses, game), (fewest, at_once) = found
    assert fewest == 2 * len(params.strategies)
    assert pauses >= 4 * fewest
    assert bitwise_equal(game, at_once)


def ended(work: resumable.Resumable[Game]) -> tuple[int, dict[str, np.ndarray]]:
    """How often it paused, and its result."""
    pauses = 0
    while True:
        try:
            next(work)
        except StopIteration as end:
            return pauses, dict(end.value)
        pauses += 1
