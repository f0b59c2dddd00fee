"""Quadratic programmes whose active set is nearly known, against the interior-point solver."""

import numpy as np
import pytest
from scipy.sparse import csc_array

from labs.algorithms import sqp, sqp_active_set, sqp_subproblem
from labs.algorithms.collocation import Collocation
from labs.algorithms.sqp import SqpOptions
from labs.algorithms.sqp_active_set import ActiveSet, identify_active_set, solve_active
from labs.algorithms.sqp_qp_solver import QpSolution, QpSolver, QuadraticProgram
from labs.tasks.motion.continuous import MotionLimits, continuous_motion
from tests.labs.algorithms.transcriptions import straight_guess

TOLERANCE = 1e-11
STAGES, WIDE = 30, 3


def staged(rng: np.random.Generator) -> QuadraticProgram:
    """A random convex programme of stages: neighbours are joined by equalities; each stage has an
    inequality and bounds, its first variable is fixed in the first stage. Zero is feasible."""
    n = STAGES * WIDE
    P, A, G = np.zeros((n, n)), np.zeros((STAGES - 1, n)), np.zeros((STAGES, n))
    for k in range(STAGES):
        mine = slice(WIDE * k, WIDE * (k + 1))
        root = rng.standard_normal((WIDE, WIDE))
        P[mine, mine] = root @ root.T + 0.1 * np.eye(WIDE)
        G[k, mine] = rng.standard_normal(WIDE)
        if k + 1 < STAGES:
            A[k, WIDE * k : WIDE * (k + 2)] = rng.standard_normal(2 * WIDE)
    lower, upper = np.full(n, -0.4), np.full(n, 0.5)
    lower[2::3], upper[1::3] = -np.inf, np.inf
    lower[0] = upper[0] = 0.0
    q = 2.0 * rng.standard_normal(n)
    sparse = (csc_array(P), q, csc_array(A), np.zeros(STAGES - 1), csc_array(G))
    return QuadraticProgram(*sparse, np.full(STAGES, 0.3), lower, upper)


def interior(qp: QuadraticProgram) -> QpSolution:
    found = QpSolver().solve(qp, TOLERANCE)
    assert found.x is not None
    return found


def changed(active: ActiveSet, at: int) -> ActiveSet:
    """With what is said of one variable wrong."""
    bounds = active.bounds.copy()
    bounds[at] = 0.0 if bounds[at] else 1.0 if at % WIDE == 0 else -1.0
    return active._replace(bounds=bounds)


def is_optimal(qp: QuadraticProgram, found: QpSolution) -> None:
    """By all conditions of optimality, to more digits than an interior point has."""
    assert found.x is not None
    stationary = qp.P @ found.x + qp.q + qp.A.T @ found.y + qp.G.T @ found.z + found.z_bounds
    np.testing.assert_allclose(stationary, 0.0, atol=1e-11)
    np.testing.assert_allclose(qp.A @ found.x, qp.b, atol=1e-11)
    slack = qp.h - qp.G @ found.x
    assert (slack >= -1e-11).all()
    assert (found.z >= -1e-11).all()
    assert np.abs(found.z * slack).max() < 1e-10
    assert (found.x >= qp.lower - 1e-11).all()
    assert (found.x <= qp.upper + 1e-11).all()
    free = qp.lower < qp.upper
    assert (found.z_bounds[(found.x < qp.upper) & free] <= 1e-11).all()
    assert (found.z_bounds[(found.x > qp.lower) & free] >= -1e-11).all()


@pytest.mark.parametrize("seed", range(10))
def test_the_right_active_set_leads_to_the_solution(seed: int) -> None:
    qp = staged(np.random.default_rng(seed))
    by_ip = interior(qp)
    right = identify_active_set(qp, by_ip)
    assert right.bounds.any()
    assert right.inequalities.any()
    found = solve_active(qp, right, TOLERANCE)
    assert found
    assert found.x is not None
    is_optimal(qp, found)
    assert by_ip.x is not None
    np.testing.assert_allclose(found.x, by_ip.x, atol=1e-7)
    np.testing.assert_allclose(found.y, by_ip.y, atol=1e-6)
    np.testing.assert_allclose(found.z, by_ip.z, atol=1e-6)


