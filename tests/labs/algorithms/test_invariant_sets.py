"""Admissible, invariant and feasible sets: against simulation on a grid, linear programmes over
whole trajectories, an independent library, and what Borrelli, Bemporad and Morari ("Predictive
Control", 10) print of their examples."""

import numpy as np
import polytope
import pytest
from scipy.optimize import linprog

from labs.algorithms import admissible_set, invariant_sets
from labs.algorithms.admissible_set import closed_loop_limits, maximal_output_admissible_set
from labs.algorithms.invariant_sets import (
    backward_reachable,
    control_invariance_violation,
    feasible_sets,
    inclusion_violation,
    maximal_control_invariant_set,
    positive_invariance_violation,
)
from labs.algorithms.polygons import area, polyhedron_from_vertices, vertices
from labs.algorithms.polytopes import remove_redundant_rows
from labs.algorithms.riccati import steady_state
from labs.errors import LabError
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import Polyhedron, box
from labs.resumable import run_to_completion

DT = 0.1
CART = np.array([[1.0, DT], [0.0, 1.0]]), np.array([[DT * DT / 2.0], [DT]])
UNSTABLE = np.array([[1.05, 0.1], [0.2, 1.05]]), np.array([[0.005], [0.1]])
DELAY = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.5], [1.0]])
SYSTEMS = {"cart": CART, "unstable": UNSTABLE, "singular": DELAY}
X, U = box([-1.0, -1.5], [1.0, 1.5]), box([-1.0], [1.0])
GRID = np.stack(np.meshgrid(np.linspace(-1.1, 1.1, 45), np.linspace(-1.6, 1.6, 45)), axis=-1)
EVERYWHERE = Polyhedron(np.zeros((0, 2)), np.zeros(0))
ORIGIN, STILL = box([0.0, 0.0], [0.0, 0.0]), box([-1.0, 0.0], [1.0, 0.0])


def closed_loop_constraints(name: str) -> tuple[np.ndarray, Polyhedron]:
    """A + B K and the limits under u = K x."""
    A, B = SYSTEMS[name]
    K = steady_state(A, B, np.diag([100.0, 1.0]), np.eye(1)).gain
    return A + B @ K, closed_loop_limits(K, X, U)


def mpc(
    name: str,
    N: int,
    terminal: Polyhedron | None,
    c: np.ndarray | None = None,
    margins: tuple[np.ndarray, np.ndarray] | None = None,
) -> LinearMpcProblem:
    A, B = SYSTEMS[name]
    tight = margins or (None, None)
    weights = np.eye(2), np.eye(1), np.eye(2)
    return LinearMpcProblem(
        N, A, B, *weights, X, U, terminal, c, state_margins=tight[0], control_margins=tight[1]
    )


def feasible(problem: LinearMpcProblem, x: np.ndarray) -> bool:
    """Whether some u_0 ... u_(N-1) keep all limits, by one linear programme over them."""
    n, m, N = problem.n, problem.m, problem.N
    from_u, state = np.zeros((n, N * m)), x
    drift = np.zeros(n) if problem.c is None else problem.c
    H, h = [], []
    for k in range(N + 1):
        allowed = problem.state_set if k < N else problem.terminal_set or EVERYWHERE
        less = 0.0 if problem.state_margins is None or k == N else problem.state_margins[k]
        H.append(allowed.H @ from_u)
        h.append(allowed.h - less - allowed.H @ state)
        if k == N:
            break
        own = np.zeros((len(problem.control_set.h), N * m))
        own[:, k * m : (k + 1) * m] = problem.control_set.H
        H.append(own)
        less = 0.0 if problem.control_margins is None else problem.control_margins[k]
        h.append(problem.control_set.h - less)
        state, from_u = problem.A @ state + drift, problem.A @ from_u
        from_u[:, k * m : (k + 1) * m] += problem.B
    programme = linprog(np.zeros(N * m), np.vstack(H), np.concatenate(h), bounds=(None, None))
    return bool(programme.status == 0)


