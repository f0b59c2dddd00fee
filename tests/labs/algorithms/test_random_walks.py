"""Prediction on the random walks of the literature, beside the figures that were published."""

import numpy as np
import pytest

from labs.algorithms.prediction import (
    EVERY_VISIT,
    FIRST_VISIT,
    LAMBDA_RETURN,
    N_STEP,
    TD0,
    TRUE_ONLINE,
    init,
    step,
)
from labs.problems.episodes import UpdateRule
from labs.tasks.random_walk.walks import FIVE_STATE_WALK, NINETEEN_STATE_WALK, WalkShape, walk_task

RUNS = 400


def errors(
    method: int, rule: UpdateRule, episodes: int = 10, walk: WalkShape = NINETEEN_STATE_WALK
) -> tuple[float, float]:
    """Mean error over the first episodes, and its standard error, of RUNS learners."""
    task = walk_task(walk)
    learners = init(
        task, RUNS, np.random.default_rng(11), v0=-0.5 if walk == FIVE_STATE_WALK else 0.0
    )
    found = step(task, rule, method, learners, episodes).errors.mean(axis=1)
    return float(found.mean()), float(found.std() / np.sqrt(RUNS))


def reference_n_step_td(n: int, alpha: float, runs: int) -> np.ndarray:
    """n-step TD on 19 states in plain Python, statement by statement as in the book's box, with
    other random numbers: (runs,) mean RMS error over the first 10 episodes."""
    luck, truth = np.random.default_rng(99), np.linspace(-0.9, 0.9, 19)
    found = np.zeros(runs)
    for run in range(runs):
        V = np.zeros(21)
        for _ in range(10):
            S, R, T, t = [10], [0.0], 10**9, 0
            while True:
                if t < T:
                    S.append(S[t] + (1 if luck.random() < 0.5 else -1))
                    R.append({0: -1.0, 20: 1.0}.get(S[-1], 0.0))
                    if S[-1] in (0, 20):
                        T = t + 1
                tau = t - n + 1
                if tau >= 0:
                    G = sum(R[tau + 1 : min(tau + n, T) + 1])
                    G += V[S[tau + n]] if tau + n < T else 0.0
                    V[S[tau]] += alpha * (G - V[S[tau]])
                if tau == T - 1:
                    break
                t += 1
            found[run] += np.sqrt(np.mean((V[1:20] - truth) ** 2)) / 10
    return found


@pytest.mark.parametrize(("n", "alpha"), [(1, 0.8), (4, 0.4), (16, 0.2)])
def test_the_nineteen_states_give_the_errors_of_the_book_s_pseudo_code(
    n: int, alpha: float
) -> None:
    book = reference_n_step_td(n, alpha, 100)
    mean, deviation = errors(N_STEP, UpdateRule(alpha, n=n))
    assert mean == pytest.approx(book.mean(), abs=3.5 * np.hypot(deviation, book.std() / 10))


def test_an_intermediate_n_is_best() -> None:
    """Figure 7.2 of Sutton and Barto: n = 4, alpha = 0.4, error 0.27; TD(0) comes to 0.35 at best,
    n = 64 to 0.44 and more; untrained, 0.5477."""
    assert errors(N_STEP, UpdateRule(0.0))[0] == pytest.approx(np.sqrt(0.3), rel=1e-12)
    best = {
        n: min((errors(N_STEP, UpdateRule(a / 20, n=n))[0], a / 20) for a in range(1, 21))
        for n in (1, 2, 4, 8, 64)
    }
    assert min(best, key=best.__getitem__) == 4
    assert best[4][1] == pytest.approx(0.4, abs=0.05)
    assert best[4][0] == pytest.approx(0.267, abs=0.008)
    assert best[1][0] == pytest.approx(0.346, abs=0.008)
    assert best[64][0] > 0.4


def test_an_intermediate_lambda_is_best() -> None:
    """Figures 12.3 and 12.8: lambda = 0.8 at an error of 0.27 forward and 0.26 true online, at
    alpha near 0.4; both as good as the best n or better."""
    for method, expected in ((LAMBDA_RETURN, 0.268), (TRUE_ONLINE, 0.260)):
        best = {
            lam: min(errors(method, UpdateRule(a / 10, trace_decay=lam))[0] for a in range(1, 11))
            for lam in (0.0, 0.4, 0.8, 0.95, 1.0)
        }
        assert min(best, key=best.__getitem__) == 0.8
        assert best[0.8] == pytest.approx(expected, abs=0.008)
        assert best[1.0] > 0.45


def test_td_beats_monte_carlo_on_five_states() -> None:
    """Example 6.2 of Sutton and Barto, 100 episodes: each curve of TD(0) (alpha 0.05, 0.1, 0.15) is
    below each of MC (0.01 to 0.04) in the mean; all begin at 0.2357."""
    td = [errors(TD0, UpdateRule(a), 100, FIVE_STATE_WALK)[0] for a in (0.05, 0.1, 0.15)]
    mc = [
        errors(EVERY_VISIT, UpdateRule(a), 100, FIVE_STATE_WALK)[0]
        for a in (0.01, 0.02, 0.03, 0.04)
    ]
    assert max(td) < min(mc)
    task = walk_task(FIVE_STATE_WALK)
    learners = init(task, RUNS, np.random.default_rng(0), v0=-0.5)
    before = step(task, UpdateRule(0.0), TD0, learners, 1).errors
    np.testing.assert_allclose(before, np.sqrt((2 / 9 + 2 / 36) / 5))
    after = step(task, UpdateRule(0.1), TD0, learners, 100).errors.mean(axis=0)
    assert after.min() < 0.08


def test_monte_carlo_is_unbiased_and_td_is_not_but_varies_less() -> None:
    """After 5 episodes of 20 000 learners: first-visit means lie at the truth within their standard
    errors (a state that was not seen counts for nothing); TD(0) still leans on its first guess."""
    task, many = walk_task(FIVE_STATE_WALK), 20_000
    start = init(task, many, np.random.default_rng(2))
    mc = step(task, UpdateRule(1.0, omega=1.0), FIRST_VISIT, start, 5)
    td = step(task, UpdateRule(0.1), TD0, start, 5)
    for x in range(1, 6):
        seen = mc.V[mc.visits[:, x] > 0, x]
        off = seen.mean() - task.truth[x]
        assert abs(off) < 4.0 * seen.std() / np.sqrt(len(seen))
        assert td.V[:, x].mean() - task.truth[x] > 0.1
        assert td.V[:, x].std() < seen.std()


def test_robbins_monro_steps_converge_and_constant_ones_stay_noisy() -> None:
    task = walk_task(FIVE_STATE_WALK)
    start = init(task, 20, np.random.default_rng(3))
    falling = step(task, UpdateRule(1.0, omega=0.8), TD0, start, 20_000)
    constant = step(task, UpdateRule(0.1), TD0, start, 20_000)
    assert np.abs(falling.V - task.truth).max() < 0.03
    assert falling.errors[:, -1].mean() < 0.2 * constant.errors[:, -1].mean()
