"""Problems of linear MPC, and an oracle: the same QP put together anew and solved by quadprog."""

from dataclasses import replace

import numpy as np
from qpsolvers import Problem, solve_problem

from labs.algorithms.riccati import steady_state_by_scipy
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import Polyhedron, box

DOUBLE_INTEGRATOR = LinearMpcProblem(
    N=10,
    A=np.array([[1.0, 0.2], [0.0, 1.0]]),
    B=np.array([[0.02], [0.2]]),
    Q=np.diag([1.0, 0.1]),
    R=np.array([[0.1]]),
    Q_f=np.zeros((2, 2)),
    state_set=box([-2.0, -0.8], [2.0, 0.8]),
    control_set=box([-1.0], [1.0]),
)


def riccati(problem: LinearMpcProblem) -> tuple[np.ndarray, np.ndarray]:
    """P and K of the problem's matrices."""
    found = steady_state_by_scipy(problem.A, problem.B, problem.Q, problem.R)
    return found.value, found.gain


def with_riccati(problem: LinearMpcProblem) -> LinearMpcProblem:
    """The same with Q_f = P."""
    return replace(problem, Q_f=riccati(problem)[0])


def random_problem(rng: np.random.Generator) -> LinearMpcProblem:
    """All that a problem may have: n up to 4, m up to 2, N up to 12, a drift, references, linear
    costs, a skew row in each set, margins and a terminal box."""
    n, m, N = int(rng.integers(1, 5)), int(rng.integers(1, 3)), int(rng.integers(1, 13))
    A = rng.standard_normal((n, n))
    A *= rng.uniform(0.5, 1.15) / np.abs(np.linalg.eigvals(A)).max()
    X, U = (
        box(-rng.uniform(1, 3, n), rng.uniform(1, 3, n)),
        box(-np.ones(m), rng.uniform(0.5, 1, m)),
    )
    X = X.intersection(Polyhedron(rng.standard_normal((1, n)), np.ones(1)))
    return LinearMpcProblem(
        N=N,
        A=A,
        B=rng.standard_normal((n, m)),
        Q=_definite(rng, n),
        R=_definite(rng, m),
        Q_f=_definite(rng, n),
        state_set=X,
        control_set=U,
        terminal_set=box(-np.ones(n), np.ones(n)) if rng.random() < 0.5 else None,
        c=0.1 * rng.standard_normal(n),
        x_ref=0.5 * rng.standard_normal((N + 1, n)),
        u_ref=0.5 * rng.standard_normal((N, m)),
        q=0.2 * rng.standard_normal(n),
        r=0.2 * rng.standard_normal(m),
        state_margins=np.linspace(0.0, 0.2, N)[:, None] * np.ones(len(X.h)),
        control_margins=np.linspace(0.0, 0.1, N)[:, None] * np.ones(len(U.h)),
    )


def by_quadprog(
    problem: LinearMpcProblem, x: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray] | None:
    """V*_N, X and U, in the variables x_0 ... x_N, u_0 ... u_(N-1); None where infeasible."""
    n, m, N = problem.n, problem.m, problem.N
    size, first_u = (N + 1) * n + N * m, (N + 1) * n
    xr = np.broadcast_to(0.0 if problem.x_ref is None else problem.x_ref, (N + 1, n))
    ur = np.broadcast_to(0.0 if problem.u_ref is None else problem.u_ref, (N, m))
    P, p, constant = np.zeros((size, size)), np.zeros(size), 0.0
    G: list[np.ndarray] = []
    h: list[np.ndarray] = []
    E, e = [np.eye(n, size)], [x]
    for k in range(N + 1):
        at = slice(k * n, (k + 1) * n)
        W = problem.Q if k < N else problem.Q_f
        P[at, at], p[at] = W, -W @ xr[k]
        constant += xr[k] @ W @ xr[k] / 2
        limits = problem.state_set if k < N else problem.terminal_set
        if limits is not None:
            rows = np.zeros((len(limits.h), size))
            rows[:, at] = limits.H
            margins = problem.state_margins if k < N else None
            G, h = [*G, rows], [*h, limits.h - (0.0 if margins is None else margins[k])]
        if k == N:
            break
        if problem.q is not None:
            p[at] += problem.q
        ut = slice(first_u + k * m, first_u + (k + 1) * m)
        P[ut, ut], p[ut] = problem.R, -problem.R @ ur[k] + (0.0 if problem.r is None else problem.r)
        constant += ur[k] @ problem.R @ ur[k] / 2
        rows = np.zeros((len(problem.control_set.h), size))
        rows[:, ut] = problem.control_set.H
        margin = 0.0 if problem.control_margins is None else problem.control_margins[k]
        G, h = [*G, rows], [*h, problem.control_set.h - margin]
        rows = np.zeros((n, size))
        rows[:, at], rows[:, ut], rows[:, (k + 1) * n : (k + 2) * n] = (
            problem.A,
            problem.B,
            -np.eye(n),
        )
        E, e = [*E, rows], [*e, np.zeros(n) if problem.c is None else -problem.c]
    # quadprog takes a definite matrix; where Q_f is not, what is added costs less than 1e-9.
    P += 1e-11 * np.eye(size)
    qp = Problem(P, p, np.vstack(G), np.concatenate(h), np.vstack(E), np.concatenate(e))
    found = solve_problem(qp, "quadprog")
    if not found.found or found.x is None:
        return None
    z = np.asarray(found.x)
    value = float(z @ P @ z / 2 + p @ z + constant)
    return value, z[:first_u].reshape(N + 1, n), z[first_u:].reshape(N, m)


def _definite(rng: np.random.Generator, size: int) -> np.ndarray:
    root = rng.standard_normal((size, size))
    return np.asarray(root @ root.T + 0.1 * np.eye(size))
