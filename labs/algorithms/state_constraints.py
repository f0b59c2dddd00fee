"""What a problem asks of its states (notes, 2.3.1), in shooting: at each point of a grid the finite
bounds and the path constraint, one stack of m inequalities, and at the end its equalities,

    g_i = (x_i - x_max, x_min - x_i, g(x_i)) <= 0,    c = (x_N - x_T where it is given, e(x_N)) = 0

The inequalities are of k points at once: X (k, nx).
"""

import numpy as np

from labs.algorithms.curvature import weighted_constraint_curvature
from labs.problems.continuous_control import ContinuousProblem
from labs.resumable import Resumable


class StateConstraints:
    """Those of a problem."""

    def __init__(self, problem: ContinuousProblem) -> None:
        nx = problem.dynamics.nx
        self._path, self._end = problem.path, problem.end
        self._x_lower, self._x_upper = problem.x_lower, problem.x_upper
        self._above = np.flatnonzero(np.isfinite(problem.x_upper))
        self._below = np.flatnonzero(np.isfinite(problem.x_lower))
        self._goal = np.full(nx, np.nan) if problem.x_final is None else problem.x_final
        self._fixed = np.flatnonzero(np.isfinite(self._goal))
        x = problem.x_names
        self.names: tuple[str, ...] = (
            *(f"the upper bound of {x[i]}" for i in self._above),
            *(f"the lower bound of {x[i]}" for i in self._below),
            *((self._path.name(i) for i in range(self._path.size)) if self._path else ()),
        )
        """What each of the m inequalities says, without when."""
        self.end_names: tuple[str, ...] = (
            *(f"{x[i]} at the end" for i in self._fixed),
            *(
                (f"{self._end.name(i)} at the end" for i in range(self._end.size))
                if self._end
                else ()
            ),
        )

    @property
    def size(self) -> int:
        """m"""
        return len(self.names)

    def values(self, X: np.ndarray) -> np.ndarray:
        """g (k, m)"""
        above = X[:, self._above] - self._x_upper[self._above]
        below = self._x_lower[self._below] - X[:, self._below]
        path = [self._path.values(X)] if self._path else []
        return np.concatenate([above, below, *path], axis=1)

    def jacobians(self, X: np.ndarray) -> np.ndarray:
        """(k, m, nx)"""
        eye = np.eye(X.shape[1])
        bounds = np.tile(np.concatenate([eye[self._above], -eye[self._below]]), (len(X), 1, 1))
        path = [self._path.jacobians(X)] if self._path else []
        return np.concatenate([bounds, *path], axis=1)

    def end_values(self, x: np.ndarray) -> np.ndarray:
        """c (number of equalities,) at the end x (nx,)."""
        end = [self._end.values(x[None])[0]] if self._end else []
        return np.concatenate([x[self._fixed] - self._goal[self._fixed], *end])

    def end_jacobian(self, x: np.ndarray) -> np.ndarray:
        """(number of equalities, nx)"""
        end = [self._end.jacobians(x[None])[0]] if self._end else []
        return np.concatenate([np.eye(len(x))[self._fixed], *end])

    def curvature(self, X: np.ndarray, mu: np.ndarray, lam: np.ndarray) -> Resumable[np.ndarray]:
        """(k, nx, nx) of mu_i' g(x_i), with mu (k, m), and lam' c at the last of the points."""
        found = np.zeros((len(X), X.shape[1], X.shape[1]))
        if self._path:
            by_path = mu[:, self.size - self._path.size :]
            found += yield from weighted_constraint_curvature(self._path.jacobians, X, by_path)
        if self._end:
            last = lam[None, len(self._fixed) :]
            bent = yield from weighted_constraint_curvature(self._end.jacobians, X[-1:], last)
            found[-1] += bent[0]
        return found
