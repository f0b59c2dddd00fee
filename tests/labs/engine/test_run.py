"""Worlds, their events, and running them again (labs/engine/run.py)."""

import contextlib
import json
import math
import shlex
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labs.engine import run as run_module
from labs.engine.catalog import find_lab
from labs.engine.events import Event, events_from_recording, parse_event
from labs.engine.headless import MAX_STEPS, run_headless
from labs.engine.run import World
from labs.errors import LabError, ParameterError, UnknownLab
from server.cli import _arguments_of_options, _parser
from tests.labs.solving import solve


def make_world(**changes: object) -> World:
    return World(find_lab("oscillator"), changes)


def advanced_world(world: World, steps: int) -> World:
    for _ in range(steps):
        world.advance()
    return world


def solved(world: World) -> World:
    solve(world)
    return world


def same_recording(a: World, b: World) -> bool:
    return a.recording().rows.tobytes() == b.recording().rows.tobytes() and a.params == b.params


def run_command(line: str) -> World:
    """What the shell and the command make of a line."""
    words = shlex.split(line)
    assert words[:2] == ["orclab", "run"]
    options = _parser().parse_args(words[1:])
    return run_headless(**_arguments_of_options(options), seconds=options.seconds)


# The world's clock ----------------------------------------------------------------------------


def test_time_is_counted_in_steps_and_does_not_drift() -> None:
    world = advanced_world(make_world(), 12_345)
    assert world.t == 12_345 * 0.01


def test_the_first_row_is_the_state_at_zero() -> None:
    rows = advanced_world(make_world(start=0.5), 3).recording().channels
    assert rows["t"].tolist() == [0.0, 0.01, 0.02, 0.03]
    assert rows["x"][0] == 0.5


def test_a_live_change_is_seen_from_the_next_step_on_and_keeps_the_run() -> None:
    world = advanced_world(make_world(), 10)
    x = world.state.x
    world.change({"omega": 8.0})
    assert world.state.x == x
    assert world.t == 0.1
    world.advance()
    assert world.state.x == pytest.approx(math.cos(8.0 * 0.11), rel=1e-12)
    assert world.runs == 1


def test_a_restart_change_begins_anew_with_all_parameters_as_they_are() -> None:
    world = advanced_world(make_world(), 10)
    world.change({"omega": 8.0})
    world.press("kick")
    world.change({"start": 0.5})
    assert (world.t, world.runs) == (0.0, 2)
    assert world.state.x == 0.5
    about = world.recording().about
    assert about["params"]["omega"] == 8.0
    assert about["params"]["start"] == 0.5
    assert [c["kind"] for c in about["changes"]] == ["solve"]
    assert advanced_world(world, 1).state.kicks == 0, "a press does not outlive the run"


def test_a_change_to_the_same_value_changes_nothing() -> None:
    world = advanced_world(make_world(), 10)
    events = list(world.events)
    world.change({"start": 1.0, "omega": 2.0})
    assert (world.runs, world.steps, world.events) == (1, 10, events)


def test_a_refused_change_leaves_the_world_as_it_was() -> None:
    world = advanced_world(make_world(), 10)
    events = list(world.events)
    with pytest.raises(ParameterError):
        world.change({"omega": 8.0, "start": 5.0})
    assert world.params.model_dump() == make_world().params.model_dump()
    assert (world.runs, world.steps, world.events) == (1, 10, events)


def test_a_press_acts_in_one_step_only() -> None:
    world = make_world()
    world.press("kick")
    world.press("kick")
    assert [advanced_world(world, 1).state.kicks for _ in range(3)] == [2, 2, 2]


def test_an_unknown_action_is_refused() -> None:
    with pytest.raises(ParameterError, match="no action is named 'jump'; there are kick"):
        make_world().press("jump")
    with pytest.raises(ParameterError, match="there are none"):
        World(find_lab("troublesome")).press("jump")


def test_a_handle_pulls_until_it_is_released() -> None:
    world = make_world()
    world.hold("pull", (0.5, 0.0, 0.0))
    pulled = [advanced_world(world, 1).state.pulled for _ in range(3)]
    world.hold("pull", None)
    assert [*pulled, advanced_world(world, 1).state.pulled] == [0.5, 0.5, 0.5, 0.0]


