"""What the article of the lab mpc-feasibility claims, in numbers."""

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.optimal_control.mpc_feasibility.lab import MpcFeasibility, MpcFeasibilityState
from labs.optimal_control.mpc_feasibility.params import MpcFeasibilityParams
from labs.optimal_control.mpc_feasibility.problem import feasibility
from labs.optimal_control.mpc_feasibility.sets import compute_sets
from labs.params import Value
from tests.labs.experiments import ArticleExperiments
from tests.labs.solving import readouts, solve

Settings = Mapping[str, Value]
EXPERIMENTS = ArticleExperiments("labs.optimal_control", "mpc_feasibility")
verify = EXPERIMENTS.verify


def begun(setting: Settings) -> World:
    return World(find_lab("mpc-feasibility"), setting)


def run(setting: Settings, seconds: float) -> World:
    world = begun(setting)
    while world.t < seconds:
        world.advance()
    return world


def state(world: World) -> MpcFeasibilityState:
    assert isinstance(world.state, MpcFeasibilityState)
    return world.state


def hold_time(title: str) -> float:
    return float(EXPERIMENTS.blocks[title]["hold"])


@cache
def shown_at_start(*changes: tuple[str, Value]) -> Mapping[str, float]:
    return readouts(begun(dict(changes)))


def sizes(setting: Settings, **changes: Value) -> Mapping[str, float]:
    """The tiles of the sets."""
    return shown_at_start(*{**setting, **changes}.items())


@verify("Only the control is limited")
def test_input_limits_alone_are_always_met(setting: Settings) -> None:
    world = run(setting, hold_time("Only the control is limited"))
    assert readouts(world)["failures"] == 0.0
    farthest = state(world).path[:, 0].max()
    assert farthest - 0.8 == pytest.approx(0.41, abs=0.005)
    assert farthest > 1.0, "beyond where the walls were"
    assert sizes(setting, horizon=1.0)["share"] == 100.0


@verify("A dead end")
def test_it_runs_out_of_plans_and_into_the_wall(setting: Settings) -> None:
    world = run(setting, hold_time("A dead end"))
    found = readouts(world)
    assert found["failed"] == 28.0
    assert found["impact"] == pytest.approx(0.55, abs=0.005)
    assert "x₁ ≤ 1 is exceeded at step 4" in state(world).failure_reason
    channels = world.recording().channels
    t, feasible, stay = (channels[name] for name in ("t", "depth_feasible", "depth_invariant"))
    out = [t[np.flatnonzero(depth < 0.0)[0]] for depth in (stay, feasible)]
    assert out[1] - out[0] == pytest.approx(0.7, abs=0.01)
    assert out[1] == pytest.approx(2.8, abs=0.1), "a plan exists exactly in X_0"
    assert EXPERIMENTS.answer("A dead end") == "No, it runs out of plans."


@verify("Soft walls")
def test_a_soft_limit_makes_the_crash_milder(setting: Settings) -> None:
    seconds = hold_time("Soft walls")
    soft = readouts(run(setting, seconds))["impact"]
    hard = readouts(run({**setting, "fallback": "tail"}, seconds))["impact"]
    braked = readouts(run({**setting, "fallback": "brake"}, seconds))["impact"]
    assert soft == pytest.approx(0.43, abs=0.005)
    assert braked == pytest.approx(soft, abs=0.005)
    assert hard == pytest.approx(0.55, abs=0.005)
    assert EXPERIMENTS.answer("Soft walls") == "It is milder."


@verify("The largest safe set")
def test_an_invariant_terminal_set_always_leaves_a_plan(setting: Settings) -> None:
    world = run(setting, hold_time("The largest safe set"))
    found = readouts(world)
    assert found["failures"] == 0.0
    assert found["share"] == pytest.approx(100.0, abs=1e-3)
    assert found["leak"] == pytest.approx(0.0, abs=1e-6)
    channels = world.recording().channels
    assert channels["depth_invariant"].min() > -1e-3, "between the periods a hair outside"
    assert channels["depth_invariant"].min() < 0.02, "along the edge"
    assert channels["control"].min() == pytest.approx(-0.5, abs=1e-6)


@verify("Long enough")
def test_a_long_horizon_has_no_dead_ends(setting: Settings) -> None:
    assert sizes(setting, horizon=5.0)["dead"] == pytest.approx(9.3, abs=0.05)
    assert sizes(setting, horizon=10.0)["dead"] == pytest.approx(3.2, abs=0.05)
    least = next(N for N in range(18, 40) if sizes(setting, horizon=float(N))["dead"] < 1e-6)
    assert least == EXPERIMENTS.answer("Long enough") == setting["horizon"]
    survives = {N: run({**setting, "horizon": N}, 6.0) for N in (10.0, 11.0)}
    assert "impact" in readouts(survives[10.0])
    assert readouts(survives[11.0])["failures"] == 0.0


