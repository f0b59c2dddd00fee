"""Prediction: each update against plain Python, forward against backward, and trouble."""

from dataclasses import replace

import numpy as np
import pytest

from labs.algorithms.prediction import (
    ELIGIBILITY_TRACES,
    EVERY_VISIT,
    FIRST_VISIT,
    LAMBDA_RETURN,
    N_STEP,
    TD0,
    TRUE_ONLINE,
    Predictors,
    init,
    on_policy_task,
    step,
)
from labs.errors import LabError
from labs.problems.episodes import UpdateRule
from labs.problems.finite_mdp import FiniteMDP
from labs.problems.prediction import (
    PredictionTask,
    empty_episode,
    prediction_task,
    sample_episode,
)
from labs.tasks.random_walk.walks import FIVE_STATE_WALK, NINETEEN_STATE_WALK, walk_mdp, walk_task

GAMMA = 0.9
METHODS = (FIRST_VISIT, EVERY_VISIT, TD0, N_STEP, LAMBDA_RETURN, ELIGIBILITY_TRACES, TRUE_ONLINE)


def task(horizon: int = 10_000) -> PredictionTask:
    """Four states that lead to one another and now and then to an end, under a random policy."""
    rng = np.random.default_rng(7)
    P = rng.dirichlet(np.full(5, 0.7), (2, 5))
    P[:, 4] = np.eye(5)[4]
    cost = rng.uniform(-1.0, 2.0, (5, 2))
    cost[4] = 0.0
    mdp = FiniteMDP(cost, GAMMA, np.arange(5) == 4, P=P)
    return on_policy_task(mdp, rng.dirichlet(np.ones(2), 5), [0, 1, 2, 3], horizon)


def random_learners(task: PredictionTask, seeds: int = 1, seed: int = 3) -> Predictors:
    """Learners with some opinion already."""
    learners = init(task, seeds, np.random.default_rng(seed))
    V = np.random.default_rng(4).uniform(0.0, 5.0, learners.V.shape)
    return replace(learners, V=np.where(task.task.terminal, 0.0, V))


def first_episodes(
    task: PredictionTask, learners: Predictors, episodes: int
) -> list[tuple[list[int], list[float]]]:
    """What the first learner will meet: (states, costs) of each episode."""
    room, random, found = empty_episode(task.task.horizon), learners.random[0].copy(), []
    for _ in range(episodes):
        T = sample_episode(task, random, room)
        found.append((room.states[: T + 1].tolist(), room.costs[:T].tolist()))
    return found


def n_step_return(V: np.ndarray, xs: list[int], costs: list[float], t: int, n: int) -> float:
    end = min(t + n, len(costs))
    return float(sum(GAMMA ** (k - t) * costs[k] for k in range(t, end))) + float(
        GAMMA ** (end - t) * V[xs[end]]
    )


def lambda_return(V: np.ndarray, xs: list[int], costs: list[float], t: int, lam: float) -> float:
    """As the notes define it, cut at the end of `costs`."""
    N = len(costs) - t
    near = sum((1 - lam) * lam ** (n - 1) * n_step_return(V, xs, costs, t, n) for n in range(1, N))
    return near + lam ** (N - 1) * n_step_return(V, xs, costs, t, N)


# Each update in plain Python --------------------------------------------------------------------


@pytest.mark.parametrize("horizon", [10_000, 5])
@pytest.mark.parametrize("n", [1, 2, 3, 50])
def test_n_step_td_does_what_it_says(n: int, horizon: int) -> None:
    """In the order of the book: a state is updated when its n costs are there."""
    walk = task(horizon)
    before = random_learners(walk)
    V, N = before.V[0].copy(), np.zeros(5)
    for xs, costs in first_episodes(walk, before, 20):
        T = len(costs)
        for t in range(max(T - n, 0)):
            N[xs[t]] += 1
            target = n_step_return(V, xs, costs, t, n)
            V[xs[t]] += 0.5 * N[xs[t]] ** -0.7 * (target - V[xs[t]])
        last = [(t, n_step_return(V, xs, costs, t, n)) for t in range(max(T - n, 0), T)]
        for t, target in last:
            N[xs[t]] += 1
            V[xs[t]] += 0.5 * N[xs[t]] ** -0.7 * (target - V[xs[t]])
    after = step(walk, UpdateRule(0.5, 0.7, n=n), N_STEP, before, 20)
    np.testing.assert_allclose(after.V[0], V, rtol=1e-12)
    assert np.array_equal(after.visits[0], N)


