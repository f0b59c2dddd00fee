"""The lab ddp: what its article claims, in numbers, and what its two clocks must obey."""

from collections.abc import Mapping

import numpy as np
import pytest

from labs.engine.catalog import find
from labs.engine.events import Event
from labs.engine.headless import run
from labs.engine.run import World
from labs.models.mechanisms import mechanism
from labs.optimal_control.ddp.lab import REST, Ddp, DdpParams, DdpState
from labs.params import Value
from labs.scene import NullScene
from labs.tasks.motion.runs import FEEDBACK, OPEN_LOOP
from tests.labs.experiments import Experiments

EXPERIMENTS = Experiments("labs.optimal_control", "ddp")
verify = EXPERIMENTS.verify
Setting = Mapping[str, Value]
UR5: Setting = {"system": "ur5", "horizon": 1.0, "goal": 3000.0}


def solved(setting: Setting) -> World:
    world = World(find("ddp"), setting)
    solve(world)
    return world


def solve(world: World) -> int:
    """To the end; how many iterations it took."""
    while world.solving:
        world.iterate()
    assert world.latest is not None
    return world.latest.iteration


def state(world: World) -> DdpState:
    assert isinstance(world.state, DdpState)
    return world.state


def done(world: World) -> str:
    assert world.latest is not None
    return world.latest.done


def readouts(setting: Setting, seconds: float, *events: Event) -> Mapping[str, float]:
    """What the page shows when the motion has been played once."""
    world = run("ddp", setting, seconds=seconds, events=events)
    channels = world.lab.measure(world.params, world.state)
    return {name: float(value) for name, value in channels.items() if np.ndim(value) == 0}


# The article ----------------------------------------------------------------------------------


@verify("Watch it think")
def test_two_iterations_do_most(setting: Setting) -> None:
    history = state(solved(setting)).history
    assert history.cost[0] == pytest.approx(2963, abs=1)
    assert history.cost[1] == pytest.approx(45, abs=1)
    assert history.cost[2] == pytest.approx(2.4, abs=0.1)
    assert history.cost[-1] == pytest.approx(0.843, abs=5e-4)
    assert len(history.alpha) == 25
    np.testing.assert_array_equal(history.alpha[:-1], 1.0)
    ratio = history.actual[:-1] / history.expected[:-1]
    np.testing.assert_allclose(ratio[-3:], 1.4, atol=0.01)
    exact = state(solved({**setting, "method": "ddp"})).history
    assert exact.actual[-2] / exact.expected[-2] == pytest.approx(1.0, abs=0.01)


@verify("Second derivatives")
def test_ddp_takes_fewer_iterations_to_the_same_motion(setting: Setting) -> None:
    ddp, ilqr = solved(setting), solved({**setting, "method": "ilqr"})
    costs = [state(world).history.cost for world in (ddp, ilqr)]
    assert costs[0][-1] == pytest.approx(costs[1][-1], rel=1e-6)
    assert [len(cost) - 1 for cost in costs] == [36, 124]
    gradients = [state(world).history.gradient for world in (ddp, ilqr)]
    assert gradients[0][-1] < 1e-2 * gradients[0][-2], "quadratically"
    assert gradients[1][-1] > 0.2 * gradients[1][-2], "by a constant factor"
    v = state(ddp).plan.X[:, 1]
    signs = np.sign(v[np.abs(v) > 0.1])
    assert (np.diff(signs) != 0).sum() == 1, "it swings back once"


@verify("Too much caution")
def test_a_large_mu_is_slow(setting: Setting) -> None:
    history = state(solved(setting)).history
    assert len(history.alpha) == 181
    np.testing.assert_array_equal(history.alpha[:100], 1.0)
    assert (history.actual[:100] / history.expected[:100] > 0.25).all(), "all of them good"
    assert (np.diff(history.mu[:100]) < 0.0).all()
    assert len(state(solved({**setting, "mu_factor": 10.0})).history.alpha) < 40


@verify("Cheap control")
def test_cheap_control_is_violent(setting: Setting) -> None:
    plan = state(solved(setting)).plan
    size = np.abs(plan.U[:, 0]) / 4.905
    assert size[0] == size.max() > 7.0
    assert len(state(solved(setting)).history.alpha) == 5
    assert size[5] < 0.1 * size[0], "a tenth of a second later"


@verify("A weak motor")
def test_a_weak_motor_swings(setting: Setting) -> None:
    world = solved(setting)
    plan = state(world).plan
    at_limit = np.abs(plan.U[:, 0]) > 0.3 * 4.905 - 1e-9
    assert np.abs(plan.U).max() <= 0.3 * 4.905
    assert at_limit.mean() == pytest.approx(0.7, abs=0.02)
    assert not plan.K[at_limit].any()
    v = plan.X[:, 1]
    assert (np.diff(np.sign(v[np.abs(v) > 0.1])) != 0).sum() == 2, "reversing twice"
    assert plan.X[-1, 0] == pytest.approx(np.pi, abs=1e-3)
    assert np.degrees(np.arcsin(0.3)) == pytest.approx(17, abs=0.5)
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    assert "robot" in scene.names


