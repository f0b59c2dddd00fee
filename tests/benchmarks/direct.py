"""What SQP on a collocated problem costs: iterations and time beside Ipopt's on the same one, an
iteration on a UR5 as a multiple of the derivatives it cannot do without, and growth with N."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from statistics import median
from time import perf_counter

import numpy as np

from labs.algorithms import sqp
from labs.algorithms.collocation import Collocation
from labs.algorithms.sqp import SqpIterate, SqpOptions
from labs.models.mechanisms import mechanism
from labs.problems.continuous_control import ContinuousProblem
from labs.tasks.motion.continuous import MotionLimits, continuous_motion
from tests.benchmarks.timing import ROUNDS, bare_calls
from tests.labs.algorithms.collocation_oracle import ipopt
from tests.labs.algorithms.transcriptions import straight_guess

N = 100
SCHEME = "trapezoidal"
GAUSS_NEWTON = SqpOptions("gauss-newton")
LATE = 1e-5
"""KKT residual of a late iteration."""
PHASES = ("derivatives", "QP", "line search")
CASES: tuple[tuple[str, str, float, float], ...] = (
    ("pendulum", "weighted", 2.0, np.inf),
    ("pendulum", "weighted", 2.0, 0.6),
    ("pendulum", "least-energy", 2.0, 1.0),
    ("double-pendulum", "weighted", 2.0, np.inf),
    ("double-pendulum", "weighted", 2.0, 0.6),
    ("cart-pole", "weighted", 2.0, np.inf),
    ("cart-pole", "weighted", 2.0, 0.6),
    ("cart-pole", "least-energy", 2.0, 1.0),
)
"""Motion, objective, T [s] and the limit of u in parts of its size."""


def beside_ipopt() -> None:
    """Iterations to 1e-6 of the cost that both end at: at most 1.5 times Ipopt's."""
    print("                                     cost   iterations    ratio       ms    (Ipopt)")
    ratios = []
    for name, objective, T, limit in CASES:
        problem = continuous_motion(name, objective, T, limits=MotionLimits(control=limit))
        guess = straight_guess(problem, N)
        theirs = ipopt(problem, N, SCHEME, guess.X, guess.U)
        program = Collocation(problem, N, SCHEME)
        y = program.variables(guess.X, guess.U)
        begun = perf_counter()
        ours = sqp.solve(program, y)
        seconds = perf_counter() - begun
        found = "" if ours.converged else "  " + ours.stopped
        same = abs(ours.values.f - theirs.cost) <= 1e-6 * abs(theirs.cost)
        if ours.converged and theirs.success and not same:
            found = f"  another minimum than Ipopt's {theirs.cost:.6g}"
        ratio = ours.iteration / theirs.iterations
        ratios.append(ratio)
        what = f"{name}, {objective}, |u| <= {limit:g} u_0"
        print(
            f"{what:44} {ours.values.f:9.6f} {ours.iteration:4} {theirs.iterations:4} {ratio:9.2f} "
            f"{seconds * 1e3:9.0f} {theirs.seconds * 1e3:9.0f}{found}"
        )
    print(f"largest ratio {max(ratios):.2f}, median {median(ratios):.2f}")


def reach(steps: int) -> ContinuousProblem:
    """The UR5 to a target in half a second, with limits of v and u active."""
    limits = MotionLimits(velocity=1.6, control=0.4)
    target = np.array([0.4, -0.35, 0.25])
    return continuous_motion("ur5", "weighted", 0.5, limits=limits, target=target)


def iteration(program: Collocation, at: SqpIterate) -> tuple[dict[str, float], float]:
    """[s] of each phase and of all, the least of many times the same iteration by Gauss-Newton."""
    times, found = [], []
    for _ in range(ROUNDS):
        begun = perf_counter()
        found.append(sqp.step(program, GAUSS_NEWTON, at))
        times.append(perf_counter() - begun)
    return {phase: min(f.seconds[phase] for f in found) for phase in PHASES}, min(times)


def second_program(steps: int) -> tuple[Collocation, SqpIterate]:
    """The programme, where its second iteration begins."""
    problem = reach(steps)
    program, guess = Collocation(problem, steps, SCHEME), straight_guess(problem, steps)
    at = sqp.init(program, program.variables(guess.X, guess.U), GAUSS_NEWTON)
    return program, sqp.step(program, GAUSS_NEWTON, at)


def on_the_ur5() -> None:
    """Gauss-Newton, N = 100: an iteration at most 11 times its bare derivative calls; one near the
    solution, where the QP is solved to the last digit, its active set known; and all of them."""
    ur5 = mechanism("ur5")
    calls = bare_calls(ur5, N + 1)
    print(f"{N + 1} aba + computeABADerivatives {calls * 1e3:7.2f} ms    1.00")
    program, at = second_program(N)
    for name in ("second", "late"):
        phases, whole = iteration(program, at)
        for phase, spent in phases.items():
            print(f"{phase:31} {spent * 1e3:7.2f} ms {spent / calls:7.2f}")
        print(f"the {name} iteration {whole * 1e3:24.2f} ms {whole / calls:7.2f}")
        while at.optimality and at.optimality.residual > LATE:
            at = sqp.step(program, GAUSS_NEWTON, at)
    _, at = second_program(N)
    ratios = []
    while not at.stopped:
        ratios.append(iteration(program, at)[1] / calls)
        at = sqp.step(program, GAUSS_NEWTON, at)
    print(f"all {at.iteration}: median {median(ratios):.2f}, at most {max(ratios):.2f}")
    print(f"{int((at.nu != 0.0).sum())} bounds active at the solution")
    print("    N      ms   us a step   of the bare calls")
    for steps in (25, 50, 100, 200, 400):
        _, whole = iteration(*second_program(steps))
        ratio = whole / bare_calls(ur5, steps + 1)
        print(f"{steps:5} {whole * 1e3:7.2f} {whole / steps * 1e6:11.1f} {ratio:19.2f}")
