"""The receding horizon: what acts, what the next plan starts from, delays, and plans not found."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from labs.algorithms.linear_mpc import LinearPlanner
from labs.algorithms.mpc import MpcOptions, RecedingHorizonState, init, shift_plan, step
from labs.errors import LabError
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.receding_horizon import Plan, Planner
from labs.resumable import Resumable, run_to_completion
from tests.labs.algorithms.linear_mpc_problems import DOUBLE_INTEGRATOR, with_riccati

PROBLEM = with_riccati(DOUBLE_INTEGRATOR)
REST = np.zeros(1)


def close_loop(
    planner: Planner,
    options: MpcOptions,
    x: Sequence[float],
    periods: int,
    brake: np.ndarray = REST,
    held: Sequence[int] = (),
) -> tuple[np.ndarray, np.ndarray, list[RecedingHorizonState]]:
    """States, controls and controllers; in the `held` periods nothing is planned."""
    at, X, U, seen = init(options, REST), [np.array(x)], [], []
    for t in range(periods):
        work = step(planner, PROBLEM.step, options, at, X[-1], brake, t not in held)
        at = run_to_completion(work)
        seen.append(at)
        U.append(at.u)
        X.append(PROBLEM.step(X[-1], at.u))
    return np.array(X), np.array(U), seen


@dataclass
class RecordingPlanner:
    """A planner that keeps what it was asked, and finds nothing in some periods."""

    problem: LinearMpcProblem
    without: Sequence[int] = ()
    asked: list[tuple[np.ndarray, Plan | None, int | None]] = field(default_factory=list)

    def plan(self, x: np.ndarray, guess: Plan | None, N: int | None = None) -> Resumable[Plan]:
        self.asked.append((x, guess, N))
        plan = yield from LinearPlanner(self.problem).plan(x, guess, N)
        if len(self.asked) - 1 in self.without:
            return replace(plan, found=False, message="Nothing today.")
        return plan


def test_the_first_control_acts_and_the_rest_is_the_next_guess() -> None:
    spy = RecordingPlanner(PROBLEM)
    X, U, seen = close_loop(spy, MpcOptions(), [1.5, 0.2], 25)
    assert np.abs(X[-1]).max() < 0.05
    for t, at in enumerate(seen):
        assert at.plan is not None
        assert not at.status
        np.testing.assert_array_equal(at.u, at.plan.U[0])
        np.testing.assert_allclose(X[t + 1], at.plan.X[1], atol=1e-12)
    plan, guess = seen[3].plan, spy.asked[4][1]
    assert plan is not None
    assert guess is not None
    assert not plan.seconds
    assert np.isfinite(guess.cost)
    np.testing.assert_array_equal(guess.U[:-1], plan.U[1:])
    assert guess.U[-1] == 0.0
    np.testing.assert_allclose(guess.X[-1], PROBLEM.step(plan.X[-1], REST))
    np.testing.assert_array_equal(guess.active["control"][:-1], plan.active["control"][1:])
    _, same, _ = close_loop(LinearPlanner(PROBLEM), MpcOptions(warm=False), [1.5, 0.2], 25)
    np.testing.assert_allclose(same, U, atol=1e-10)
    options = MpcOptions(last="repeated")
    repeated = shift_plan(plan, 2, PROBLEM.step, options)
    assert repeated is not None
    np.testing.assert_array_equal(repeated.U[-3:, 0], np.repeat(plan.U[-1], 3))
    assert shift_plan(plan, len(plan.U), PROBLEM.step, options) is None
    warm, cold = (
        sum(
            s.plan.iterations
            for s in close_loop(spy, MpcOptions(warm=w), [1.5, 0.2], 25)[2]
            if s.plan
        )
        for w in (True, False)
    )
    assert warm < 0.6 * cold


def test_a_horizon_that_shrinks_does_as_planned_and_one_that_recedes_does_not() -> None:
    """Bellman's principle; without a terminal cost the plans differ."""
    for shrink_from, same in ((10, True), (None, False)):
        spy = RecordingPlanner(DOUBLE_INTEGRATOR)
        X, _, seen = close_loop(spy, MpcOptions(shrink_from=shrink_from), [1.0, 0.0], 10)
        first = seen[0].plan
        assert first is not None
        assert np.allclose(X, first.X, atol=1e-9) == same
        assert [N for *_, N in spy.asked] == (list(range(10, 0, -1)) if same else [None] * 10)
        guess = spy.asked[3][1]
        assert guess is not None
        assert len(guess.U) == (7 if same else 10)
    # After its end it begins anew.
    spy = RecordingPlanner(DOUBLE_INTEGRATOR)
    close_loop(spy, MpcOptions(shrink_from=3), [1.0, 0.0], 5)
    assert [N for *_, N in spy.asked] == [3, 2, 1, 3, 2]


