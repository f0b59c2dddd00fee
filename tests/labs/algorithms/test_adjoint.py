"""The gradient by the adjoint recursion, against finite differences of whole rollouts."""

import numpy as np
import pytest

from labs.algorithms.adjoint import gradient_norm
from labs.problems.optimal_control import OptimalControlProblem, expand
from labs.resumable import run_to_completion
from tests.labs.problems.random_problem import random_problem, simulate

RNG = np.random.default_rng(4)


@pytest.mark.parametrize("name", ["cart-pole", "ur5"])
def test_the_gradient_by_the_adjoint_is_that_of_finite_differences(name: str) -> None:
    p, eps = random_problem(RNG, name), 1e-6
    U = RNG.normal(size=(6, p.dynamics.nu))
    X, _, _ = simulate(p, U)
    slopes = np.empty_like(U)
    for index in np.ndindex(U.shape):
        moved = U.copy()
        moved[index] += eps
        ahead = simulate(p, moved)[2]
        moved[index] -= 2 * eps
        slopes[index] = (ahead - simulate(p, moved)[2]) / (2 * eps)
    found = gradient_norm(p, run_to_completion(expand(p, X, U, second_order=False)), U)
    assert found == pytest.approx(np.abs(slopes).max(), rel=1e-6)


def test_a_gradient_that_pushes_against_the_bound_does_not_count() -> None:
    p = random_problem(RNG, "pendulum", N=1)
    U = np.array([[0.0]])
    X, _, J = simulate(p, U)
    downhill = -np.sign(simulate(p, U + 1e-4)[2] - J)
    U[0, 0] = downhill * 1e-3
    X, U, _ = simulate(p, U)
    expansion = run_to_completion(expand(p, X, U, second_order=False))
    free = gradient_norm(p, expansion, U)
    bounded = OptimalControlProblem(p.dynamics, p.cost, p.x0, 1, bound=np.array([1e-3]))
    wider = OptimalControlProblem(p.dynamics, p.cost, p.x0, 1, bound=np.array([2e-3]))
    assert free > 0.0
    assert gradient_norm(wider, expansion, U) == free
    assert gradient_norm(bounded, expansion, U) == 0.0
