"""Linear MPC over its horizon: condensed and sparse, and where they cross."""

import numpy as np
from scipy.linalg import expm

from labs.algorithms import mpc
from labs.algorithms.linear_mpc import LinearPlanner, QpForm
from labs.algorithms.mpc import MpcOptions
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import box
from labs.problems.receding_horizon import Plan
from labs.resumable import run_to_completion

HORIZONS = (5, 10, 20, 50, 100, 200)
PERIODS = 6
MASSES = (1, 3)
T, LIMIT = 0.1, 0.15
"""Period [s]; the most that a force may be [N], so little that most are at it for long."""


def over_the_horizon() -> None:
    """For N from 5 to 200 a QP of either form, in wall-clock time, the mean over PERIODS periods
    of a closed loop: cold and, as the condensed form may, started at the plan before."""
    for masses in MASSES:
        print(f"{2 * masses} states, {masses} controls: ms of a QP")
        print("    N   active   condensed cold        warm      sparse    difference")
        rows = []
        for N in HORIZONS:
            problem, x = _chain(masses, N)
            cold, U, active = _loop(problem, x, "condensed", warm=False)
            warm, _, _ = _loop(problem, x, "condensed", warm=True)
            sparse, V, _ = _loop(problem, x, "sparse", warm=False)
            rows.append((N, cold, warm, sparse))
            apart = float(np.abs(U - V).max())
            print(f"{N:5d} {active:8d} {cold:16.3f} {warm:11.3f} {sparse:11.3f} {apart:13.1e}")
        _summary(np.array(rows))


def _chain(masses: int, N: int) -> tuple[LinearMpcProblem, np.ndarray]:
    """Masses of 1 kg in a row, between springs of 1 N/m, a force on each; out of their rest by
    1 m in turns."""
    eye, none = np.eye(masses), np.zeros((masses, masses))
    springs = np.eye(masses, k=1) + np.eye(masses, k=-1) - 2.0 * eye
    rate = np.block([[none, eye, none], [springs, none, eye], [none, none, none]])
    both = expm(T * rate)[: 2 * masses]
    start = np.concatenate([np.resize([1.0, -1.0], masses), np.zeros(masses)])
    problem = LinearMpcProblem(
        N=N,
        A=both[:, : 2 * masses],
        B=both[:, 2 * masses :],
        Q=np.eye(2 * masses),
        R=0.01 * eye,
        Q_f=10.0 * np.eye(2 * masses),
        state_set=box(np.full(2 * masses, -5.0), np.full(2 * masses, 5.0)),
        control_set=box(np.full(masses, -LIMIT), np.full(masses, LIMIT)),
    )
    return problem, start


def _loop(
    problem: LinearMpcProblem, x: np.ndarray, form: QpForm, warm: bool
) -> tuple[float, np.ndarray, int]:
    """The mean time of a QP [ms], the controls (PERIODS, m), and how many limits are active at
    first."""
    planner, options = LinearPlanner(problem, form), MpcOptions()
    guess: Plan | None = None
    times, controls, active = [], [], []
    for _ in range(PERIODS):
        plan = run_to_completion(planner.plan(x, guess if warm else None))
        assert plan.found, plan.message
        times.append(1e3 * plan.seconds["QP"])
        controls.append(plan.U[0])
        active.append(sum(int(rows.sum()) for rows in plan.active.values()))
        x = problem.step(x, plan.U[0])
        guess = mpc.shift_plan(plan, 1, problem.step, options)
    return float(np.mean(times[1:])), np.array(controls), active[0]


def _summary(rows: np.ndarray) -> None:
    """How the times grow, and from which N on the sparse form is faster."""
    N, cold, warm, sparse = rows.T
    last = np.log(rows[-3:])
    slopes = [np.polyfit(last[:, 0], last[:, column], 1)[0] for column in (1, 2, 3)]
    print(f"  grows as N to the {slopes[0]:.1f}, {slopes[1]:.1f} and {slopes[2]:.1f}, at the end")
    for word, condensed in (("cold", cold), ("warm", warm)):
        slower = np.flatnonzero(condensed > sparse)
        if not len(slower):
            print(f"  {word}, the condensed form is faster throughout")
            continue
        k = int(slower[0])
        if k == 0:
            print(f"  {word}, the sparse form is faster throughout")
            continue
        gap = np.log(condensed / sparse)[k - 1 : k + 1]
        crossing = np.exp(np.interp(0.0, gap, np.log(N[k - 1 : k + 1])))
        print(f"  {word}, they cross at N = {crossing:.0f}")