def test_a_handle_that_is_not_declared_is_refused() -> None:
    """A drag that names none would be lost without a word."""
    world = make_world()
    for point in ((0.4, 0.2, 0.7), None):
        with pytest.raises(ParameterError, match="no handle is named 'plul'; there are pull"):
            world.hold("plul", point)
    with pytest.raises(ParameterError, match="there are none"):
        World(find_lab("troublesome")).hold("pull", (0.0, 0.0, 0.0))
    with pytest.raises(ParameterError, match=r"token, tile 1 to tile 12, bead 1 to bead 12$"):
        World(find_lab("markov")).hold("bead 13", (0.0, 0.0, 0.0))
    assert [e for e in world.events if e.kind == "hold"] == []


def test_what_is_not_held_can_be_released() -> None:
    world = make_world()
    world.hold("pull", None)
    assert [e for e in world.events if e.kind == "hold"] == []


@pytest.mark.parametrize("point", [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (0.0, 0.0)])
def test_a_handle_goes_to_finite_points_only(point: Any) -> None:
    world = make_world()
    with pytest.raises(ParameterError, match="pull was dragged to"):
        world.hold("pull", point)
    assert advanced_world(world, 1).state.pulled == 0.0
    assert [e for e in world.events if e.kind == "hold"] == []


def test_trouble_stops_the_clock_until_a_reset() -> None:
    world = World(find_lab("troublesome"), {"fault": "trouble"})
    advanced_world(world, 5)
    assert world.steps == 1
    assert world.trouble.startswith("It diverged")
    assert world.recording().about["trouble"] == world.trouble
    world.change({"fault": "none"})
    world.reset()
    assert advanced_world(world, 5).steps == 5


# The solver's clock ---------------------------------------------------------------------------


def test_a_solver_runs_to_the_end_before_time_starts() -> None:
    world = run_headless("oscillator", {"guess": 2.0}, seconds=0.1)
    assert world.recording().channels["root"][1] == pytest.approx(math.sqrt(2.0), rel=1e-12)
    assert not world.solving
    assert world.latest is not None
    assert world.latest.done == "converged"


def test_a_solve_change_starts_the_solver_again() -> None:
    world = solved(make_world(guess=9.0))
    advanced_world(world, 10)
    world.change({"guess": 16.0})
    assert world.solving
    assert world.t == 0.1
    assert solved(world).state.root == pytest.approx(4.0, rel=1e-12)


def test_a_headless_run_solves_again_after_a_change() -> None:
    world = run_headless("oscillator", seconds=1.0, events=[Event(50, "set", "guess", 16.0)])
    root = world.recording().channels["root"]
    assert root[50] == pytest.approx(3.0, rel=1e-12)
    assert root[51] == pytest.approx(4.0, rel=1e-12)


def test_iterations_between_steps_are_events_that_reproduce_the_run() -> None:
    """As a live session does: a solver that is still at work while time runs."""
    world = make_world(guess=50.0)
    world.iterate()
    world.iterate()
    advanced_world(world, 3)
    world.iterate()
    advanced_world(world, 3)
    again = run_headless("oscillator", {"guess": 50.0}, seconds=world.t, events=world.events)
    assert [(e.step, e.value) for e in world.events] == [(0, 2), (3, 1)]
    assert same_recording(again, world)
    assert again.solving


def test_a_run_whose_solver_never_started_is_reproduced_too() -> None:
    world = advanced_world(make_world(guess=50.0), 5)
    again = run_headless("oscillator", {"guess": 50.0}, seconds=world.t, events=world.events)
    assert world.state.root == again.state.root == 0.0
    assert same_recording(run_command(world.command()), world)


def test_looking_back_shows_what_was_and_the_next_iteration_goes_on_from_the_latest() -> None:
    world = make_world(guess=50.0)
    roots = []
    for _ in range(4):
        world.iterate()
        roots.append(world.state.root)
    world.show(2)
    assert world.state.root == roots[1]
    assert world.shown is not world.latest
    advanced_world(world, 3)
    assert world.state.root == roots[1], "time passes, what is shown stays"
    world.iterate()
    assert world.latest is world.shown
    assert world.latest is not None
    assert world.latest.iteration == 5
    straight = make_world(guess=50.0)
    for _ in range(5):
        straight.iterate()
    assert world.state.root == straight.state.root
    assert [(e.step, e.name, e.value) for e in world.events] == [
        (0, "iterate", 4),
        (0, "show", 2),
        (3, "iterate", 1),
    ]


def test_of_looking_around_within_one_step_only_the_last_is_kept() -> None:
    world = solved(make_world())
    for k in (5, 3, 1, 2):
        world.show(k)
    assert [(e.name, e.value) for e in world.events[1:]] == [("show", 2)]