@pytest.mark.parametrize("first", [True, False])
def test_monte_carlo_with_steps_of_one_over_n_is_the_mean(first: bool) -> None:
    walk = task()
    before = init(walk, 1, np.random.default_rng(5), v0=9.0)
    samples: dict[int, list[float]] = {x: [] for x in range(4)}
    for xs, costs in first_episodes(walk, before, 50):
        for t, x in enumerate(xs[:-1]):
            if not first or x not in xs[:t]:
                samples[x].append(n_step_return(np.zeros(5), xs, costs, t, len(costs)))
    method = FIRST_VISIT if first else EVERY_VISIT
    after = step(walk, UpdateRule(1.0, omega=1.0), method, before, 50)
    means = [np.mean(samples[x]) for x in range(4)]
    np.testing.assert_allclose(after.V[0, :4], means, rtol=1e-12)
    assert after.visits[0, :4].tolist() == [len(samples[x]) for x in range(4)]


def test_true_online_is_the_forward_view_at_every_step() -> None:
    """Against the online lambda-return algorithm: with each new step everything is done anew from
    the start of the episode, with the lambda-returns cut there."""
    walk, alpha, lam = task(), 0.3, 0.8
    before = random_learners(walk)
    V = before.V[0].copy()
    for xs, costs in first_episodes(walk, before, 6):
        values = [V.copy()]  # V_h, each from V_0
        for h in range(1, len(costs) + 1):
            anew = values[0].copy()
            for t in range(h):
                # n-step returns bootstrap from the value of the time they end.
                J = sum(
                    (1 - lam) * lam ** (n - 1) * n_step_return(values[t + n - 1], xs, costs, t, n)
                    for n in range(1, h - t)
                )
                J += lam ** (h - t - 1) * n_step_return(values[h - 1], xs[: h + 1], costs[:h], t, h)
                anew[xs[t]] += alpha * (J - anew[xs[t]])
            values.append(anew)
        V = values[-1]
    after = step(walk, UpdateRule(alpha, trace_decay=lam), TRUE_ONLINE, before, 6)
    np.testing.assert_allclose(after.V[0], V, rtol=1e-11)


@pytest.mark.parametrize("horizon", [10_000, 5])
@pytest.mark.parametrize("lam", [0.0, 0.4, 0.9, 1.0])
def test_forward_and_backward_view_agree_offline(lam: float, horizon: int) -> None:
    walk = task(horizon)
    before = random_learners(walk)
    ((xs, costs),) = first_episodes(walk, before, 1)
    V = before.V[0]
    assert len(set(xs)) < len(xs), "some state comes again"
    expected = V.copy()
    for t, x in enumerate(xs[:-1]):
        expected[x] += 0.2 * (lambda_return(V, xs, costs, t, lam) - V[x])
    rule = UpdateRule(0.2, trace_decay=lam, offline=True)
    forward = step(walk, rule, LAMBDA_RETURN, before, 1).V[0]
    backward = step(walk, rule, ELIGIBILITY_TRACES, before, 1).V[0]
    np.testing.assert_allclose(forward, expected, rtol=1e-13)
    np.testing.assert_allclose(backward, forward, rtol=1e-12)
    online = rule._replace(offline=False)
    gap = np.abs(step(walk, online, ELIGIBILITY_TRACES, before, 1).V - backward).max()
    assert gap > 1e-3, "online it is another update"


# One family -------------------------------------------------------------------------------------


@pytest.mark.parametrize("offline", [True, False])
@pytest.mark.parametrize("omega", [0.0, 0.8])
def test_td0_is_one_step_and_lambda_zero_bit_for_bit(omega: float, offline: bool) -> None:
    for walk in (task(), task(5), walk_task(NINETEEN_STATE_WALK)):
        rule = UpdateRule(0.3, omega, n=1, trace_decay=0.0, offline=offline)
        before = random_learners(walk, seeds=5)
        td = step(walk, rule, TD0, before, 10)
        same = [N_STEP, ELIGIBILITY_TRACES] + ([LAMBDA_RETURN] if offline else [])
        for method in same:
            other = step(walk, rule, method, before, 10)
            assert np.array_equal(other.V, td.V), method
            assert np.array_equal(other.errors, td.errors)


