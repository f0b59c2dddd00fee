"""SQP: published optima, multipliers, quadratic convergence, and what it says when there is no
solution."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.sparse import csc_array

from labs.algorithms import sqp
from labs.algorithms.sqp import SqpOptions
from labs.algorithms.sqp_bfgs import LARGEST_GROUP, initial_hessian
from labs.algorithms.sqp_convexity import convexify, is_positive_definite
from labs.algorithms.sqp_qp_solver import QpSolver
from labs.algorithms.sqp_subproblem import (
    QpFailure,
    Subproblem,
    SubproblemSolution,
    least_violation,
    solve_subproblem,
)
from labs.errors import LabError
from labs.problems.nonlinear_program import ProgramValues
from tests.labs.algorithms.small_programs import PUBLISHED, SmallProgram


@pytest.mark.parametrize("hessian", ["exact", "bfgs"])
@pytest.mark.parametrize("number", PUBLISHED)
def test_published_optima_are_found(number: str, hessian: str) -> None:
    published = PUBLISHED[number]
    found = sqp.solve(published.program, np.array(published.start), SqpOptions(hessian))
    assert found.converged, found.stopped
    assert found.stopped.startswith(f"Converged after {found.iteration} iteration")
    assert found.values.f == pytest.approx(published.optimum, rel=1e-7, abs=1e-7)
    assert found.violation < 1e-6


@pytest.mark.parametrize("number", PUBLISHED)
def test_what_has_converged_meets_the_conditions_of_optimality(number: str) -> None:
    program = PUBLISHED[number].program
    at = sqp.solve(program, np.array(PUBLISHED[number].start))
    d = program.derivatives(at.y)
    stationarity = at.gradient(d) + at.nu
    np.testing.assert_allclose(stationarity, 0.0, atol=1e-6 * max(1.0, np.abs(d.f_y).max()))
    assert (at.mu >= 0.0).all()
    np.testing.assert_allclose(at.mu * at.values.g, 0.0, atol=1e-6)
    inside = (at.y > program.lower + 1e-6) & (at.y < program.upper - 1e-6)
    np.testing.assert_allclose(at.nu[inside], 0.0, atol=1e-7)
    assert (at.nu[at.y < program.lower + 1e-6] <= 0.0).all()


def test_the_active_set_is_told() -> None:
    at = sqp.solve(PUBLISHED["71"].program, np.array(PUBLISHED["71"].start))
    np.testing.assert_array_equal(at.active_bounds, [-1, 0, 0, 0])
    np.testing.assert_array_equal(at.active_inequalities, [True])


@pytest.mark.parametrize("number", ["7", "71", "100"])
def test_near_a_solution_the_number_of_right_digits_doubles(number: str) -> None:
    """With exact second derivatives; the KKT residual tells."""
    published, options = PUBLISHED[number], SqpOptions("exact", tolerance=1e-13)
    at, residuals = sqp.init(published.program, np.array(published.start), options), []
    while not at.stopped:
        at = sqp.step(published.program, options, at)
        assert at.optimality
        residuals.append(max(at.optimality.residual, at.optimality.violation))
    near = [k for k, r in enumerate(residuals[:-1]) if 1e-9 < r < 1e-2]
    assert near
    for k in near:
        assert residuals[k + 1] < max(100.0 * residuals[k] ** 1.8, 1e-10)


def test_a_quadratic_programme_takes_one_step() -> None:
    program = SmallProgram(
        3,
        lambda y: 9 - 8 * y[0] - 6 * y[1] - 4 * y[2] + 2 * y[0] ** 2 + 2 * y[1] ** 2 + y[2] ** 2
        + 2 * y[0] * y[1] + 2 * y[0] * y[2],
        g=lambda y: [y[0] + y[1] + 2 * y[2] - 3],
        lower=0.0,
    )  # fmt: skip
    at = sqp.solve(program, np.full(3, 0.5))
    assert (at.iteration, at.converged, at.alpha) == (1, True, 1.0)
    assert at.values.f == pytest.approx(1.0 / 9.0, abs=1e-9)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_the_unit_of_the_cost_does_not_matter(unit: float) -> None:
    start = np.array(PUBLISHED["71"].start)
    scaled = SmallProgram(
        4,
        lambda s: unit * (s[0] * s[3] * (s[0] + s[1] + s[2]) + s[2]),
        lambda s: [ca.dot(s, s) - 40],
        lambda s: [25 - s[0] * s[1] * s[2] * s[3]],
        1.0,
        5.0,
        unit,
    )
    at, same = sqp.solve(scaled, start), sqp.solve(PUBLISHED["71"].program, start)
    assert at.converged
    np.testing.assert_allclose(at.y, same.y, rtol=1e-6)
    np.testing.assert_allclose(at.lam / unit, same.lam, rtol=1e-5)


def circle(wanted: float, upper: float = np.inf) -> SmallProgram:
    """The distance from the origin, on the line y_1 + y_2 = wanted."""
    return SmallProgram(2, lambda y: ca.dot(y, y), lambda y: [y[0] + y[1] - wanted], upper=upper)


def test_contradictory_constraints_are_infeasible_and_named() -> None:
    at = sqp.solve(circle(3.0, upper=1.0), np.zeros(2))
    assert at.infeasible
    assert not at.converged
    assert at.stopped.startswith("Infeasible, at least near here: no step comes closer to")
    assert "equality 1 is off by 1." in at.stopped
    apart = SmallProgram(1, lambda y: y[0] ** 2, g=lambda y: [y[0] - 1, 2 - y[0]])
    at = sqp.solve(apart, np.array([7.0]))
    assert at.infeasible
    assert "inequality" in at.stopped


def test_curved_constraints_that_do_not_meet_are_infeasible() -> None:
    """A circle of radius 1 and a line 2 away; where they are closest is found first."""
    apart = SmallProgram(
        2, lambda y: (y[0] - 3) ** 2, lambda y: [ca.dot(y, y) - 1], lambda y: [2 - y[1]]
    )
    at = sqp.solve(apart, np.array([3.0, 0.5]))
    assert not at.converged
    assert at.infeasible, at.stopped


def test_bounds_that_cross_are_infeasible() -> None:
    program = circle(1.0)
    program.lower[0] = 2.0
    program.upper[0] = 1.0
    at = sqp.init(program, np.zeros(2), SqpOptions())
    assert at.infeasible
    assert at.stopped == "Infeasible: the lower bound of y_1 is above its upper one."
    assert sqp.step(program, SqpOptions(), at) is at


class Diverging(SmallProgram):
    """Without a value beyond y_1 = edge."""

    edge = 1.0

    def values(self, y: np.ndarray) -> ProgramValues:
        values = super().values(y)
        return values._replace(f=np.inf) if y[0] > self.edge else values


def test_a_step_into_nowhere_is_shortened() -> None:
    program = Diverging(1, lambda y: (y[0] - 1) ** 4 - y[0], lower=-5.0)
    program.edge = 1.8
    at = sqp.solve(program, np.array([0.0]))
    assert at.converged
    assert at.y[0] == pytest.approx(1.0 + 0.25 ** (1 / 3))


def test_a_programme_that_has_no_value_further_on_fails_in_a_sentence() -> None:
    program = Diverging(1, lambda y: (y[0] - 3) ** 2)
    program.edge = 0.0
    at = sqp.solve(program, np.array([0.0]))
    assert not at.converged
    assert at.stopped.startswith("Failed: the line search is exhausted: every rollout")
    program.edge = -1.0
    assert "first guess diverges" in sqp.solve(program, np.array([0.0])).stopped


def test_it_stops_short_at_the_limit_and_goes_on_from_there() -> None:
    published = PUBLISHED["100"]
    options = SqpOptions(iterations=2)
    at = sqp.solve(published.program, np.array(published.start), options)
    assert not at.converged
    assert at.stopped.startswith("Stopped short after 2 iterations: KKT residual")
    at = sqp.solve(published.program, at.y)
    assert at.converged


def test_the_same_guess_gives_the_same_digits() -> None:
    published = PUBLISHED["81"]
    runs = [sqp.solve(published.program, np.array(published.start)) for _ in range(2)]
    np.testing.assert_array_equal(runs[0].y, runs[1].y)
    np.testing.assert_array_equal(runs[0].lam, runs[1].lam)


def test_wrong_use_is_said() -> None:
    with pytest.raises(LabError, match=r"the first guess has shape \(3,\); .* takes \(2,\)"):
        sqp.init(circle(1.0), np.zeros(3), SqpOptions())
    with pytest.raises(LabError, match="no Hessian is named 'newton'; there are gauss-newton"):
        SqpOptions("newton")
    with pytest.raises(LabError, match="tolerance = 0"):
        SqpOptions(tolerance=0.0)
    with pytest.raises(LabError, match=f"{LARGEST_GROUP} are the most: choose Gauss-Newton"):
        initial_hessian(csc_array(np.ones((LARGEST_GROUP + 1, LARGEST_GROUP + 1))))


# Parts ----------------------------------------------------------------------------------------


def random_band(rng: np.random.Generator, n: int, border: bool) -> np.ndarray:
    M = np.triu(np.tril(rng.normal(size=(n, n)), 2), -2)
    M = M @ M.T / 12 + 0.4 * np.eye(n)
    if border:
        M[-1, :] = M[:, -1] = 0.1 * rng.normal(size=n)
        M[-1, -1] = 1.0
    return M


@pytest.mark.parametrize("border", [False, True])
def test_definiteness_is_that_of_the_eigenvalues(border: bool) -> None:
    rng, seen = np.random.default_rng(0), set()
    for _ in range(30):
        M = random_band(rng, 12, border) - rng.uniform(0.0, 1.0) * np.eye(12)
        definite = bool(np.linalg.eigvalsh(M)[0] > 0.0)
        assert is_positive_definite(csc_array(M), 0.0) == definite
        seen.add(definite)
    assert seen == {True, False}


def test_a_hessian_convex_along_the_constraints_is_made_convex_without_bending_the_step() -> None:
    H = np.diag([-1.0, 2.0, 3.0])
    A = csc_array(np.array([[1.0, 0.0, 0.5]]))
    convex = convexify(csc_array(H), csc_array((3, 3)), A, np.zeros(3, bool), 1.0, 0.0)
    assert convex
    assert (convex.theta, convex.delta) == (1.0, 0.0)
    assert np.linalg.eigvalsh(convex.P.toarray())[0] > 0.0
    q, none = np.array([0.3, -1.0, 2.0]), np.full(3, np.inf)
    G = csc_array((0, 3))
    qp = Subproblem(convex.P, q, A, np.array([0.7]), G, np.zeros(0), -none, none)
    found = solve_subproblem(qp, QpSolver())
    assert isinstance(found, SubproblemSolution)
    kkt = np.block([[H, A.toarray().T], [A.toarray(), np.zeros((1, 1))]])
    newton = np.linalg.solve(kkt, np.r_[-q, 0.7])
    np.testing.assert_allclose(found.p, newton[:3], atol=1e-8)
    lam = found.lam + convex.rho * (A @ found.p)
    np.testing.assert_allclose(lam, newton[3:], atol=1e-6)


def test_a_saddle_is_mixed_with_gauss_newton() -> None:
    H, f_yy = csc_array(np.diag([-1.0, 1.0])), csc_array(np.eye(2))
    convex = convexify(H, f_yy, csc_array((0, 2)), np.zeros(2, bool), 1.0, 0.0)
    assert convex
    assert 0.0 < convex.theta < 0.5
    assert convex.delta == 0.0
    flat = convexify(H, csc_array((2, 2)), csc_array((0, 2)), np.zeros(2, bool), 1.0, 0.0)
    assert flat
    assert flat.theta == 0.0
    assert flat.delta > 0.0


def test_a_quadratic_programme_without_a_point_is_known_as_such() -> None:
    A, G = csc_array(np.array([[1.0, 1.0]])), csc_array((0, 2))
    box = np.ones(2)
    qp = Subproblem(
        csc_array(np.eye(2)), np.zeros(2), A, np.array([5.0]), G, np.zeros(0), -box, box
    )
    answer = solve_subproblem(qp, QpSolver())
    assert isinstance(answer, QpFailure)
    assert answer.infeasible
    assert least_violation(qp, np.full(2, 9.0), QpSolver()) == pytest.approx(3.0, abs=1e-6)


def test_what_the_solver_cannot_read_is_not_trusted() -> None:
    none, G = np.full(2, np.inf), csc_array((0, 2))
    P = csc_array(np.full((2, 2), np.nan))
    qp = Subproblem(P, np.zeros(2), G, np.zeros(0), G, np.zeros(0), -none, none)
    assert isinstance(solve_subproblem(qp, QpSolver()), QpFailure)


def test_a_restart_keeps_multipliers_that_fit() -> None:
    at = sqp.solve(circle(1.0), np.zeros(2))
    warm = sqp.warm_start(circle(1.2), at, SqpOptions())
    np.testing.assert_array_equal(warm.lam, at.lam)
    assert sqp.solve(circle(1.2), warm.y).converged
    other = sqp.warm_start(PUBLISHED["7"].program, replace(at, lam=np.zeros(4)), SqpOptions())
    assert len(other.lam) == 1