def test_a_solver_started_anew_forgets_what_it_found() -> None:
    world = solved(make_world())
    solves = world.solves
    world.change({"guess": 16.0})
    assert world.solves == solves + 1
    assert (len(world.snapshots), world.shown, world.latest) == (0, None, None)
    assert world.state.root == pytest.approx(3.0), "until there is something better"
    world.iterate()
    assert world.snapshots.iterations == [1]


def test_a_headless_run_looks_back_at_what_it_solved_to_the_end() -> None:
    world = run_headless("oscillator", seconds=1.0, events=[Event(50, "solve", "show", 2)])
    root = world.recording().channels["root"]
    assert root[50] == pytest.approx(3.0, rel=1e-12)
    assert root[51] == 3.4
    assert (
        run_headless("oscillator", seconds=0.0, events=[Event(0, "solve", "show", 1)]).state.root
        == 5.0
    )


# Events ---------------------------------------------------------------------------------------


def test_of_a_drag_within_one_step_only_the_last_place_is_kept() -> None:
    world = advanced_world(make_world(), 4)
    for k in range(10):
        world.change({"omega": 3.0 + 0.1 * k})
    for k in range(10):
        world.hold("pull", (0.1 * k, 0.0, 0.0))
    assert world.events[1:] == [
        Event(4, "set", "omega", 3.0 + 0.1 * 9),
        Event(4, "hold", "pull", (0.1 * 9, 0.0, 0.0)),
    ]


def test_every_press_is_kept() -> None:
    world = make_world()
    world.press("kick")
    world.press("kick")
    assert [e.kind for e in world.events].count("press") == 2


def test_events_are_bounded_and_a_run_that_lost_some_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(run_module, "MAX_EVENTS", 5)
    world = make_world()
    for _ in range(4):
        world.press("kick")
        world.advance()
    assert world.complete
    world.press("kick")
    assert len(world.events) == 5
    assert not world.complete
    about = world.recording().about
    assert about["changes_complete"] is False
    with pytest.raises(LabError, match="cannot be run again exactly"):
        events_from_recording(about)
    with pytest.raises(LabError, match="export the run as JSON"):
        world.command()
    world.reset()
    assert world.complete


# Running again --------------------------------------------------------------------------------


def _pushed(world: World) -> None:
    solved(world)
    advanced_world(world, 7)
    world.change({"omega": 0.1 + 0.2, "noisy": True})
    advanced_world(world, 3)
    world.press("kick")
    world.hold("pull", (0.1 + 0.2, -1e-7, 1.0))
    advanced_world(world, 6)
    world.change({"shape": "square", "guess": 16.0})
    world.iterate()
    advanced_world(world, 1)
    world.iterate()
    world.hold("pull", None)
    world.press("kick")
    world.press("kick")
    advanced_world(world, 5)
    world.show(1)
    advanced_world(world, 2)


def _untouched(world: World) -> None:
    solved(world)
    advanced_world(world, 20)


def _changed_at_the_end(world: World) -> None:
    solved(world)
    advanced_world(world, 3)
    world.change({"omega": 5.0})


def _restarted(world: World) -> None:
    solved(world)
    advanced_world(world, 30)
    world.change({"start": -0.5})
    solved(world)
    advanced_world(world, 10)
    world.change({"omega": 7.0})
    advanced_world(world, 10)


SCENARIOS = [_pushed, _untouched, _changed_at_the_end, _restarted]


@pytest.mark.parametrize("story", SCENARIOS)
def test_the_command_line_reproduces_the_run(story: Callable[[World], None]) -> None:
    world = World(find_lab("oscillator"), {"start": -0.3, "gain": 1 / 3}, seed=7)
    story(world)
    again = run_command(world.command())
    assert same_recording(again, world)
    assert again.command() == world.command()


@pytest.mark.parametrize("story", SCENARIOS)
def test_an_exported_run_runs_again_bit_for_bit(story: Callable[[World], None]) -> None:
    world = World(find_lab("oscillator"), {"start": -0.3, "gain": 1 / 3}, seed=7)
    story(world)
    about = json.loads(world.recording().json())
    again = run_headless(
        about["lab"],
        about["params"],
        seed=about["seed"],
        seconds=about["covers"]["to"],
        events=events_from_recording(about),
    )
    assert again.recording().json() == world.recording().json()


