"""The lab markov: what its article claims, in numbers, and what its world must obey."""

import json
from collections.abc import Mapping

import numpy as np
import pytest

from labs.engine.catalog import find_lab
from labs.engine.headless import run_headless
from labs.engine.run import World
from labs.errors import ParameterError
from labs.lab import Inputs
from labs.params import Value
from labs.reinforcement_learning.markov.chains import CHAINS
from labs.reinforcement_learning.markov.graph import bead_place
from labs.reinforcement_learning.markov.lab import Markov
from labs.reinforcement_learning.markov.params import MAX_SHOWN_STATES, MarkovParams
from labs.reinforcement_learning.markov.plots import GAMMAS
from labs.reinforcement_learning.markov.reward_process import RewardProcess
from labs.scene import NullScene
from tests.labs.experiments import ArticleExperiments
from tests.labs.solving import solve, solved_world

LAB = Markov()
ARTICLE = ArticleExperiments("labs.reinforcement_learning", "markov")


def params_of(world: World) -> MarkovParams:
    """With their type."""
    assert isinstance(world.params, MarkovParams)
    return world.params


def process_of(world: World) -> RewardProcess:
    return params_of(world).process


def walk_steps(setting: Mapping[str, Value], steps: int, seed: int = 0) -> World:
    """A world whose token has gone so many steps, and half of the next."""
    world = World(find_lab("markov"), setting, seed)
    params = params_of(world)
    for _ in range(round((steps + 0.5) / params.pace / LAB.period)):
        world.state = LAB.step(params, Inputs(), world.state)
    return world


def measured(world: World) -> dict[str, np.ndarray]:
    return {k: np.asarray(v) for k, v in LAB.measure(params_of(world), world.state).items()}


def field_names(world: World) -> dict[str, np.ndarray]:
    return dict(LAB.fields(params_of(world), world.state))


def notes_text(world: World) -> str:
    return "\n".join(LAB.notes(params_of(world), world.state).values())


# The experiments


@ARTICLE.verify("Where the weeks go")
def test_where_the_weeks_go(setting: Mapping[str, Value]) -> None:
    early, late = walk_steps({**setting, "pace": 5.0}, 15), walk_steps(setting, 10_000)
    now = measured(early)
    assert now["steps"] == 15
    assert now["off"] < 0.2
    assert now["far"].argmax() == 4
    assert now["far"][4] == pytest.approx(0.28, abs=0.005)
    assert MarkovParams().process.P[4, 4] == pytest.approx(0.8)
    assert 0.2 < measured(late)["visits_off"] < 2.5
    # From any start.
    far = MarkovParams().process.long_run
    np.testing.assert_allclose(far, np.tile(far[0], (6, 1)), atol=1e-12)
    after = np.linalg.matrix_power(MarkovParams().process.P, 15)
    off = 50 * np.abs(after - far).sum(axis=1)
    assert off[0] < 0.2
    assert 1.0 < off.max() < 1.1
    assert ARTICLE.answer("Where the weeks go") == "No."


@ARTICLE.verify("Round and round")
def test_round_and_round(setting: Mapping[str, Value]) -> None:
    world = walk_steps(setting, 11)
    fields = field_names(world)
    found = fields["re"] + 1j * fields["im"]
    for root in (1, 1j, -1, -1j):
        assert np.abs(found - root).min() < 1e-12
    assert sorted(fields["mu"]) == [0.0, 0.0, 0.0, 1.0]
    np.testing.assert_allclose(fields["far"], 0.25)
    assert "multiples of 4 steps" in notes_text(world)
    assert measured(walk_steps({**setting, "pace": 50.0}, 400))["visits_off"] < 0.5
    assert ARTICLE.answer("Round and round") == "It goes round for ever."


