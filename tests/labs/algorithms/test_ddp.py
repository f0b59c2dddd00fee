"""DDP against Riccati, Ipopt, finite differences, and the orders of convergence theory gives."""

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
import pytest

from labs.algorithms import ddp
from labs.algorithms.ddp import DdpOptions
from labs.algorithms.ddp_sweep import backward_pass
from labs.errors import LabError
from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import mechanism
from labs.problems.optimal_control import OptimalControlProblem, expand, rollout
from labs.resumable import run_to_completion
from labs.tasks.motion.cost import MotionCost, TipCost
from tests.labs.algorithms.ipopt_oracle import inverse_dynamics, optimum, tip_position

UPRIGHT = {"pendulum": [np.pi, 0.0], "cart-pole": [0.0, np.pi, 0.0, 0.0]}
UPRIGHT["double-pendulum"] = [np.pi, 0.0, 0.0, 0.0]
METHODS = {"pendulum": "rk4", "cart-pole": "rk4"}


def swing_up(name: str, N: int = 60, h: float = 0.025, r: float = 0.1) -> OptimalControlProblem:
    m = mechanism(name)
    n = m.nq
    Q = np.diag([0.1] * n + [0.01] * n) * h
    final = np.diag([100.0] * n + [10.0] * n)
    R = r * h * np.eye(m.nu)
    cost = MotionCost(N, Q, R, final, np.array(UPRIGHT[name]), np.zeros(m.nu))
    plant = DiscreteMechanism(m, h, METHODS.get(name, "semi-implicit-euler"))
    return OptimalControlProblem(plant, cost, np.zeros(2 * n), N)


def reach(N: int = 40, h: float = 0.02) -> tuple[OptimalControlProblem, np.ndarray]:
    m = mechanism("ur5")
    x0, holding = np.r_[m.arm.home, np.zeros(6)], m.equilibrium_control(m.arm.home)
    cost = MotionCost(
        N,
        np.diag([0.0] * 6 + [0.01] * 6) * h,
        np.diag(m.control_limit**-2) * h,
        np.diag([0.0] * 6 + [10.0] * 6),
        np.zeros(12),
        holding,
        TipCost(m, np.array([0.4, 0.4, 0.5]), 100.0),
    )
    return OptimalControlProblem(DiscreteMechanism(m, h), cost, x0, N), np.tile(holding, (N, 1))


def guess(problem: OptimalControlProblem) -> np.ndarray:
    return np.full((problem.N, problem.dynamics.nu), 0.1)


# A linear-quadratic problem -------------------------------------------------------------------


