"""Optimal control problems in continuous time for tests: a double integrator, and mechanisms with a
cost that is neither quadratic nor separable."""

from dataclasses import dataclass

import numpy as np

from labs.models.mechanisms import mechanism
from labs.problems.continuous_control import (
    ContinuousDynamics,
    ContinuousProblem,
    RunningDerivatives,
)


class DoubleIntegrator:
    """p' = v, v' = u."""

    nx, nu = 2, 1

    def f(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.array([x[1], u[0]])

    def derivatives(
        self, X: np.ndarray, U: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        f_x, f_u = np.zeros((len(X), 2, 2)), np.zeros((len(X), 2, 1))
        f_x[:, 0, 1] = f_u[:, 1, 0] = 1.0
        return np.stack([X[:, 1], U[:, 0]], axis=1), f_x, f_u


@dataclass(frozen=True)
class Quadratic:
    """l = x'Qx + u'Ru + time, l_f = (x - goal)' F (x - goal)."""

    Q: np.ndarray
    R: np.ndarray
    F: np.ndarray
    goal: np.ndarray
    time: float = 0.0

    def running(self, X: np.ndarray, U: np.ndarray) -> np.ndarray:
        quadratic = np.einsum("ki,ij,kj->k", X, self.Q, X) + np.einsum("ki,ij,kj->k", U, self.R, U)
        return np.asarray(quadratic + self.time)

    def running_derivatives(self, X: np.ndarray, U: np.ndarray, exact: bool) -> RunningDerivatives:
        k, nx, nu = len(X), X.shape[1], U.shape[1]
        l_xx, l_uu = np.tile(2.0 * self.Q, (k, 1, 1)), np.tile(2.0 * self.R, (k, 1, 1))
        return RunningDerivatives(
            2.0 * X @ self.Q, 2.0 * U @ self.R, l_xx, np.zeros((k, nu, nx)), l_uu
        )

    def final(self, x: np.ndarray) -> float:
        return float((x - self.goal) @ self.F @ (x - self.goal))

    def final_derivatives(self, x: np.ndarray, exact: bool) -> tuple[np.ndarray, np.ndarray]:
        return 2.0 * self.F @ (x - self.goal), 2.0 * self.F


@dataclass(frozen=True)
class Residuals:
    """l = |r|^2 / 2 with r = D z + sin z of z = (x, u), D random; l_f = |sin x - goal|^2 / 2."""

    D: np.ndarray
    goal: np.ndarray

    def running(self, X: np.ndarray, U: np.ndarray) -> np.ndarray:
        r, _, _ = self._residual(np.concatenate([X, U], axis=1))
        return np.asarray(0.5 * (r * r).sum(axis=1))

    def running_derivatives(self, X: np.ndarray, U: np.ndarray, exact: bool) -> RunningDerivatives:
        r, J, curvature = self._residual(np.concatenate([X, U], axis=1))
        g, H = np.einsum("kij,ki->kj", J, r), J.transpose(0, 2, 1) @ J
        if exact:
            H[:, range(g.shape[1]), range(g.shape[1])] += r * curvature
        n = X.shape[1]
        return RunningDerivatives(g[:, :n], g[:, n:], H[:, :n, :n], H[:, n:, :n], H[:, n:, n:])

    def final(self, x: np.ndarray) -> float:
        return float(0.5 * ((np.sin(x) - self.goal) ** 2).sum())

    def final_derivatives(self, x: np.ndarray, exact: bool) -> tuple[np.ndarray, np.ndarray]:
        r, J = np.sin(x) - self.goal, np.cos(x)
        return J * r, np.diag(J * J - (np.sin(x) * r if exact else 0.0))

    def _residual(self, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        J = np.tile(self.D, (len(Z), 1, 1))
        J[:, range(Z.shape[1]), range(Z.shape[1])] += np.cos(Z)
        return Z @ self.D.T + np.sin(Z), J, -np.sin(Z)


class Disc:
    """g = r^2 - |x - centre|^2 over the first two states, and g = sin(x_1) - 2: nowhere active."""

    size = 2

    def values(self, X: np.ndarray) -> np.ndarray:
        away = X[:, :2] - [3.0, 0.5]
        return np.stack([1.0 - (away**2).sum(axis=1), np.sin(X[:, 0]) - 2.0], axis=1)

    def jacobians(self, X: np.ndarray) -> np.ndarray:
        J = np.zeros((len(X), 2, X.shape[1]))
        J[:, 0, :2] = -2.0 * (X[:, :2] - [3.0, 0.5])
        J[:, 1, 0] = np.cos(X[:, 0])
        return J

    def name(self, i: int) -> str:
        return ("the distance from the disc", "the sine's limit")[i]


class Circle:
    """e = |(x_1, x_2)|^2 - 1."""

    size = 1

    def values(self, X: np.ndarray) -> np.ndarray:
        return np.asarray((X[:, :2] ** 2).sum(axis=1, keepdims=True) - 1.0)

    def jacobians(self, X: np.ndarray) -> np.ndarray:
        J = np.zeros((len(X), 1, X.shape[1]))
        J[:, 0, :2] = 2.0 * X[:, :2]
        return J

    def name(self, i: int) -> str:
        return "the distance from the circle"


def problem(
    dynamics: ContinuousDynamics,
    cost: Quadratic | Residuals,
    x0: np.ndarray,
    T: float,
    **given: object,
) -> ContinuousProblem:
    """Without limits, but for those given."""
    nx, nu = dynamics.nx, dynamics.nu
    free = {
        "x_lower": np.full(nx, -np.inf),
        "x_upper": np.full(nx, np.inf),
        "u_lower": np.full(nu, -np.inf),
        "u_upper": np.full(nu, np.inf),
    }
    return ContinuousProblem(dynamics, cost, x0, T, **{**free, **given})  # type: ignore[arg-type]


def nonlinear(rng: np.random.Generator, name: str, **given: object) -> ContinuousProblem:
    """The mechanism of this name, with Residuals."""
    system = mechanism(name)
    nz = system.nx + system.nu
    cost = Residuals(rng.normal(size=(nz, nz)), rng.normal(size=system.nx))
    return problem(system, cost, rng.normal(size=system.nx), 0.8, **given)