def off_boundary(polyhedron: Polyhedron, points: np.ndarray) -> np.ndarray:
    """Which points are in, or out, by more than the solvers' tolerances."""
    sure = polyhedron.contains(points, -1e-6) | ~polyhedron.contains(points, 1e-6)
    return np.asarray(sure)


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_admissible_set_is_what_simulation_finds(name: str) -> None:
    A, limits = closed_loop_constraints(name)
    found = maximal_output_admissible_set(A, limits)
    assert found.found
    x, kept = GRID, np.ones(GRID.shape[:-1], bool)
    for _ in range(300):
        kept &= limits.contains(x)
        x = x @ A.T
    sure = off_boundary(found.set, GRID)
    assert (found.set.contains(GRID) == kept)[sure].all()
    assert 0 < kept.sum() < kept.size
    assert sure.mean() > 0.95
    assert positive_invariance_violation(A, found.set) <= 1e-9
    assert inclusion_violation(found.set, limits) <= 1e-12


@pytest.mark.parametrize("name", SYSTEMS)
def test_linear_programmes_step_by_step_find_what_clipping_does(name: str) -> None:
    A, limits = closed_loop_constraints(name)
    quick = maximal_output_admissible_set(A, limits)
    at = admissible_set.init(limits)
    steps, cut = 0, []
    while not at.done:
        cut.append(area(vertices(at.set)))
        at = run_to_completion(admissible_set.resumable_step(A, limits, at))
        steps += 1
        # J_i* > 0 is what takes a piece of the set away.
        shrinks = area(vertices(at.set)) < cut[-1] - 1e-12
        assert shrinks == (at.J > admissible_set.TOLERANCE).any() == (not at.done)
    assert at.found
    assert at.t == quick.t == steps - 1
    assert np.abs(at.J - quick.J).max() <= 1e-7
    assert inclusion_violation(at.set, quick.set) <= 1e-9
    assert inclusion_violation(quick.set, at.set) <= 1e-9


def test_what_has_no_admissible_set_says_so() -> None:
    with pytest.raises(LabError, match="origin breaks a limit"):
        admissible_set.init(box([0.5, -1.0], [1.0, 1.0]))
    growing = maximal_output_admissible_set(1.01 * np.eye(2), X)
    assert not growing.found
    assert "spectral radius is 1.01" in growing.done
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])  # stable, and it does end
    assert maximal_output_admissible_set(turn, X).found


def test_an_unbounded_limit_and_three_dimensions() -> None:
    A = np.array([[0.8, 0.5, 0.0], [-0.5, 0.8, 0.1], [0.0, 0.0, 0.5]])
    limits = box([-1.0, -np.inf, -np.inf], [1.0, np.inf, np.inf])  # of an observable output alone
    found = maximal_output_admissible_set(A, limits)
    assert found.found
    assert found.t >= 2
    x = np.random.default_rng(0).uniform(-3.0, 3.0, (2000, 3))
    inside, kept = found.set.contains(x), np.ones(2000, bool)
    sure = off_boundary(found.set, x)
    for _ in range(200):
        kept &= limits.contains(x)
        x = x @ A.T
    assert (inside == kept)[sure].all()
    assert 0 < kept.sum() < 2000


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("terminal", [None, ORIGIN, STILL, "admissible"])
def test_the_feasible_set_is_where_a_linear_programme_finds_controls(
    name: str, terminal: Polyhedron | str | None
) -> None:
    if isinstance(terminal, str):
        terminal = maximal_output_admissible_set(*closed_loop_constraints(name)).set
    problem = mpc(name, 5, terminal)
    sets = feasible_sets(problem)
    assert len(sets) == 6
    points = GRID[3::6, 3::6].reshape(-1, 2)
    sure = off_boundary(sets[0], points)
    told = [feasible(problem, x) for x in points[sure]]
    assert sets[0].contains(points[sure]).tolist() == told
    if terminal is not None and terminal is not STILL:
        for i in range(5):  # what is invariant can be reached from all that was reached later
            assert inclusion_violation(sets[i + 1], sets[i]) <= 1e-9
        assert control_invariance_violation(*SYSTEMS[name], U, sets[0]) <= 1e-9


def test_drift_and_tightened_limits_count() -> None:
    rng = np.random.default_rng(7)
    margins = rng.uniform(0.0, 0.1, (4, 4)), rng.uniform(0.0, 0.1, (4, 2))
    problem = mpc("unstable", 4, box([-0.2, -0.2], [0.3, 0.3]), np.array([0.02, -0.03]), margins)
    first = feasible_sets(problem)[0]
    points = GRID[::6, ::6].reshape(-1, 2)
    sure = off_boundary(first, points)
    told = [feasible(problem, x) for x in points[sure]]
    assert first.contains(points[sure]).tolist() == told
    assert 0 < sum(told) < len(told)
    plain = feasible_sets(mpc("unstable", 4, problem.terminal_set, problem.c))[0]
    assert area(vertices(first)) < area(vertices(plain))