@ARTICLE.verify("A little hesitation")
def test_a_little_hesitation(setting: Mapping[str, Value]) -> None:
    now = measured(walk_steps(setting, 60))
    assert now["second"] == pytest.approx(0.943, abs=5e-4)
    assert now["steps"] == 60
    assert now["off"] < 1.5
    np.testing.assert_allclose(now["far"], [0.294, 0.235, 0.235, 0.235], atol=5e-4)
    assert "Aperiodic" in notes_text(walk_steps(setting, 1))
    assert "Periodic" in notes_text(walk_steps({**setting, "shift": 0.0}, 1))
    assert ARTICLE.answer("A little hesitation") == "Everything: it settles."


@ARTICLE.verify("One-way doors")
def test_one_way_doors(setting: Mapping[str, Value]) -> None:
    desks, runs = 0, 40
    for seed in range(runs):
        world = walk_steps(setting, 200, seed)
        visits = world.state.walk.visits
        at_desk, at_clock = visits[1:3].any(), visits[3:].any()
        assert at_desk != at_clock
        desks += int(at_desk)
    # Within three standard deviations of 60 %.
    assert abs(desks - 0.6 * runs) < 3 * np.sqrt(runs * 0.6 * 0.4)
    fields = field_names(world)
    found = fields["re"] + 1j * fields["im"]
    assert (np.abs(found - 1.0) < 1e-9).sum() == 2
    assert (np.abs(found + 1.0) < 1e-9).sum() == 1
    assert fields["far"][1:3].sum() == pytest.approx(0.6)
    assert process_of(world).transient.tolist() == [True, False, False, False, False]
    assert ARTICLE.answer("One-way doors") == "There are two, and all their mixtures."


@ARTICLE.verify("Myopic or far-sighted")
def test_myopic_or_far_sighted(setting: Mapping[str, Value]) -> None:
    process = MarkovParams().change(setting).process

    def V(gamma: float) -> np.ndarray:
        return process.cost_to_go(gamma).V

    np.testing.assert_array_equal(V(0.0), [-1, -2, -3, 1, 2, 0])
    np.testing.assert_allclose(V(0.97)[[0, 3]], [-15.22, -15.17], atol=5e-3)
    assert V(0.978)[0] < V(0.978)[3]
    for gamma in (0.979, setting["gamma"]):
        assert V(float(gamma))[3] < V(float(gamma))[0]
    fields = field_names(run_headless("markov", setting, seconds=0.0))
    means = fields["means"]
    np.testing.assert_allclose(means[0], V(0.0), atol=1e-12)
    assert (GAMMAS[0], GAMMAS[-1]) == (0.0, 1.0)
    np.testing.assert_allclose(means[-1], -0.412, atol=5e-4)
    assert ARTICLE.answer("Myopic or far-sighted") == "Yes, one near 1."


@ARTICLE.verify("No end, no sum")
def test_no_end_no_sum(setting: Mapping[str, Value]) -> None:
    world = World(find_lab("markov"), setting)
    values = []
    while world.solving:
        world.iterate()
        values.append(world.state.V)
    np.testing.assert_allclose(values[-1] - values[-2], -0.412, atol=5e-4)
    assert world.latest is not None
    assert world.latest.done == "Stopped at k = 200: V has no limit."
    assert "I − P is singular" in notes_text(world)
    assert "costs −0.412 on average" in notes_text(world)
    process = process_of(world)
    assert np.linalg.matrix_rank(np.eye(6) - process.P) == 5
    assert "value" not in measured(world)
    assert np.isnan(field_names(world)["exact"]).all()
    assert len(field_names(world)["error"]) == 0
    assert ARTICLE.answer("No end, no sum") == "There is no $V$."


@ARTICLE.verify("The last week")
def test_the_last_week(setting: Mapping[str, Value]) -> None:
    world = run_headless("markov", setting, seconds=0.0)
    fields, P = field_names(world), process_of(world).P
    np.testing.assert_allclose(fields["exact"][[0, 4]], [-4.93, 5.32], atol=5e-3)
    np.testing.assert_allclose(fields["V"], fields["exact"], atol=1e-8)
    assert fields["exact"][5] == 0.0
    assert np.linalg.matrix_rank(np.eye(6) - P) == 5
    assert np.linalg.matrix_rank(np.eye(5) - P[:5, :5]) == 5
    assert "V exists all the same" in notes_text(world)
    assert ARTICLE.answer("The last week") == "Yes."


