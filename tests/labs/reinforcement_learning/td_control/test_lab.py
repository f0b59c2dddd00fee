"""The lab td-control: what its article claims, in numbers, and what its training must obey.

What ten learners do on average is a statistic: where a processor rounds otherwise than this one,
it comes out otherwise. Tolerances are about three standard errors."""

import itertools
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from labs.algorithms.policy_evaluation import exact_values
from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.errors import ParameterError
from labs.lab import Snapshot
from labs.params import Value
from labs.reinforcement_learning.td_control.lab import TdControl, TdState
from labs.reinforcement_learning.td_control.params import BATCHES, TdParams
from labs.reinforcement_learning.td_control.training import train
from labs.scene import NullScene
from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.grid_world.picture import board
from tests.labs.experiments import ArticleExperiments
from tests.labs.solving import solve, solved_world

EXPERIMENTS = ArticleExperiments("labs.reinforcement_learning", "td_control")
ENTRY = find_lab("td-control")
LAB = TdControl()


def world_of(setting: Mapping[str, Value], **changes: Value) -> World:
    """A world whose training has ended."""
    return solved_world("td-control", {**setting, **changes})


def params_of(world: World) -> TdParams:
    assert isinstance(world.params, TdParams)
    return world.params


def training_cost(world: World, part: slice = slice(BATCHES // 2, None)) -> np.ndarray:
    """(M,) mean cost of an episode while learning; of the training's second half."""
    mean: np.ndarray = world.state.training["online"][:, :, part].mean(axis=(1, 2))
    return mean


def greedy(world: World) -> np.ndarray:
    """(M, S) cost of each learner's greedy policy in the end."""
    costs: np.ndarray = world.state.training["offline"][..., -1]
    return costs


def first_optimal(world: World) -> np.ndarray:
    """(S,) episodes of the last training before each learner's greedy policy was optimal."""
    best = world.lab.measure(world.params, world.state)["optimum"]
    history = world.state.training["offline"][0][:, -BATCHES:] <= best + 1e-9
    assert history.any(axis=1).sum() >= 8
    batch = np.diff(world.state.training["episodes"])[-1]
    first: np.ndarray = np.where(history.any(axis=1), history.argmax(axis=1), BATCHES) * batch
    return first


# The experiments


@EXPERIMENTS.verify("Along the edge or not")
def test_on_and_off_policy_part_at_the_cliff(setting: Mapping[str, Value]) -> None:
    world = world_of(setting)
    q_learning, sarsa = greedy(world)
    assert (q_learning == 13.0).all()
    assert np.median(sarsa) == 17.0
    assert (sarsa > 13.0).all()
    assert training_cost(world) == pytest.approx([50, 27], abs=3.0)
    assert EXPERIMENTS.answer("Along the edge or not") == "SARSA, off the edge."


@EXPERIMENTS.verify("Look where you know little")
def test_a_confidence_bound_explores_cheaply(setting: Mapping[str, Value]) -> None:
    assert setting["map"] == MAPS["windy"] + "\n"
    assert training_cost(world_of(setting)) == pytest.approx([15, 15], abs=0.05)
    assert EXPERIMENTS.answer("Look where you know little") == 15
    dice = training_cost(world_of(setting, explorer="epsilon-greedy"))
    assert dice == pytest.approx([17, 21], abs=0.7)
    wide = training_cost(world_of(setting, bound=10.0))
    assert (wide > dice - 4.0).all()
    assert wide[0] > 25.0


@EXPERIMENTS.verify("Optimism explores")
def test_optimism_explores(setting: Mapping[str, Value]) -> None:
    assert (greedy(world_of(setting))[0] == 13.0).all()
    pessimists = greedy(world_of(setting, q0=50.0))[0]
    assert (pessimists > 13.0).any()
    assert (pessimists == 13.0).any()
    assert EXPERIMENTS.answer("Optimism explores") == "All ten find the best way."


@EXPERIMENTS.verify("Explore less and less")
def test_fading_exploration_dares_more(setting: Mapping[str, Value]) -> None:
    world = world_of(setting)
    assert training_cost(world)[1] == pytest.approx(14.5, abs=0.7)
    assert training_cost(world_of(setting, fading=0.0))[1] == pytest.approx(28, abs=1.5)
    assert np.median(greedy(world)[1]) == 15.0
    assert EXPERIMENTS.answer("Explore less and less") == "Yes."


@EXPERIMENTS.verify("A step that shrinks")
def test_steps_that_shrink_come_closer(setting: Mapping[str, Value]) -> None:
    off = world_of(setting).state.training["off"][0, :, -1].mean()
    assert off == pytest.approx(0.9, abs=0.2)
    constant = world_of(setting, omega=0.0, alpha=0.5).state.training["off"][0, :, -1].mean()
    assert constant == pytest.approx(3.0, abs=0.5)
    mean = world_of(setting, omega=1.0).state.training["off"][0, :, -1].mean()
    assert mean == pytest.approx(9, abs=1.0)
    assert EXPERIMENTS.answer("A step that shrinks") == "The shrinking step."


@EXPERIMENTS.verify("Zero is where it started")
def test_lambda_zero_is_sarsa(setting: Mapping[str, Value]) -> None:
    for name, values in world_of(setting).state.training.items():
        if values.ndim >= 2 and name != "cells":
            assert np.array_equal(values[0], values[1]), name
    apart = world_of(setting, decay=0.5).state.training["q"]
    assert not np.array_equal(apart[0], apart[1])
    assert EXPERIMENTS.answer("Zero is where it started") == "Not at all."


@EXPERIMENTS.verify("News travels")
def test_a_memory_learns_faster_at_first(setting: Mapping[str, Value]) -> None:
    world = world_of(setting)
    assert training_cost(world, slice(0, 25)) == pytest.approx([85, 132], abs=12.0)
    late = training_cost(world, slice(150, None))
    assert late[0] > late[1], "and pays more later"
    assert EXPERIMENTS.answer("News travels") == "Yes, in the first episodes."


@EXPERIMENTS.verify("Traces pile up")
def test_accumulating_traces_diverge(setting: Mapping[str, Value]) -> None:
    world = world_of(setting)
    assert "diverged" in world.trouble
    assert world.state.training["episodes"][-1] <= 10
    world.change({"replacing": True})
    solve(world)
    assert not world.trouble
    assert world.state.training["episodes"][-1] == 500, "it began anew"
    assert EXPERIMENTS.answer("Traces pile up") == "They grow beyond all bounds."


@EXPERIMENTS.verify("Move the goal")
def test_a_goal_close_by_is_found_at_once(setting: Mapping[str, Value]) -> None:
    world = world_of(setting)
    assert (greedy(world) == 21.0).all()
    fresh = {}
    for cell in ((1, 11), (7, 2)):
        moved = clicked(world_of(setting), cell)
        solve(moved)
        again = first_optimal(moved)
        fresh[cell] = first_optimal(world_of({**setting, "map": params_of(moved).map}))
        if cell == (1, 11):
            assert np.median(again) <= 3
            assert np.median(fresh[cell]) == pytest.approx(60, abs=15)
        else:
            pulled = training_cost(moved, slice(-BATCHES, -BATCHES + 20))[0]
            assert np.median(again) > 10
            assert (
                pulled
                > 2
                * training_cost(world_of({**setting, "map": params_of(moved).map}), slice(20))[0]
            )
    assert EXPERIMENTS.answer("Move the goal") == "It depends on where it goes."


def clicked(world: World, cell: tuple[int, int]) -> World:
    """The world after a click in the middle of a cell."""
    x, y, z = board(GridWorld.parse(params_of(world).map)).centers[cell]
    world.hold("board", (float(x), float(y), float(z)))
    return world


@EXPERIMENTS.verify("Swing up from nothing")
def test_the_pendulum_learns_to_swing_up(setting: Mapping[str, Value]) -> None:
    world = world_of(setting)
    assert world.lab.measure(world.params, world.state)["optimum"] == pytest.approx(6.75, abs=0.005)
    assert greedy(world)[0] == pytest.approx(np.full(5, 6.754), abs=1e-3)
    training = world.state.training
    near = np.median(training["offline"][0], axis=0) < 1.1 * 6.75
    assert training["episodes"][near].min() == 600
    settled = int(np.flatnonzero(~near)[-1]) + 1
    assert training["episodes"][settled] == EXPERIMENTS.answer("Swing up from nothing")
    early = training["episodes"] <= 200
    assert np.median(training["offline"][0][:, early]) > 14.0
    assert training["most"][0, :, -1].min() > 3.0
    assert (training["visits"][0] == 0).mean() > 0.1
    # The real pendulum, by its equation of motion, stands after a few seconds.
    for _ in range(450):
        world.advance()
    q, _ = world.state.walk.at[0]
    assert abs(np.cos(q) + 1.0) < 0.02


@EXPERIMENTS.verify("Over somebody's shoulder")
def test_the_pupil_surpasses_its_teacher(setting: Mapping[str, Value]) -> None:
    assert greedy(world_of(setting))[0] == pytest.approx(np.full(5, 6.9), abs=0.05)
    blind = world_of(setting, epsilon=0.0)
    task = params_of(blind).task
    x, total, discount = task.start, 0.0, 1.0
    while discount > 1e-12:
        total += discount * task.mdp.C[x, task.reference_policy[x]]
        x = int(task.mdp.successors[x, task.reference_policy[x]])
        discount = discount * task.mdp.gamma
    assert total == pytest.approx(14.6, abs=0.05)
    assert greedy(blind)[0] == pytest.approx(np.full(5, total), abs=1e-9)
    assert np.median(greedy(world_of(setting, q0=0.0))) == pytest.approx(17, abs=0.6)
    assert EXPERIMENTS.answer("Over somebody's shoulder") == "Much better."


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()


# What training and editing must obey ----------------------------------------------------------


def test_a_snapshot_alone_shows_its_iteration_and_can_be_gone_on_from() -> None:
    params = TdParams()
    start = LAB.init(params, np.random.default_rng(0))
    snapshots = list(LAB.solve(params, start))
    last = LAB.accept(params, start, snapshots[-1])
    back = LAB.accept(params, last, snapshots[9])
    assert back.training["episodes"][-1] == 20
    for mine, kept in zip(LAB.solve(params, back), snapshots[10:14], strict=False):
        assert all(np.array_equal(mine.data[name], kept.data[name]) for name in kept.data)
    size = sum(np.asarray(part).nbytes for part in snapshots[-1].data.values())
    assert size < 1_000_000


def test_batches_are_small_while_episodes_are_long() -> None:
    """Random walks on the windy grid with traces of everything: one episode is work enough."""
    params = TdParams(
        map=MAPS["windy"],
        method="sarsa-lambda",
        second="sarsa-lambda",
        decay=1.0,
        replacing=True,
        epsilon=1.0,
        episodes=2000.0,
    )
    state = LAB.init(params, np.random.default_rng(0))
    some = list(itertools.islice(LAB.solve(params, state), 10))
    assert [snapshot.data["episodes"][-1] for snapshot in some] == list(range(1, 11))
    quick = params.change({"method": "q-learning", "second": "none", "epsilon": 0.0})
    counts = [
        s.data["episodes"][-1] for s in LAB.solve(quick, LAB.init(quick, np.random.default_rng(0)))
    ]
    assert counts[-1] == 2000
    assert max(np.diff(counts)) == 8


def test_the_largest_snapshot_is_below_a_megabyte() -> None:
    params = TdParams(system="pendulum", gamma=0.9)
    state = LAB.init(params, np.random.default_rng(0))
    first = next(iter(LAB.solve(params, state)))
    assert sum(np.asarray(part).nbytes for part in first.data.values()) < 1_000_000


def test_a_map_that_changes_keeps_what_was_learned_of_each_cell() -> None:
    world = World(ENTRY, {"brush": "#"})
    for _ in range(50):
        world.iterate()
    before = world.state.training
    old = {tuple(cell): x for x, cell in enumerate(before["cells"].tolist())}
    clicked(world, (1, 5))
    assert params_of(world).map.splitlines()[1] == ".....#......"
    assert world.solving
    fields = LAB.fields(params_of(world), world.state)
    assert fields["q"].shape == (4, 12)
    world.iterate()
    after = world.state.training
    assert len(after["cells"]) == len(old) - 1
    far = old[(0, 0)]
    new = after["cells"].tolist().index([0, 0])
    assert (after["visits"][:, :, new] >= before["visits"][:, :, far]).all()
    assert (after["visits"][:, :, new] - before["visits"][:, :, far]).max() < 100
    clicked(world, (1, 5))
    assert params_of(world).map == MAPS["cliff"], "a wall clicked once more is free again"


def test_clicks_that_mean_nothing_change_nothing_or_say_why() -> None:
    params = TdParams(brush="#")
    assert LAB.edit(params, "board", (9.0, 9.0, 0.0)) == {}
    assert LAB.edit(params, "policy", (0.0, 0.0, 0.0)) == {}
    x, y, z = board(GridWorld.parse(params.map)).centers[3, 11]
    with pytest.raises(ParameterError, match="no goal"):
        LAB.edit(params, "board", (float(x), float(y), float(z)))


def test_a_map_is_checked_where_it_is_typed() -> None:
    with pytest.raises(ParameterError, match="row 2 of the map"):
        TdParams().change({"map": "S..\n.?.\n..G"})


def test_walkers_follow_the_greedy_way_and_set_out_again() -> None:
    world = world_of({})
    cells = []
    for _ in range(600):
        world.advance()
        cells.append(tuple(world.state.walk.at[0].astype(int)))
    way = list(dict.fromkeys(cells))
    assert way == [(3, 0), *((2, c) for c in range(12)), (3, 11)]
    assert cells.count((3, 0)) > 30, "it comes back to the start"


def test_a_walk_survives_a_smaller_map() -> None:
    world = world_of({})
    for _ in range(300):
        world.advance()
    world.change({"map": "S.G"})
    for _ in range(50):
        world.advance()
    LAB.draw(NullScene(), params_of(world), world.state)
    solve(world)
    assert greedy(world).max() == 2.0


def test_an_endless_world_has_no_optimum_and_says_nothing_of_it() -> None:
    world = world_of({"map": "S.#G"})
    measured = LAB.measure(params_of(world), world.state)
    assert "optimum" not in measured
    assert "best_first" not in measured
    fields = LAB.fields(params_of(world), world.state)
    assert np.isnan(fields["error"]).all(), "no cell is compared with what does not exist"
    assert np.isnan(fields["visits"]).tolist() == [[False, False, True, False]]
    assert len(fields["best_y"]) == 0


@EXPERIMENTS.verify("Thin ice")
def test_on_thin_ice_one_walks_into_the_edge(setting: Mapping[str, Value]) -> None:
    world = world_of(setting)
    task, left = params_of(world).task, 3
    best = -task.q_star[task.start]
    assert best.argmax() == left
    assert LAB.measure(params_of(world), world.state)["optimum"] == pytest.approx(-0.542, abs=5e-4)
    policies = world.state.training["q"][0].argmin(axis=2)
    assert (policies[:, task.start] == left).all()
    worth = np.sort([-exact_values(task.mdp, policy)[task.start] for policy in policies])
    assert worth[5] > 0.525, "at least five"
    assert worth[-1] <= best.max() + 1e-12
    assert EXPERIMENTS.answer("Thin ice") == "Left, into the edge."


def test_the_best_policy_costs_the_optimum_and_not_what_an_episode_of_it_costs() -> None:
    """12.737; what its first 100 steps cost is 12.685, and no policy is cheaper than the best."""
    params = TdParams(system="pendulum", second="none", gamma=0.99, effort=1.0)
    state, task = LAB.init(params, np.random.default_rng(0)), params.task
    q = -np.eye(task.mdp.U)[task.q_star.argmin(axis=1)]
    knowing = {**state.training, "q": np.tile(q, (1, 5, 1, 1))}
    rule = params.rule._replace(alpha=0.0)
    training = train(task, params.behaviour, rule, params.method_numbers, knowing, 1)
    measured = LAB.measure(params, replace(state, training=training))
    assert measured["greedy_first"] == pytest.approx(12.737, abs=1e-3)
    assert measured["greedy_first"] == pytest.approx(measured["optimum"], rel=1e-12)
    assert measured["best_first"] == 5.0


def test_diverged_learners_are_accepted_as_trouble() -> None:
    params = TdParams()
    state = LAB.init(params, np.random.default_rng(0))
    bad = {**state.training, "sound": np.array(False)}
    troubled: TdState = LAB.accept(params, state, Snapshot(1, bad, "The estimates diverged."))
    assert troubled.trouble.startswith("The estimates diverged")