@verify("Another guess, another minimum")
def test_the_ur5_stays_wound_up(setting: Setting) -> None:
    wound, still = solved(setting), solved({**setting, "guess": 0.0})
    assert state(wound).history.cost[-1] == pytest.approx(0.78, abs=0.005)
    assert state(still).history.cost[-1] == pytest.approx(0.037, abs=5e-4)
    for world in (wound, still):
        assert done(world).startswith("Converged")
        assert state(world).history.gradient[-1] < 1e-3
    ends = [state(world).plan.X[-1, :6] for world in (wound, still)]
    assert np.abs(ends[0] - ends[1]).max() > 1.0, "[rad] it is another posture"


@verify("Warm start")
def test_a_warm_start_is_shorter(setting: Setting) -> None:
    world = solved(setting)
    assert world.latest is not None
    assert world.latest.iteration == 45
    J = state(world).history.cost[-1]
    for changes in ({"start": "warm"}, {"control": 1.0}, {"control": 2.0}):
        world.change(changes)
        count = solve(world)
    assert count == 11
    assert state(world).history.cost[-1] == pytest.approx(J, rel=1e-6)


@verify("Right model, wrong plan")
def test_the_ghost_falls_in_the_end(setting: Setting) -> None:
    shown = readouts(setting, 3.5)
    assert shown["cost"] == pytest.approx(0.843, abs=1e-3)
    assert shown["paid"] == pytest.approx(0.843, abs=1e-3)
    assert shown["paid_open"] > 100.0
    assert shown["missed_open"] > 0.3
    up = readouts({**setting, "horizon": 2.0}, 2.5)
    assert up["missed_open"] < 0.01, "it comes up"
    growth = np.linalg.eigvals(
        mechanism("pendulum").derivatives(np.array([[np.pi, 0.0]]), np.zeros((1, 1)))[1][0]
    ).real.max()
    assert np.exp(growth) == pytest.approx(227, abs=1)


@verify("An unknown payload")
def test_feedback_carries_the_payload(setting: Setting) -> None:
    shown = readouts(setting, 2.5)
    assert shown["paid"] == pytest.approx(0.947, abs=1e-3)
    assert shown["missed"] < 1e-3
    assert shown["missed_open"] > 0.5
    heavy = readouts({**setting, "payload": 0.5}, 2.5)
    assert heavy["paid"] == pytest.approx(1.5, abs=0.01)
    assert heavy["missed"] < 1e-2


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()


# The solver's clock ---------------------------------------------------------------------------


def test_looking_back_plays_that_iteration() -> None:
    world = solved({})
    last = state(world).plan
    world.show(2)
    early = state(world)
    assert len(early.history.alpha) == 2
    assert len(early.history.cost) == 3
    assert np.abs(early.plan.X - last.X).max() > 0.1
    np.testing.assert_array_equal(early.runs.X[FEEDBACK], early.plan.X)
    problem = world.params.problem(early.plan.N, early.plan.h)  # type: ignore[attr-defined]
    assert problem.cost.value(early.plan.X, early.plan.U) == early.history.cost[-1]


def test_the_paths_of_earlier_iterations_fade_behind_the_last() -> None:
    world = solved({})
    history = state(world).history
    tip = mechanism("pendulum").tip(state(world).plan.X[-1, :1])
    np.testing.assert_allclose(history.tips[-1, -1], tip)
    np.testing.assert_allclose(history.phases[-1, -1], state(world).plan.X[-1])
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    assert [name for name in scene.names if name.startswith("before")]


def test_a_diverging_guess_keeps_the_plan_and_says_so() -> None:
    wild: Setting = {"system": "ur5", "integrator": "explicit-euler", "h": 0.04, "horizon": 3.0}
    world = solved({**wild, "start": "cold"})
    good = state(world).plan
    world.change({"guess": 1.0})
    assert solve(world) == 1
    assert done(world).startswith("The first guess diverges at step ")
    assert state(world).failed
    assert state(world).plan is good
    world.advance()
    assert not world.trouble
    world.change({"guess": 0.0})
    solve(world)
    assert not state(world).failed


def test_a_diverging_first_guess_leaves_the_robot_at_rest() -> None:
    world = solved({**UR5, "integrator": "explicit-euler", "h": 0.04, "horizon": 3.0, "guess": 1.0})
    assert state(world).failed
    plan = state(world).plan
    problem = world.params.problem(plan.N, plan.h)  # type: ignore[attr-defined]
    assert state(world).history.cost == [problem.cost.value(plan.X, plan.U)]
    for _ in range(20):
        world.advance()
    np.testing.assert_allclose(state(world).runs.x[OPEN_LOOP], state(world).plan.X[0], atol=1e-6)