@pytest.mark.parametrize("delay", [1, 3])
def test_a_delay_that_is_compensated_only_shifts_the_run(delay: int) -> None:
    planner, x = LinearPlanner(PROBLEM), np.array([1.2, 0.1])
    X, U, seen = close_loop(planner, MpcOptions(delay=delay), x.tolist(), 30)
    np.testing.assert_array_equal(U[:delay], 0.0)
    for _ in range(delay):
        x = PROBLEM.step(x, REST)
    prompt, _, _ = close_loop(planner, MpcOptions(), x.tolist(), 30 - delay)
    np.testing.assert_allclose(X[delay:], prompt, atol=1e-9)
    assert seen[-1].committed.shape == (delay, 1)


def test_a_delay_that_is_not_compensated_acts_late() -> None:
    options = MpcOptions(delay=2, compensate=False)
    spy = RecordingPlanner(PROBLEM)
    X, U, _ = close_loop(spy, options, [1.2, 0.1], 30)
    for t in range(5):
        np.testing.assert_array_equal(spy.asked[t][0], X[t])
        late = run_to_completion(LinearPlanner(PROBLEM).plan(X[t], None))
        np.testing.assert_allclose(U[t + 2], late.U[0], atol=1e-10)
    prompt, _, _ = close_loop(spy, MpcOptions(delay=2), [1.2, 0.1], 30)
    assert np.abs(X).sum() > 1.05 * np.abs(prompt).sum()


def test_without_a_plan_the_last_goes_on_or_the_brake_acts() -> None:
    missing, brake = (4, 5, 6), np.array([0.3])
    _, U, seen = close_loop(RecordingPlanner(PROBLEM, missing), MpcOptions(), [1.5, 0.2], 9, brake)
    plan = seen[3].plan
    assert plan is not None
    np.testing.assert_array_equal(U[3:7], plan.U[:4])
    assert seen[4].status == (
        "No plan in period 4: Nothing today. Instead the plan of one period before goes on."
    )
    assert "plan of 3 periods before goes on" in seen[6].status
    assert not seen[7].status
    assert seen[8].failures == 3
    braking = MpcOptions(fallback="brake")
    _, U, seen = close_loop(RecordingPlanner(PROBLEM, missing), braking, [1.5, 0.2], 9, brake)
    np.testing.assert_array_equal(U[4:7], 0.3)
    assert "Instead the brake acts." in seen[5].status
    # After its end a plan has no rest.
    _, U, seen = close_loop(
        RecordingPlanner(PROBLEM, range(1, 20)), MpcOptions(), [1.5, 0.2], 12, brake
    )
    np.testing.assert_array_equal(U[10:], 0.3)
    assert "the brake acts" in seen[10].status
    _, U, seen = close_loop(
        RecordingPlanner(PROBLEM, range(20)), MpcOptions(), [1.5, 0.2], 3, brake
    )
    np.testing.assert_array_equal(U, 0.3)
    assert seen[-1].plan is None


def test_periods_in_which_nothing_is_planned_follow_the_plan() -> None:
    spy = RecordingPlanner(PROBLEM)
    _, U, seen = close_loop(spy, MpcOptions(), [1.5, 0.2], 8, held=(1, 2, 3))
    plan = seen[0].plan
    assert plan is not None
    np.testing.assert_array_equal(U[:4], plan.U[:4])
    assert len(spy.asked) == 5
    assert not any(at.status for at in seen)


def test_wrong_options_say_what_is_allowed() -> None:
    with pytest.raises(LabError, match="0 or more"):
        MpcOptions(delay=-1)
    with pytest.raises(LabError, match="1 or more"):
        MpcOptions(shrink_from=0)