@ARTICLE.verify("How long will a gambler last?")
def test_how_long_will_a_gambler_last(setting: Mapping[str, Value]) -> None:
    world = run_headless("markov", setting, seconds=0.0)
    states = process_of(world).table.states
    V = dict(zip(states, field_names(world)["exact"], strict=True))
    expected = {"2 coins": 4.0, "3 coins": 3.0, "1 coin": 3.0, "Broke": 0.0, "Rich": 0.0}
    assert pytest.approx(expected) == V
    far = process_of(world).long_run
    assert field_names(world)["far"][states.index("Broke")] == pytest.approx(0.5)
    assert far[states.index("3 coins"), states.index("Broke")] == pytest.approx(0.25)
    assert V["2 coins"] == pytest.approx(ARTICLE.answer("How long will a gambler last?"))


@ARTICLE.verify("Never mend a running machine?")
def test_never_mend_a_running_machine(setting: Mapping[str, Value]) -> None:
    Q = field_names(run_headless("markov", setting, seconds=0.0))["Q"]
    expected = [[35.9, 36.3], [49.1, 37.5], [60.0, 46.2]]
    np.testing.assert_allclose(Q, expected, atol=0.051)
    assert Q.argmin(axis=1).tolist() == [0, 1, 1]
    myopic = field_names(run_headless("markov", {**setting, "gamma": 0.4}, seconds=0.0))["Q"]
    assert myopic.argmin(axis=1).tolist() == [0, 0, 1]
    assert ARTICLE.answer("Never mend a running machine?") == "Where it is worn or broken."


def test_every_experiment_is_verified() -> None:
    ARTICLE.check_all_are_verified()


# Editing


def begun(setting: Mapping[str, Value] = {}) -> World:
    """A world whose V is solved and whose time stands at 0."""
    return solved_world("markov", setting)


def test_a_bead_sets_its_probability_and_the_others_make_room() -> None:
    world = begun({"shift": 0.5})
    before = process_of(world)
    for p in (0.2, 1.0, 0.35):
        place = bead_place(before.places, 0, 4, p)
        world.hold("bead 5", (float(place[0]), float(place[1]), 0.3))
        row = process_of(world).P[0]
        assert row[4] == pytest.approx(p, abs=1e-4)
        assert row.sum() == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_array_equal(process_of(world).P[1:], before.P[1:])
    # Having had all, it gives back by the chain's own proportions, and the shift is spent.
    np.testing.assert_allclose(row[1] / row[3], 6.0, rtol=1e-2)
    assert params_of(world).shift == 0.0
    assert world.runs == 1, "the walk goes on"


def test_a_click_on_a_tile_chooses_its_state() -> None:
    world = begun()
    world.hold("tile 5", (0.0, 0.0, 0.0))
    assert params_of(world).source == "5"
    names = drawn(world)
    assert {name for name in names if name.startswith("bead")} == {
        "bead 1",
        "bead 2",  # chosen as the target, of probability 0 so far
        "bead 4",
        "bead 5",
    }


@pytest.mark.parametrize("handle", ["tile 0", "tile x", "bead 13", "bead", "bead 9", "other 1"])
def test_what_is_not_there_is_not_edited(handle: str) -> None:
    assert LAB.edit(MarkovParams(), handle, (0.0, 0.0, 0.0)) == {}


def test_a_token_that_is_set_down_begins_anew() -> None:
    world = begun({"pace": 50.0})
    for _ in range(100):
        world.advance()
    where = process_of(world).places
    for _ in range(3):
        world.hold("token", (float(where[3, 0]) + 0.05, float(where[3, 1]), 0.7))
        world.advance()
    walk = world.state.walk
    assert (walk.start, walk.at, walk.steps, walk.visits.sum()) == (3, 3, 0, 1.0)
    assert walk.mu[3] == 1.0
    assert world.t == pytest.approx(103 * LAB.period)
    world.hold("token", None)
    for _ in range(10):
        world.advance()
    assert world.state.walk.steps > 0
    assert world.state.walk.start == 3