def test_a_solve_that_stops_short_goes_on_warm() -> None:
    world = solved({"iterations": 5.0})
    assert done(world).startswith("Stopped short after 5 iterations")
    assert state(world).failed
    J = state(world).history.cost[-1]
    world.change({"iterations": 100.0})
    assert solve(world) < 25
    assert state(world).history.cost[0] == pytest.approx(J, rel=1e-12)
    assert done(world).startswith("Converged")


def test_a_warm_start_keeps_to_a_new_limit() -> None:
    world = solved({})
    world.change({"limited": True})
    solve(world)
    assert done(world).startswith("Converged")
    assert np.abs(state(world).plan.U).max() == pytest.approx(0.5 * 4.905)


@pytest.mark.parametrize("changes", [{"horizon": 2.5}, {"h": 0.01}])
def test_a_warm_start_fits_another_horizon_and_step(changes: Setting) -> None:
    world = solved({})
    guessed = state(world).history.cost[0]
    world.change(changes)
    solve(world)
    assert done(world).startswith("Converged")
    assert state(world).history.cost[0] < 0.5 * guessed, "not from nothing"
    assert len(state(world).plan.U) == round(world.params.horizon / world.params.h)  # type: ignore[attr-defined]


def test_the_target_follows_the_hand_within_its_range() -> None:
    world = solved(UR5)
    world.hold("target", (0.30004, -0.4, 0.5))
    solve(world)
    assert [world.params.target_x, world.params.target_y] == [0.3, -0.4]  # type: ignore[attr-defined]
    tip = mechanism("ur5").tip(state(world).plan.X[-1, :6])
    np.testing.assert_allclose(tip, [0.3, -0.4, 0.5], atol=1e-3)
    world.hold("target", (99.0, 0.0, -99.0))
    assert (world.params.target_x, world.params.target_z) == (0.8, 0.05)  # type: ignore[attr-defined]
    assert Ddp().edit(DdpParams(), "other", (0.0, 0.0, 0.0)) == {}


@pytest.mark.parametrize("system", ["double-pendulum", "acrobot", "pendubot", "cart-pole"])
def test_every_swing_up_arrives(system: str) -> None:
    shown = readouts({"system": system, "horizon": 2.5}, 3.0)
    assert shown["missed"] < 0.02
    assert shown["paid"] == pytest.approx(shown["cost"], rel=1e-3)


# The world's clock ----------------------------------------------------------------------------


def test_the_motion_is_played_rests_and_starts_over() -> None:
    world = solved({})
    for _ in range(200):
        world.advance()
    assert state(world).runs.finished(state(world).plan)
    assert len(state(world).paid) == 2
    ends = state(world).runs.x
    for _ in range(REST):
        world.advance()
    np.testing.assert_array_equal(state(world).runs.x, ends)
    world.advance()
    assert state(world).runs.clock == 0
    assert len(state(world).paid) == 2, "what was paid stays in view"
    world.advance()
    assert state(world).runs.clock == 2


def test_a_push_strikes_both_and_feedback_recovers() -> None:
    push = Event(100, "press", "push")
    calm, pushed = readouts({}, 2.5), readouts({}, 2.5, push)
    assert pushed["missed"] < 1e-3
    assert pushed["paid"] == pytest.approx(0.876, abs=1e-3)
    assert calm["paid"] == pytest.approx(0.843, abs=1e-3)
    assert pushed["missed_open"] > 0.1 > calm["missed_open"]


def test_noise_of_the_motors_is_the_same_for_both() -> None:
    """Without gains they would move alike; the sensors' noise reaches the feedback alone."""
    world = solved({"noise_torque": 0.3, "control": 100.0, "posture": 0.0})
    world.iterate()
    still = World(find("ddp"), {"noise_torque": 0.3, "guess": 0.1})
    for _ in range(30):
        still.advance()  # before the first iteration there are no gains
    np.testing.assert_array_equal(state(still).runs.x[0], state(still).runs.x[1])
    assert np.abs(state(still).runs.x[0] - state(still).plan.X[15]).max() > 1e-3
    seeing = solved({"noise": 0.02})
    for _ in range(30):
        seeing.advance()
    x = state(seeing).runs.x
    assert np.abs(x[OPEN_LOOP] - state(seeing).plan.X[15]).max() < 1e-4
    assert np.abs(x[FEEDBACK] - x[OPEN_LOOP]).max() > 1e-3


def test_weights_of_what_is_paid_are_the_present_ones() -> None:
    world = solved({})
    world.change({"control": 4.0})  # and before the solver has found anything
    for _ in range(200):
        world.advance()
    cost = world.params.problem(100, 0.02).cost  # type: ignore[attr-defined]
    plan = state(world).plan
    assert state(world).paid[FEEDBACK] == pytest.approx(cost.value(plan.X, plan.U), rel=1e-3)


def test_durations_are_shown_for_every_iteration() -> None:
    world = solved({})
    found = world.lab.fields(world.params, world.state)
    for phase in ("derivatives", "backward", "forward"):
        assert found[phase].shape == found["timed"].shape == (25,)
        assert (found[phase][:-1] > 0.0).all()
    assert found["forward"][-1] == 0.0, "what has converged is not rolled out again"