@dataclass(frozen=True)
class Linear:
    """x+ = A x + B u."""

    A: np.ndarray
    B: np.ndarray

    @property
    def nx(self) -> int:
        return len(self.A)

    @property
    def nu(self) -> int:
        return int(self.B.shape[1])

    def step(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        after: np.ndarray = self.A @ x + self.B @ u
        return after

    def linearize(self, X: np.ndarray, U: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        N = len(U)
        after = X[:N] @ self.A.T + U @ self.B.T
        return after, np.tile(self.A, (N, 1, 1)), np.tile(self.B, (N, 1, 1))


def linear_quadratic(N: int = 30) -> OptimalControlProblem:
    rng = np.random.default_rng(3)
    A, B = np.eye(4) + 0.2 * rng.normal(size=(4, 4)), rng.normal(size=(4, 2))
    cost = MotionCost(N, np.eye(4), np.diag([0.5, 2.0]), 5.0 * np.eye(4), np.zeros(4), np.zeros(2))
    return OptimalControlProblem(Linear(A, B), cost, rng.normal(size=4), N)


def riccati(p: OptimalControlProblem) -> tuple[np.ndarray, np.ndarray]:
    """Gains and values by the notes' recursion, written out."""
    A, B = p.dynamics.A, p.dynamics.B  # type: ignore[attr-defined]
    Q, R, P = p.cost.Q, p.cost.R, p.cost.Q_f  # type: ignore[attr-defined]
    gains, values = [], [P]
    for _ in range(p.N):
        K = -np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
        P = Q + A.T @ P @ A + A.T @ P @ B @ K
        gains.append(K)
        values.append(P)
    return np.array(gains[::-1]), np.array(values[::-1])


@pytest.mark.parametrize("second_order", [False, True])
def test_a_linear_quadratic_problem_takes_one_step_to_riccati(second_order: bool) -> None:
    p = linear_quadratic()
    options = DdpOptions(second_order=second_order)
    rng = np.random.default_rng(0)
    at = ddp.init(p, rng.normal(size=(30, 2)), options)
    once = ddp.step(p, options, at)
    gains, values = riccati(p)
    assert once.alpha == 1.0
    assert once.cost == pytest.approx(p.x0 @ values[0] @ p.x0, rel=1e-9)
    assert once.actual == pytest.approx(once.expected, rel=1e-9)
    np.testing.assert_allclose(once.K, gains, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(once.U, np.einsum("tij,tj->ti", gains, once.X[:-1]), atol=1e-9)
    again = ddp.step(p, options, once)
    assert again.converged
    assert "Converged after 2 iterations" in again.stopped
    assert again.gradient < 1e-9 * once.gradient


def test_the_expected_change_holds_for_every_alpha_where_the_model_is_exact() -> None:
    p, options = linear_quadratic(), DdpOptions()
    at = ddp.init(p, np.ones((30, 2)), options)
    model = run_to_completion(expand(p, at.X, at.U, second_order=False))
    w, K = np.empty_like(at.w), np.empty_like(at.K)
    none = np.empty((0, 0))
    where, d_1, d_2 = backward_pass(
        model.A, model.B, model.second, *model.cost, 0.0, none, none, w, K
    )
    assert where == -1
    for alpha in (1.0, 0.5, 0.1, -0.3):
        _, _, cost = rollout(p, at.X, at.U + alpha * w, K)
        assert cost - at.cost == pytest.approx(alpha * d_1 + 0.5 * alpha**2 * d_2, rel=1e-8)


# Against Ipopt ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["double-pendulum", "cart-pole", "ur5"])
def test_the_oracle_has_the_same_dynamics(name: str) -> None:
    m = mechanism(name, payload=0.4)
    q, v, a = np.random.default_rng(1).normal(size=(3, m.nq))
    found = np.array(inverse_dynamics(m.model)(q, v, a)).ravel()
    np.testing.assert_allclose(found, pin.rnea(m.model, m.data, q, v, a), atol=1e-12)
    np.testing.assert_allclose(np.array(tip_position(m)(q)).ravel(), m.tip(q), atol=1e-12)


def compare(problem: OptimalControlProblem, U: np.ndarray, options: DdpOptions) -> None:
    found = ddp.solve(problem, U, options)
    assert found.converged, found.stopped
    rng = np.random.default_rng(0)
    near_X = found.X + 0.02 * rng.normal(size=found.X.shape)
    near_U = found.U + 0.02 * np.abs(found.U).max() * rng.normal(size=found.U.shape)
    wanted = optimum(problem, near_X, near_U)
    assert found.cost == pytest.approx(wanted.cost, rel=1e-6)
    scale = np.abs(wanted.U).max()
    np.testing.assert_allclose(found.U, wanted.U, atol=2e-3 * scale)


@pytest.mark.parametrize("second_order", [False, True])
@pytest.mark.parametrize("name", UPRIGHT)
def test_swing_ups_cost_what_ipopt_finds(name: str, second_order: bool) -> None:
    p = swing_up(name)
    compare(p, guess(p), DdpOptions(second_order=second_order, iterations=2000))


@pytest.mark.parametrize("second_order", [False, True])
def test_a_reach_costs_what_ipopt_finds(second_order: bool) -> None:
    p, U = reach()
    compare(p, U, DdpOptions(second_order=second_order))


@pytest.mark.parametrize("name", ["pendulum", "double-pendulum"])
def test_limited_controls_cost_what_ipopt_finds(name: str) -> None:
    p = swing_up(name)
    limit = {"pendulum": [3.5], "double-pendulum": [5.0, 4.0]}[name]
    bounded = replace(p, bound=np.array(limit))
    options = DdpOptions(second_order=name == "pendulum", iterations=2000)
    compare(bounded, guess(p), options)
    found = ddp.solve(bounded, guess(p), options)
    assert np.abs(found.U).max(axis=0) == pytest.approx(limit, rel=1e-12), "the limits are reached"
    assert ddp.solve(p, guess(p), options).cost < found.cost


# Convergence ------------------------------------------------------------------------------------


def gradients(second_order: bool) -> np.ndarray:
    """Of the last iterations on the pendulum, from a start near the solution."""
    p = swing_up("pendulum")
    solved = ddp.solve(p, guess(p), DdpOptions(second_order=True))
    options = DdpOptions(second_order=second_order, tolerance=1e-26)
    at = ddp.init(p, solved.U + 1e-3, options)
    found: list[float] = []
    while len(found) < 12 and not at.stopped:
        at = ddp.step(p, options, at)
        found.append(at.gradient)
    return np.array(found)


def test_ddp_converges_quadratically_and_ilqr_linearly() -> None:
    """With e the gradient's norm, e+ = c e^2 shows as a slope of 2 of log e+ over log e; linear
    convergence as a constant ratio."""
    quadratic = gradients(second_order=True)
    above = quadratic[quadratic > 1e-12 * quadratic[0]]
    logs = np.log(above)
    slopes = np.diff(logs)[1:] / np.diff(logs)[:-1]
    assert 3 <= len(above) <= 5, "it is at rounding after as few iterations"
    assert 1.8 < slopes.max() < 2.5, slopes
    linear = gradients(second_order=False)
    ratios = linear[4:] / linear[3:-1]
    assert len(linear) == 12
    assert ratios.min() > 0.02, "it gains no digits faster than by a constant factor"
    assert ratios.max() < 0.9
    assert ratios.max() / ratios.min() < 1.5
    assert linear.min() > 1e-12 * linear[0], "it is not there yet"


def test_gains_are_the_derivative_of_the_optimal_control() -> None:
    p = swing_up("cart-pole", N=30)
    options = DdpOptions(second_order=True, iterations=1000, tolerance=1e-22)
    solved = ddp.solve(p, guess(p), options)
    assert solved.gradient < 1e-7
    for k in range(4):
        sides = []
        for sign in (1.0, -1.0):
            x0 = p.x0.copy()
            x0[k] += sign * 1e-4
            sides.append(ddp.solve(replace(p, x0=x0), solved.U, options).U[0])
        difference = (sides[0] - sides[1]) / 2e-4
        np.testing.assert_allclose(solved.K[0, :, k], difference, rtol=1e-4, atol=1e-4)


def test_the_cost_never_rises_and_the_ratio_is_at_least_c1() -> None:
    p = swing_up("pendulum")
    options = DdpOptions(c1=0.2, c2=0.5)
    at = ddp.init(p, guess(p), options)
    accepted = 0
    while not at.stopped:
        before, at = at, ddp.step(p, options, at)
        assert at.cost <= before.cost + 1e-14 * before.cost
        if at.alpha:
            accepted += 1
            assert at.actual == at.cost - before.cost
            assert at.actual / at.expected > 0.2
            assert at.mu >= before.mu or at.actual / at.expected >= 0.5
        else:
            assert at.cost == before.cost
    assert at.converged
    assert accepted > 5


def test_iterations_leave_what_went_before_alone() -> None:
    p, options = swing_up("pendulum"), DdpOptions()
    first = ddp.step(p, options, ddp.init(p, guess(p), options))
    kept = [first.X.copy(), first.U.copy(), first.K.copy(), first.w.copy()]
    for _ in range(3):
        ddp.step(p, options, first)
    second = ddp.step(p, options, first)
    assert second.iteration == 2
    for array, copy in zip((first.X, first.U, first.K, first.w), kept, strict=True):
        np.testing.assert_array_equal(array, copy)


# When it cannot go on ---------------------------------------------------------------------------


def test_a_first_guess_that_diverges_is_said() -> None:
    p = swing_up("cart-pole")
    plant = DiscreteMechanism(mechanism("cart-pole"), 0.5, "explicit-euler")
    at = ddp.init(replace(p, dynamics=plant), np.full((60, 1), 1e5), DdpOptions())
    assert at.stopped.startswith("The first guess diverges at step ")
    assert ddp.step(p, DdpOptions(), at) is at


def test_an_indefinite_hessian_raises_mu_until_it_serves() -> None:
    p = swing_up("pendulum", r=1e-3)
    options = DdpOptions(second_order=True)
    at = ddp.init(p, np.zeros((60, 1)) + 2.0, options)
    raised = False
    while not at.stopped:
        at = ddp.step(p, options, at)
        raised |= at.mu > 0.0
    assert raised
    assert at.converged


def test_regularisation_at_its_limit_is_said() -> None:
    p = swing_up("pendulum")
    negative = replace(p, cost=replace(p.cost, R=-100.0 * np.eye(1)))  # type: ignore[type-var]
    at = ddp.solve(negative, guess(p), DdpOptions(mu_limit=1.0))
    assert not at.converged
    assert at.stopped.startswith("Failed: Q_uu is not positive definite at step 59")
    assert "limit of 2e+02" in at.stopped, "Q_uu is -200, and mu_limit in parts of its size"
    assert at.cost == ddp.init(negative, guess(p), DdpOptions()).cost, "nothing was moved"


@pytest.mark.parametrize(
    ("limit", "why"), [(100.0, "none of 13 step lengths"), (1e15, "with small mu no step lowers")]
)
def test_a_line_search_without_end_is_said(limit: float, why: str) -> None:
    """A cost whose gradient has the wrong sign: mu grows to its limit, or until what it leaves
    of a step is not worth taking."""

    class Wrong(MotionCost):
        def value(self, X: np.ndarray, U: np.ndarray) -> float:
            return -super().value(X, U)

    p = swing_up("pendulum")
    c = p.cost
    assert isinstance(c, MotionCost)
    wrong = Wrong(c.N, c.Q, c.R, c.Q_f, c.x_ref, c.u_ref)
    at = ddp.solve(replace(p, cost=wrong), guess(p), DdpOptions(mu_limit=limit, tolerance=1e-8))
    assert not at.converged
    assert at.stopped.startswith(f"Failed: the line search is exhausted: {why}")
    assert "c_1 = 0.001" in at.stopped


def test_too_few_iterations_are_said() -> None:
    p = swing_up("pendulum")
    at = ddp.solve(p, guess(p), DdpOptions(iterations=3))
    assert at.iteration == 3
    assert not at.converged
    assert at.stopped.startswith("Stopped short after 3 iterations")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"c1": 0.5}, "takes 0 < c1 <= c2 < 1"),
        ({"c2": 1.5}, "takes 0 < c1 <= c2 < 1"),
        ({"mu": -1.0}, "mu takes a number from 0"),
        ({"mu_factor": 1.0}, "its factor one above 1"),
    ],
)
def test_options_out_of_range_are_said(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(LabError, match=message):
        DdpOptions(**wrong)  # type: ignore[arg-type]


def test_a_guess_of_the_wrong_shape_is_said() -> None:
    with pytest.raises(LabError, match=r"shape \(59, 1\); N controls here are \(60, 1\)"):
        ddp.init(swing_up("pendulum"), np.zeros((59, 1)), DdpOptions())