@pytest.mark.parametrize("offline", [True, False])
def test_monte_carlo_is_all_steps_and_lambda_one_bit_for_bit(offline: bool) -> None:
    for walk in (task(), walk_task(NINETEEN_STATE_WALK)):
        rule = UpdateRule(0.1, n=10**6, trace_decay=1.0, offline=offline)
        before = random_learners(walk, seeds=5)
        monte_carlo = step(walk, rule, EVERY_VISIT, before, 10)
        for method in (N_STEP, LAMBDA_RETURN):
            other = step(walk, rule, method, before, 10)
            assert np.array_equal(other.V, monte_carlo.V), method
        if offline:
            # Offline, the traces of a long walk may leave all bounds; one episode shows the rest.
            one = step(walk, rule, EVERY_VISIT, before, 1)
            np.testing.assert_allclose(
                step(walk, rule, ELIGIBILITY_TRACES, before, 1).V, one.V, rtol=1e-10
            )


@pytest.mark.parametrize("method", METHODS)
def test_learning_can_be_interrupted_and_leaves_the_old_learners_alone(method: int) -> None:
    walk = task()
    rule = UpdateRule(0.3, 0.6, n=3, trace_decay=0.6)
    start = random_learners(walk, seeds=4)
    kept = start.V.copy()
    whole = step(walk, rule, method, start, 30)
    half = step(walk, rule, method, start, 17)
    rest = step(walk, rule, method, half, 13)
    assert np.array_equal(rest.V, whole.V)
    assert np.array_equal(np.hstack([half.errors, rest.errors]), whole.errors)
    assert np.array_equal(np.hstack([half.lengths, rest.lengths]), whole.lengths)
    assert np.array_equal(start.V, kept)
    for method_too in METHODS:
        other = step(walk, rule, method_too, start, 30)
        assert np.array_equal(other.lengths, whole.lengths), "all meet the same episodes"


# Trouble ---------------------------------------------------------------------------------------


def test_monte_carlo_learns_nothing_from_an_episode_that_was_cut() -> None:
    endless = FiniteMDP(
        np.ones((2, 1)), 0.5, np.zeros(2, bool), successor=np.array([[1], [0]], np.int32)
    )
    loop = on_policy_task(endless, np.zeros(2, int), [0], 50)
    before = init(loop, 1, np.random.default_rng(0))
    for method in (FIRST_VISIT, EVERY_VISIT):
        assert not step(loop, UpdateRule(0.5), method, before, 10).V.any()
    td = step(loop, UpdateRule(0.5), TD0, before, 10)
    np.testing.assert_allclose(td.V[0], [2.0, 2.0], rtol=1e-12)


def test_accumulating_traces_may_diverge_and_say_so() -> None:
    walk = walk_task(NINETEEN_STATE_WALK)
    rule = UpdateRule(1.0, trace_decay=1.0, limit=1e6)
    start = init(walk, 20, np.random.default_rng(0))
    after = step(walk, rule, ELIGIBILITY_TRACES, start, 10)
    assert not after.bounded.any()
    assert (np.abs(after.V) <= 1e6).all()
    assert np.isinf(after.errors[:, -1]).all()
    again = step(walk, rule, ELIGIBILITY_TRACES, after, 2)
    assert np.array_equal(again.V, after.V)
    assert step(walk, rule._replace(replacing=True), ELIGIBILITY_TRACES, start, 10).bounded.all()


def test_what_does_not_fit_is_refused() -> None:
    five, nineteen = walk_task(FIVE_STATE_WALK), walk_task(NINETEEN_STATE_WALK)
    learners = init(five, 1, np.random.default_rng(0))
    for where, rule, method, words in (
        (nineteen, UpdateRule(), TD0, "must agree"),
        (five, UpdateRule(alpha=1.5), TD0, "alpha = 1.5"),
        (five, UpdateRule(trace_decay=-1.0), ELIGIBILITY_TRACES, "lambda = -1"),
        (five, UpdateRule(n=0), N_STEP, "n = 0"),
        (five, UpdateRule(offline=True), TRUE_ONLINE, "no offline form"),
        (five, UpdateRule(), 7, "no method 7"),
    ):
        with pytest.raises(LabError, match=words):
            step(where, rule, method, learners, 1)
    mdp = walk_mdp(FIVE_STATE_WALK)
    right, even = np.tile([0.0, 1.0], (7, 1)), np.full((7, 2), 0.5)
    with pytest.raises(LabError, match="never tries"):
        prediction_task(mdp, right, five.truth, [3], 10, target=even)
    other = prediction_task(mdp, even, five.truth, [3], 10, target=right)
    with pytest.raises(LabError, match="of no other"):
        step(other, UpdateRule(), TD0, learners, 1)
    with pytest.raises(LabError, match="rows of 2 probabilities"):
        prediction_task(mdp, np.ones((7, 2)), five.truth, [3], 10)