def test_an_edit_while_it_walks_acts_on_the_next_step() -> None:
    world = begun({"pace": 50.0, "chain": "lights"})
    for _ in range(20):
        world.advance()
    world.change({"rows": "\n".join(f"{x}: 0 0 1 0" for x in range(1, 5))})
    for _ in range(2):
        world.advance()
    np.testing.assert_array_equal(world.state.walk.mu, [0.0, 0.0, 1.0, 0.0])


# Tables


def test_a_pasted_table_is_walked() -> None:
    table = '[{"state": "A", "cost": 2, "to": {"B": 1}}, {"state": "B", "to": {"B": 1}}]'
    world = begun({"chain": "table", "table": table, "gamma": 1.0})
    np.testing.assert_allclose(world.state.V, [2.0, 0.0])
    assert {"name 1", "name 2"} <= drawn(world)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"table": "state, A, B\nA, 0.5, 0.4\nB, 0, 1"}, "row 1 (A): the probabilities sum to 0.9"),
        ({"rows": "1: 0.5 x"}, "a changed row is the number of a state"),
    ],
)
def test_a_wrong_text_is_refused_with_its_row(changes: dict[str, Value], said: str) -> None:
    with pytest.raises(ParameterError) as refused:
        MarkovParams().change(changes)
    assert said in str(refused.value)


def test_more_states_than_the_circle_holds_are_refused() -> None:
    def table(n: int) -> str:
        rows = [{"state": f"{x}", "to": {f"{x}": 1}} for x in range(n)]
        return json.dumps(rows)

    check = MarkovParams().change({"chain": "table", "table": table(MAX_SHOWN_STATES)})
    assert len(check.process.P) == MAX_SHOWN_STATES
    with pytest.raises(ParameterError, match="13 states: at most 12"):
        MarkovParams().change({"table": table(MAX_SHOWN_STATES + 1)})


def test_the_random_chain_has_a_number() -> None:
    a, b = (begun({"chain": "random", "number": n}) for n in (1.0, 2.0))
    assert not np.array_equal(process_of(a).P, process_of(b).P)


# Plots and scene


def drawn(world: World) -> set[str]:
    scene = NullScene()
    LAB.draw(scene, params_of(world), world.state)
    return set(scene.names)


@pytest.mark.parametrize("chain", CHAINS)
def test_the_scene_shows_every_state_and_every_transition(chain: str) -> None:
    names = drawn(begun({"chain": chain}))
    n = len(MarkovParams(chain=chain).process.P)
    expected = {f"{kind} {x + 1}" for kind in ("tile", "state", "name") for x in range(n)}
    assert expected | {"transitions", "walker", "token"} <= names


def test_controls_leave_nothing_to_drag() -> None:
    assert not [name for name in drawn(begun({"chain": "machine"})) if name.startswith("bead")]


def test_the_errors_begin_at_zero_iterations_whenever_something_is_turned() -> None:
    world = begun()
    whole = world.state.errors
    world.change({"gamma": 0.5})
    world.change({"gamma": 0.9})
    solve(world)
    np.testing.assert_array_equal(world.state.errors, whole)
    assert whole[0] == pytest.approx(np.abs(process_of(world).cost_to_go(0.9).V).max())


def test_a_snapshot_alone_shows_its_iteration() -> None:
    """Looking back: any of them, accepted into any state, gives the same V and errors."""
    world = World(find_lab("markov"))
    params = params_of(world)
    snapshots = list(LAB.solve(params, world.state))
    tenth = LAB.accept(params, world.state, snapshots[9])
    again = LAB.accept(params, LAB.accept(params, tenth, snapshots[-1]), snapshots[9])
    np.testing.assert_array_equal(again.V, tenth.V)
    np.testing.assert_array_equal(again.errors, tenth.errors)
    assert len(tenth.errors) == 11


def test_every_state_has_a_curve() -> None:
    fields = field_names(begun({"chain": "machine", "source": "12"}))
    assert fields["means"].shape == (len(GAMMAS), 3)