OPERATIONS = st.lists(
    st.one_of(
        st.tuples(st.just("advance"), st.integers(1, 30)),
        st.tuples(st.just("iterate"), st.integers(1, 4)),
        st.tuples(st.just("show"), st.integers(0, 9)),
        st.tuples(st.just("omega"), st.floats(0.1, 10.0)),
        st.tuples(st.just("guess"), st.floats(1.0, 100.0)),
        st.tuples(st.just("start"), st.floats(-1.0, 1.0)),
        st.tuples(st.just("noisy"), st.booleans()),
        st.tuples(st.just("press"), st.just("kick")),
        st.tuples(st.just("hold"), st.none() | st.tuples(*[st.floats(-9.0, 9.0)] * 3)),
        st.tuples(st.just("reset"), st.none()),
    ),
    max_size=25,
)


@given(OPERATIONS, st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=60)
def test_whatever_is_done_can_be_done_again(deeds: list[tuple[str, Any]], seed: int) -> None:
    world = World(find_lab("oscillator"), seed=seed)
    for deed, value in deeds:
        match deed:
            case "advance":
                advanced_world(world, value)
            case "iterate":
                for _ in range(value):
                    world.iterate()
            case "show":
                with contextlib.suppress(ParameterError):  # before the first iteration
                    world.show(value)
            case "press":
                world.press(value)
            case "hold":
                world.hold("pull", value)
            case "reset":
                world.reset()
            case _:
                world.change({deed: value})
    again = run_command(world.command())
    assert same_recording(again, world)
    assert again.solving == world.solving
    assert again.state.root == world.state.root
    about = json.loads(world.recording().json())
    replayed = run_headless(
        "oscillator",
        about["params"],
        seed=seed,
        seconds=world.t,
        events=events_from_recording(about),
    )
    assert same_recording(replayed, world)
    assert replayed.solving == world.solving
    assert replayed.snapshots.iterations == world.snapshots.iterations


def test_there_and_back_within_a_step_starts_the_solver_again_in_the_replay_too() -> None:
    world = solved(make_world())
    world.change({"guess": 16.0})
    world.change({"guess": 9.0})
    assert world.solving
    world.iterate()
    again = run_command(world.command())
    assert again.solving
    assert again.state.root == world.state.root == 5.0


def test_the_arm_runs_again_bit_for_bit() -> None:
    world = World(find_lab("joint-control"), {"noise": 0.01, "integrator": "rk4"}, seed=9)
    advanced_world(world, 20)
    world.press("push")
    advanced_world(world, 5)
    world.hold("pull", (0.4, 0.2, 0.7))
    advanced_world(world, 20)
    world.hold("pull", None)
    world.change({"kp": 777.0, "torque_limits": False})
    advanced_world(world, 20)
    assert same_recording(run_command(world.command()), world)
    about = json.loads(world.recording().json())
    again = run_headless(
        about["lab"], about["params"], seed=9, seconds=world.t, events=events_from_recording(about)
    )
    assert same_recording(again, world)


def test_a_diverged_run_runs_again() -> None:
    world = World(find_lab("troublesome"))
    advanced_world(world, 5)
    world.change({"fault": "trouble"})
    advanced_world(world, 5)
    assert world.trouble
    again = run_command(world.command())
    assert (again.trouble, again.steps) == (world.trouble, world.steps)
    assert same_recording(again, world)


# Wrong use ------------------------------------------------------------------------------------


@pytest.mark.parametrize("seconds", [-0.01, math.nan, math.inf, MAX_STEPS * 0.01 + 1.0])
def test_a_duration_out_of_range_is_refused(seconds: float) -> None:
    with pytest.raises(ParameterError, match="takes a number from 0 to 20000"):
        run_headless("oscillator", seconds=seconds)


def test_an_unknown_lab_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(UnknownLab, match=r"no lab is named 'nope'; there are .*joint-control"):
        run_headless("nope")


def test_a_change_beyond_the_end_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"a change at 2 s lies beyond the run's 1 s"):
        run_headless("oscillator", seconds=1.0, events=[Event(200, "set", "omega", 3.0)])


def test_a_change_that_trouble_forestalled_is_no_error() -> None:
    late = [Event(50, "set", "fault", "none")]
    assert run_headless("troublesome", {"fault": "trouble"}, seconds=1.0, events=late).steps == 1


def test_a_restart_in_mid_run_is_refused_and_at_the_start_is_not() -> None:
    with pytest.raises(ParameterError, match="start restarts the run: give it with --set"):
        run_headless("oscillator", seconds=1.0, events=[Event(5, "set", "start", 0.5)])
    world = run_headless("oscillator", seconds=1.0, events=[Event(0, "set", "start", 0.5)])
    assert world.recording().channels["x"][0] == 0.5


