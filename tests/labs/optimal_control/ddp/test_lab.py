"""What the two clocks of the lab ddp must obey."""

import numpy as np
import pytest

from labs.engine.catalog import find_lab
from labs.engine.events import Event
from labs.engine.run import World
from labs.models.mechanisms import mechanism
from labs.optimal_control.ddp.lab import Ddp
from labs.optimal_control.ddp.params import DdpParams
from labs.optimal_control.ddp.plots import PHASES
from labs.scene import NullScene
from labs.tasks.motion.playback import FEEDBACK, OPEN_LOOP
from labs.tasks.motion.player import REST_STEPS
from tests.labs.optimal_control.ddp.simulation import (
    UR5,
    Settings,
    readouts,
    solve,
    solved,
    state,
    stop_reason,
)

# The solver's clock ---------------------------------------------------------------------------


def test_looking_back_plays_that_iteration() -> None:
    world = solved({})
    last = state(world).plan
    world.show(2)
    early = state(world)
    assert len(early.history.alpha) == 2
    assert len(early.history.cost) == 3
    assert np.abs(early.plan.X - last.X).max() > 0.1
    np.testing.assert_array_equal(early.playback.X[FEEDBACK], early.plan.X)
    problem = world.params.problem(early.plan.N, early.plan.h)  # type: ignore[attr-defined]
    assert problem.cost.value(early.plan.X, early.plan.U) == early.history.cost[-1]


def test_the_paths_of_earlier_iterations_fade_behind_the_last() -> None:
    world = solved({})
    history = state(world).history
    tip = mechanism("pendulum").tip(state(world).plan.X[-1, :1])
    np.testing.assert_allclose(history.tip_paths[-1, -1], tip)
    np.testing.assert_allclose(history.phase_paths[-1, -1], state(world).plan.X[-1])
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    assert [name for name in scene.names if name.startswith("before")]


def test_a_diverging_guess_keeps_the_plan_and_says_so() -> None:
    wild: Settings = {"system": "ur5", "integrator": "explicit-euler", "h": 0.04, "horizon": 3.0}
    world = solved({**wild, "start": "cold"})
    good = state(world).plan
    world.change({"guess": 1.0})
    assert solve(world) == 1
    assert stop_reason(world).startswith("The first guess diverges at step ")
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
    np.testing.assert_allclose(
        state(world).playback.x[OPEN_LOOP], state(world).plan.X[0], atol=1e-6
    )


def test_a_solve_that_stops_short_goes_on_warm() -> None:
    world = solved({"iterations": 5.0})
    assert stop_reason(world).startswith("Stopped short after 5 iterations")
    assert state(world).failed
    J = state(world).history.cost[-1]
    world.change({"iterations": 100.0})
    assert solve(world) < 25
    assert state(world).history.cost[0] == pytest.approx(J, rel=1e-12)
    assert stop_reason(world).startswith("Converged")


def test_a_warm_start_keeps_to_a_new_limit() -> None:
    world = solved({})
    world.change({"limited": True})
    solve(world)
    assert stop_reason(world).startswith("Converged")
    assert np.abs(state(world).plan.U).max() == pytest.approx(0.5 * 4.905)


@pytest.mark.parametrize("changes", [{"horizon": 2.5}, {"h": 0.01}])
def test_a_warm_start_fits_another_horizon_and_step(changes: Settings) -> None:
    world = solved({})
    guessed = state(world).history.cost[0]
    world.change(changes)
    solve(world)
    assert stop_reason(world).startswith("Converged")
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
    assert state(world).playback.finished(state(world).plan)
    assert len(state(world).run_costs) == 2
    ends = state(world).playback.x
    for _ in range(REST_STEPS):
        world.advance()
    np.testing.assert_array_equal(state(world).playback.x, ends)
    world.advance()
    assert state(world).playback.clock == 0
    assert len(state(world).run_costs) == 2, "what was paid stays in view"
    world.advance()
    assert state(world).playback.clock == 2


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
    still = World(find_lab("ddp"), {"noise_torque": 0.3, "guess": 0.1})
    for _ in range(30):
        still.advance()  # before the first iteration there are no gains
    np.testing.assert_array_equal(state(still).playback.x[0], state(still).playback.x[1])
    assert np.abs(state(still).playback.x[0] - state(still).plan.X[15]).max() > 1e-3
    seeing = solved({"noise": 0.02})
    for _ in range(30):
        seeing.advance()
    x = state(seeing).playback.x
    assert np.abs(x[OPEN_LOOP] - state(seeing).plan.X[15]).max() < 1e-4
    assert np.abs(x[FEEDBACK] - x[OPEN_LOOP]).max() > 1e-3


def test_weights_of_what_is_paid_are_the_present_ones() -> None:
    world = solved({})
    world.change({"control": 4.0})  # and before the solver has found anything
    for _ in range(200):
        world.advance()
    cost = world.params.problem(100, 0.02).cost  # type: ignore[attr-defined]
    plan = state(world).plan
    assert state(world).run_costs[FEEDBACK] == pytest.approx(cost.value(plan.X, plan.U), rel=1e-3)


def test_durations_are_shown_for_every_iteration() -> None:
    world = solved({})
    found = world.lab.fields(world.params, world.state)
    assert found["durations"].shape == (25, len(PHASES))
    assert found["timed"].shape == (25,)
    assert (found["durations"][:-1] > 0.0).all()
    forward = PHASES.index("forward")
    assert found["durations"][-1, forward] == 0.0, "what has converged is not rolled out again"
