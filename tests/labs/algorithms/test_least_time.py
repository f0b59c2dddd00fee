"""The least time of a swing-up, by all direct methods: found from plain guesses of motion and
time, where a model that is linear in T would leap to the shortest time allowed."""

import numpy as np
import pytest

from labs.algorithms import sqp
from labs.algorithms.collocation import Collocation
from labs.algorithms.multiple_shooting import MultipleShooting
from labs.algorithms.single_shooting import SingleShooting
from labs.problems.continuous_control import ContinuousProblem
from labs.tasks.motion.continuous import MotionLimits, continuous_motion
from tests.labs.algorithms.collocation_oracle import ipopt
from tests.labs.algorithms.transcriptions import straight_guess

N = 12


def swing_up(name: str, limit: float, T: float) -> ContinuousProblem:
    """With |u| <= limit u_0; T [s] is the first guess of its time."""
    limits = MotionLimits(control=limit)
    return continuous_motion(name, "least-time", T, limits=limits, T_limits=(0.2, 6.0))


@pytest.mark.parametrize("guess", ["line", "still"])
@pytest.mark.parametrize("T", [2.0, 4.0])
def test_it_is_found_from_plain_guesses(T: float, guess: str) -> None:
    problem = swing_up("pendulum", 0.6, T)
    X, U = initial_guess(problem, guess)
    by_states = collocation_time(problem, X, U)
    multiple = MultipleShooting(problem, N, 5, 2)
    by_segments = sqp.solve(multiple, multiple.variables(X, U, T))
    assert by_segments.converged, by_segments.stopped
    single = SingleShooting(problem, N, 2)
    in_one = sqp.solve(single, single.pack(U, T))
    assert in_one.converged, in_one.stopped
    assert in_one.y[-1] == pytest.approx(by_segments.y[-1], rel=1e-6)
    assert in_one.y[-1] == pytest.approx(by_states, rel=0.02)


@pytest.mark.parametrize("limit", [0.6, 1.0])
def test_so_is_that_of_the_cart_pole(limit: float) -> None:
    times = []
    for T, guess in ((1.5, "still"), (3.0, "line")):
        problem = swing_up("cart-pole", limit, T)
        times.append(collocation_time(problem, *initial_guess(problem, guess)))
    assert times[0] == pytest.approx(times[1], rel=1e-6)


def initial_guess(problem: ContinuousProblem, guess: str) -> tuple[np.ndarray, np.ndarray]:
    """X (N + 1, nx) on a line to the goal, or still; without a control."""
    X = straight_guess(problem, N).X if guess == "line" else np.tile(problem.x0, (N + 1, 1))
    return X, np.zeros((N, 1))


def collocation_time(problem: ContinuousProblem, X: np.ndarray, U: np.ndarray) -> float:
    """The least time [s] by collocation from there, which is Ipopt's."""
    program = Collocation(problem, N)
    at = sqp.solve(program, program.variables(X, U))
    assert at.converged, at.stopped
    _, found, used = program.trajectory(at.y)
    wanted = ipopt(problem, N, "midpoint", found, used, warm=True)
    assert wanted.success
    assert at.y[-1] == pytest.approx(wanted.T, rel=1e-6)
    return float(at.y[-1])