def test_sums_in_the_plane_and_shadows_of_a_polyhedron_agree() -> None:
    """The second is what is used where controls or the target are unbounded."""
    far = box([-1e3], [1e3])
    for A, B in SYSTEMS.values():
        target = maximal_control_invariant_set(A, B, X, U).set
        n, m = B.shape
        both = target.preimage(np.hstack([A, B])).intersection(X.preimage(np.eye(n, n + m)))
        both = both.intersection(U.preimage(np.eye(m, n + m, k=n)))
        shadow = polytope.projection(polytope.Polytope(both.H, both.h), [1, 2])
        expected = Polyhedron(np.asarray(shadow.A), np.asarray(shadow.b))
        summed = backward_reachable(A, B, X, U, target)
        assert (
            max(inclusion_violation(expected, summed), inclusion_violation(summed, expected))
            <= 1e-7
        )
        free = backward_reachable(A, B, X, Polyhedron(np.zeros((0, 1)), np.zeros(0)), target)
        nearly = backward_reachable(A, B, X, far, target)
        assert max(inclusion_violation(free, nearly), inclusion_violation(nearly, free)) <= 1e-7


def test_input_limits_alone_leave_the_whole_plane() -> None:
    sets = feasible_sets(LinearMpcProblem(4, *CART, np.eye(2), np.eye(1), np.eye(2), EVERYWHERE, U))
    assert [len(each.h) for each in sets] == [0] * 5
    nowhere = box([1.0], [-1.0])
    assert len(vertices(backward_reachable(*CART, X, nowhere, X))) == 0


@pytest.mark.parametrize("name", ["cart", "unstable"])
def test_the_maximal_control_invariant_set_holds_all_others(name: str) -> None:
    A, B = SYSTEMS[name]
    largest = maximal_control_invariant_set(A, B, X, U)
    assert largest.found
    assert control_invariance_violation(A, B, U, largest.set) <= 2e-9
    admissible = maximal_output_admissible_set(*closed_loop_constraints(name)).set
    sets = feasible_sets(mpc(name, 40, admissible))
    for each in sets[::10]:
        assert inclusion_violation(each, largest.set) <= 1e-7
    assert area(vertices(sets[0])) == pytest.approx(area(vertices(largest.set)), rel=0.01)
    assert control_invariance_violation(A, B, U, X) > 0.1


def test_nothing_is_left_where_no_control_keeps_it_in() -> None:
    windy = maximal_control_invariant_set(*CART, X, U, np.array([0.0, 0.2]))
    assert not windy.found
    assert "from no state can it stay" in windy.done


def test_the_examples_of_borrelli_bemporad_and_morari() -> None:
    around = box([-10.0, -10.0], [10.0, 10.0])
    found = maximal_output_admissible_set(np.array([[0.5, 0.0], [1.0, -0.5]]), around)
    rows = remove_redundant_rows(found.set)
    printed = [[1, 0, 10], [0, 1, 10], [-1, 0, 10], [0, -1, 10], [1, -0.5, 10], [-1, 0.5, 10]]
    scaled = np.c_[rows.H, rows.h] / np.abs(rows.H).max(axis=1, keepdims=True)
    assert sorted(scaled.round(9).tolist()) == sorted(np.asarray(printed, float).tolist())
    assert found.t == 1

    A, B = np.array([[1.5, 0.0], [1.0, -1.5]]), np.array([[1.0], [0.0]])
    largest = maximal_control_invariant_set(A, B, around, box([-5.0], [5.0]))
    H = np.array([[0.0, 1.0], [0.0, -1.0], [0.5547, -0.83205], [-0.5547, 0.83205]])
    expected = Polyhedron(H, np.array([4.0, 4.0, 2.2188, 2.2188]))  # printed: 4, 4, 2.22, 2.22
    assert (
        max(inclusion_violation(largest.set, expected), inclusion_violation(expected, largest.set))
        <= 1e-3
    )
    assert invariant_sets.init(around).set is around
    assert polyhedron_from_vertices(vertices(largest.set)).contains(np.array([9.9, 3.95]))