def test_one_that_is_nearly_right_often_leads_there_and_never_elsewhere() -> None:
    arrived = 0
    for seed in range(10):
        qp = staged(np.random.default_rng(seed))
        right = identify_active_set(qp, interior(qp))
        for at in range(1, STAGES * WIDE, 8):  # not the fixed one
            found = solve_active(qp, changed(right, at), TOLERANCE)
            if found:
                is_optimal(qp, found)
                arrived += 1
    assert arrived > 50


def test_without_anything_active_one_linear_system_is_the_solution() -> None:
    qp = staged(np.random.default_rng(0))
    n, far = len(qp.q), np.full(len(qp.q), np.inf)
    qp = qp._replace(lower=-far, upper=far, h=np.full(STAGES, 1e3))
    found = solve_active(qp, ActiveSet(np.zeros(n), np.zeros(STAGES, bool)), TOLERANCE)
    A, m = qp.A.toarray(), len(qp.b)
    kkt = np.block([[qp.P.toarray(), A.T], [A, np.zeros((m, m))]])
    both = np.linalg.solve(kkt, np.r_[-qp.q, qp.b])
    assert found
    assert found.x is not None
    np.testing.assert_allclose(np.r_[found.x, found.y], both, atol=1e-9)


def test_what_was_not_nearly_known_is_left_to_the_solver() -> None:
    qp = staged(np.random.default_rng(1))
    n = len(qp.q)
    wrong = ActiveSet(np.where(np.isfinite(qp.upper), 1.0, -1.0), np.ones(STAGES, bool))
    assert solve_active(qp, wrong, TOLERANCE) is None  # more is held than there is room for
    many = sqp_active_set.MAX_CHANGES
    crowded = qp._replace(q=100.0 * qp.q)
    active = identify_active_set(crowded, interior(crowded))
    assert np.count_nonzero(active.bounds) > many
    assert solve_active(crowded, ActiveSet(np.zeros(n), np.zeros(STAGES, bool)), TOLERANCE) is None


def test_a_programme_without_a_band_is_left_to_the_solver() -> None:
    n = 12
    root = np.random.default_rng(2).standard_normal((n, n))
    none, far = csc_array((0, n)), np.full(n, np.inf)
    dense = QuadraticProgram(
        csc_array(root @ root.T), np.ones(n), none, np.zeros(0), none, np.zeros(0), -far, far
    )
    assert solve_active(dense, ActiveSet(np.zeros(n), np.zeros(0, bool)), TOLERANCE) is None


def test_an_active_set_that_settled_is_not_sought_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once it stays the same the solution comes by linear systems, to the same optimum."""
    N = 40
    problem = continuous_motion("pendulum", "weighted", 2.0, limits=MotionLimits(control=0.6))
    program, guess = Collocation(problem, N, "trapezoidal"), straight_guess(problem, N)
    y, options = program.variables(guess.X, guess.U), SqpOptions("gauss-newton")
    at = sqp.solve(program, y, options)
    assert at.converged
    assert at.active_set_settled
    assert at.active
    np.testing.assert_array_equal(at.active.bounds != 0.0, at.nu != 0.0)
    with monkeypatch.context() as patched:
        patched.setattr(sqp_subproblem, "solve_active", lambda *_: None)
        without = sqp.solve(program, y, options)
    assert without.converged
    assert at.values.f == pytest.approx(without.values.f, rel=1e-9)
    np.testing.assert_allclose(at.y, without.y, atol=1e-6)
    asked: list[float] = []
    solve = QpSolver.solve

    def counted(self: QpSolver, *arguments: object) -> QpSolution:
        asked.append(1.0)
        return solve(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(QpSolver, "solve", counted)
    again = sqp.solve(program, y, options)
    assert again.iteration == at.iteration
    assert 0 < len(asked) < 0.7 * again.iteration