@verify("Step by step")
def test_the_admissible_set_is_found_step_by_step(setting: Settings) -> None:
    world = begun(setting)
    solve(world)
    assert readouts(world)["t_star"] == 8.0
    growth = state(world).growth
    assert growth.J.shape == (9, 6)
    assert (growth.J[-1] <= 1e-9).all()
    assert (growth.J[:-1].max(axis=1) > 0.0).all()
    first = growth.J[0] > 1e-9
    assert first.tolist() == [False, True, False, False, False, True]
    fields = world.lab.fields(world.params, world.state)
    areas = fields["admissible_area"]
    assert areas[-1] == pytest.approx(0.076, abs=5e-4)
    assert (np.diff(areas) < 0.0).all()
    gentle = begun({**setting, "r": 1.0})
    solve(gentle)
    assert world.lab.fields(gentle.params, gentle.state)["admissible_area"][-1] > 2.0 * areas[-1]


@verify("The price of safety")
def test_a_small_terminal_set_shrinks_what_is_feasible(setting: Settings) -> None:
    world = run(setting, hold_time("The price of safety"))
    assert readouts(world)["failed"] == 0.0
    assert readouts(world)["share"] == pytest.approx(23.5, abs=0.05)
    assert readouts(run({**setting, "horizon": 20.0}, 8.0))["failures"] == 0.0
    assert sizes(setting, horizon=40.0)["share"] == pytest.approx(99.7, abs=0.05)
    assert sizes(setting, terminal="origin")["share"] == pytest.approx(0.6, abs=0.05)


@verify("Too weak to hold")
def test_zero_velocity_is_safe_only_for_a_joint_that_holds_itself(setting: Settings) -> None:
    world = run(setting, hold_time("Too weak to hold"))
    found = readouts(world)
    assert found["failed"] == 2.0
    assert found["leak"] > 5.0
    fields = world.lab.fields(world.params, world.state)
    too_far = fields["held"][fields["holding"] > fields["holding_limits"][:, 0]]
    assert too_far.min() == pytest.approx(0.88, abs=0.03)
    at = feasibility(MpcFeasibilityParams.model_validate(setting).setup)
    level = 4.905
    needed = np.interp(at.goal[0] + 0.6, fields["held"], fields["holding"])
    assert needed / level == pytest.approx(0.96, abs=0.005)
    assert fields["holding"].max() / level == pytest.approx(1.06, abs=0.005)
    strong: Settings = {**setting, "u_max": 1.06}
    assert sizes(strong)["leak"] == 0.0
    assert sizes(setting, u_max=1.05)["leak"] > 0.0
    assert readouts(run(strong, 8.0))["failures"] == 0.0
    assert EXPERIMENTS.answer("Too weak to hold") == "No, it cannot stay stopped."


@verify("Nothing but unstable")
def test_a_pendulum_that_cannot_be_kept_has_plans_at_first(setting: Settings) -> None:
    world = begun(setting)
    x = state(world).z
    assert x == pytest.approx([0.1, 1.8])
    assert readouts(world)["depth_feasible"] > 0.0 > readouts(world)["depth_invariant"]
    found = readouts(run(setting, hold_time("Nothing but unstable")))
    assert found["failed"] == 3.0
    assert "impact" in found
    told = run({**setting, "terminal": "admissible"}, 0.1)
    assert readouts(told)["failed"] == 0.0
    dead = [sizes(setting, horizon=N)["dead"] for N in (3.0, 6.0, 12.0, 24.0)]
    assert (np.diff(dead) < 0.0).all()
    assert dead[2] > 1e-4


def test_blocks_leave_fewer_controls_and_plans() -> None:
    """And break the promise of a control invariant terminal set."""
    blocks = MpcFeasibility.presets["Joint in blocks"]
    free, two, four = (sizes(blocks, block=block) for block in "124")
    assert [found["decided"] for found in (free, two, four)] == [8, 4, 2]
    assert free["share"] == pytest.approx(100.0, abs=0.01)
    assert free["leak"] == pytest.approx(0.0, abs=1e-6)
    assert four["share"] == pytest.approx(91.0, abs=0.5)
    assert min(two["leak"], four["leak"]) > 2.0
    world, whole = run(blocks, 1.0), run({**blocks, "block": "1"}, 1.0)
    assert state(world).first_failed_period == 1
    assert state(whole).failures == 0
    notes = find_lab("mpc-feasibility").lab.notes
    assert "The terminal set is control invariant" in notes(world.params, world.state)["planner"]


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()


def test_red_is_what_no_run_should_enter() -> None:
    """From random states of the plane: outside the red, with an invariant terminal set or none, a
    run without a plan never happens unless it began or came there."""
    rng = np.random.default_rng(2)
    for terminal in ("invariant", "admissible"):
        params = MpcFeasibilityParams(u_max=0.5, terminal=terminal, horizon=6.0)
        sets = compute_sets(params.setup)
        assert sets.rows is not None
        assert not sets.infeasible_regions
        for x1, x2 in rng.uniform(-1.0, 1.0, (12, 2)).round(2):
            start = {"x1": float(x1), "x2": float(x2)}
            other = run({"u_max": 0.5, "terminal": terminal, "horizon": 6.0, **start}, 3.0)
            inside = bool(sets.rows[0].contains(np.array([x1, x2]), -1e-6))
            assert (readouts(other)["failures"] == 0.0) == inside, start