def test_events_are_sorted_by_time() -> None:
    events = [Event(20, "set", "omega", 3.0), Event(10, "set", "omega", 4.0)]
    assert (
        run_headless("oscillator", seconds=1.0, events=events).params.model_dump()["omega"] == 3.0
    )


def test_progress_is_told_from_the_start_on_and_rises() -> None:
    told: list[float] = []
    run_headless("oscillator", seconds=5.0, progress=told.append)
    solving = len(told) - 5  # one after every iteration of the solver, before time starts
    assert told == pytest.approx([0.0] * solving + [0.002, 0.202, 0.402, 0.602, 0.802])


@pytest.mark.parametrize(
    ("at", "what", "event"),
    [
        ("2.5", "omega=5e0", Event(250, "set", "omega", 5.0)),
        ("0", "noisy=true", Event(0, "set", "noisy", True)),
        ("0.014", "shape=square", Event(1, "set", "shape", "square")),
        ("3", "press=kick", Event(300, "press", "kick")),
        ("4", "hold=pull:0.1,-2,3e-1", Event(400, "hold", "pull", (0.1, -2.0, 0.3))),
        ("5", "hold=pull:release", Event(500, "hold", "pull", None)),
        ("0", "iterate=12", Event(0, "solve", "iterate", 12)),
        ("0.5", "show=3", Event(50, "solve", "show", 3)),
    ],
)
def test_events_are_read_from_text(at: str, what: str, event: Event) -> None:
    assert parse_event(find_lab("oscillator"), at, what) == event


@pytest.mark.parametrize(
    ("at", "what", "sentence"),
    [
        ("soon", "omega=1", "takes a time in seconds"),
        ("nan", "omega=1", "takes a time in seconds"),
        ("inf", "omega=1", "takes a time in seconds"),
        ("-1", "omega=1", "takes a time from 0 and name=value"),
        ("1", "omega", "takes a time from 0 and name=value"),
        ("1", "hold=pull", "held at x,y,z or released"),
        ("1", "hold=pull:1,2", "held at x,y,z or released"),
        ("1", "hold=pull:a,b,c", "held at x,y,z or released"),
    ],
)
def test_text_that_is_no_event_is_refused(at: str, what: str, sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        parse_event(find_lab("oscillator"), at, what)


@pytest.mark.parametrize(
    "wrong",
    [
        {"step": -1},
        {"step": "0"},
        {"step": 0.5},
        {"kind": "jump"},
        {"kind": []},
        {"name": None},
        {"value": []},
        {"kind": "press", "value": 1},
        {"kind": "hold", "value": [1.0, 2.0]},
        {"kind": "hold", "value": "abc"},
        {"kind": "hold", "value": 5},
        {"kind": "solve", "name": "iterate", "value": -1},
        {"kind": "solve", "name": "show", "value": 1.5},
        {"kind": "solve", "name": "jump", "value": 1},
        {"kind": "solve", "name": "iterate", "value": 1e9},
    ],
)
def test_a_change_of_an_export_that_makes_no_sense_is_refused(wrong: dict[str, Any]) -> None:
    change = {"t": 0.0, "step": 0, "kind": "set", "name": "omega", "value": 3.0} | wrong
    with pytest.raises(LabError, match="no change of a run looks like"):
        events_from_recording({"changes_complete": True, "changes": [change]})


def test_a_recording_knows_all_that_reproduces_it() -> None:
    world = World(find_lab("oscillator"), {"omega": 3.0}, seed=4)
    advanced_world(world, 2)
    world.change({"omega": 4.0})
    about = world.recording().about
    assert about["lab"] == "oscillator"
    assert about["seed"] == 4
    assert about["params"]["omega"] == 3.0
    assert about["changes"][-1] == {
        "t": 0.02,
        "step": 2,
        "kind": "set",
        "name": "omega",
        "value": 4.0,
    }
    assert about["covers"] == {"from": 0.0, "to": 0.02, "rows": 3}


def test_a_seed_fixes_the_noise() -> None:
    one, again, other = (
        run_headless("oscillator", {"noisy": True}, seconds=1.0, seed=seed).recording().rows
        for seed in (1, 1, 2)
    )
    assert np.array_equal(one, again, equal_nan=True)
    assert not np.array_equal(one, other, equal_nan=True)
