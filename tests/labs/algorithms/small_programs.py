"""Small nonlinear programmes with published optima (Hock and Schittkowski, "Test examples for
nonlinear programming codes", 1981), their derivatives by CasADi."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.sparse import csc_array

from labs.problems.nonlinear_program import ProgramDerivatives, ProgramValues
from labs.resumable import Resumable


class SmallProgram:
    """f, c = 0, g <= 0 as functions of the symbols y; f is of the size of a unit."""

    free_time = False

    def __init__(
        self,
        n: int,
        f: Callable[[Any], Any],
        c: Callable[[Any], list[Any]] = lambda y: [],
        g: Callable[[Any], list[Any]] = lambda y: [],
        lower: float | list[float] = -np.inf,
        upper: float | list[float] = np.inf,
        unit: float = 1.0,
    ) -> None:
        self._unit = unit
        y = ca.SX.sym("y", n)
        equal, less = ca.vertcat(*c(y)), ca.vertcat(*g(y))
        equal, less = (part if part.numel() else ca.SX(0, 1) for part in (equal, less))
        lam, mu = ca.SX.sym("lam", equal.numel()), ca.SX.sym("mu", less.numel())
        objective = ca.SX(f(y))
        L = objective + ca.dot(lam, equal) + ca.dot(mu, less)
        self._values = ca.Function("v", [y], [objective, equal, less])
        first = [ca.gradient(objective, y), ca.jacobian(equal, y), ca.jacobian(less, y)]
        self._first = ca.Function("d", [y], first)
        self._hessian = ca.Function("h", [y, lam, mu], [ca.hessian(L, y)[0]])
        self.lower, self.upper = np.full(n, lower), np.full(n, upper)

    def values(self, y: np.ndarray) -> ProgramValues:
        f, c, g = (np.asarray(part).ravel() for part in self._values(y))
        return ProgramValues(float(f[0]), c, g)

    def derivatives(self, y: np.ndarray) -> ProgramDerivatives:
        f_y, c_y, g_y = (np.asarray(part) for part in self._first(y))
        return ProgramDerivatives(f_y.ravel(), csc_array(c_y), csc_array(g_y))

    def hessian(
        self, y: np.ndarray, lam: np.ndarray, mu: np.ndarray, exact: bool
    ) -> Resumable[csc_array]:
        """By Gauss-Newton: a multiple of the identity, nothing else being sure to be convex."""
        yield
        H = np.asarray(self._hessian(y, lam, mu)) if exact else self._unit * np.eye(len(y))
        return csc_array(H)

    def equality_name(self, i: int) -> str:
        return f"equality {i + 1}"

    def inequality_name(self, i: int) -> str:
        return f"inequality {i + 1}"

    def variable_name(self, i: int) -> str:
        return f"y_{i + 1}"


@dataclass(frozen=True)
class Published:
    """A programme, where to start, and its least f."""

    program: SmallProgram
    start: tuple[float, ...]
    optimum: float


PUBLISHED: Mapping[str, Published] = {
    "6": Published(
        SmallProgram(2, lambda y: (1 - y[0]) ** 2, lambda y: [10 * (y[1] - y[0] ** 2)]),
        (-1.2, 1.0),
        0.0,
    ),
    "7": Published(
        SmallProgram(
            2,
            lambda y: ca.log(1 + y[0] ** 2) - y[1],
            lambda y: [(1 + y[0] ** 2) ** 2 + y[1] ** 2 - 4],
        ),
        (2.0, 2.0),
        -np.sqrt(3.0),
    ),
    "14": Published(
        SmallProgram(
            2,
            lambda y: (y[0] - 2) ** 2 + (y[1] - 1) ** 2,
            lambda y: [y[0] - 2 * y[1] + 1],
            lambda y: [0.25 * y[0] ** 2 + y[1] ** 2 - 1],
        ),
        (2.0, 2.0),
        9.0 - 2.875 * np.sqrt(7.0),
    ),
    "43": Published(
        SmallProgram(
            4,
            lambda y: ca.dot(y, y) + y[2] ** 2 - 5 * y[0] - 5 * y[1] - 21 * y[2] + 7 * y[3],
            g=lambda y: [
                ca.dot(y, y) + y[0] - y[1] + y[2] - y[3] - 8,
                ca.dot(y, y) + y[1] ** 2 + y[3] ** 2 - y[0] - y[3] - 10,
                ca.dot(y, y) + y[0] ** 2 - y[3] ** 2 + 2 * y[0] - y[1] - y[3] - 5,
            ],
        ),
        (0.0, 0.0, 0.0, 0.0),
        -44.0,
    ),
    "71": Published(
        SmallProgram(
            4,
            lambda y: y[0] * y[3] * (y[0] + y[1] + y[2]) + y[2],
            lambda y: [ca.dot(y, y) - 40],
            lambda y: [25 - y[0] * y[1] * y[2] * y[3]],
            1.0,
            5.0,
        ),
        (1.0, 5.0, 5.0, 1.0),
        17.0140172891,
    ),
    "81": Published(
        SmallProgram(
            5,
            lambda y: (
                ca.exp(y[0] * y[1] * y[2] * y[3] * y[4]) - 0.5 * (y[0] ** 3 + y[1] ** 3 + 1) ** 2
            ),
            lambda y: [
                ca.dot(y, y) - 10,
                y[1] * y[2] - 5 * y[3] * y[4],
                y[0] ** 3 + y[1] ** 3 + 1,
            ],
            lower=[-2.3, -2.3, -3.2, -3.2, -3.2],
            upper=[2.3, 2.3, 3.2, 3.2, 3.2],
        ),
        (-2.0, 2.0, 2.0, -1.0, -1.0),
        0.0539498478,
    ),
    "100": Published(
        SmallProgram(
            7,
            lambda y: (
                (y[0] - 10) ** 2
                + 5 * (y[1] - 12) ** 2
                + y[2] ** 4
                + 3 * (y[3] - 11) ** 2
                + 10 * y[4] ** 6
                + 7 * y[5] ** 2
                + y[6] ** 4
                - 4 * y[5] * y[6]
                - 10 * y[5]
                - 8 * y[6]
            ),
            g=lambda y: [
                2 * y[0] ** 2 + 3 * y[1] ** 4 + y[2] + 4 * y[3] ** 2 + 5 * y[4] - 127,
                7 * y[0] + 3 * y[1] + 10 * y[2] ** 2 + y[3] - y[4] - 282,
                23 * y[0] + y[1] ** 2 + 6 * y[5] ** 2 - 8 * y[6] - 196,
                4 * y[0] ** 2 + y[1] ** 2 - 3 * y[0] * y[1] + 2 * y[2] ** 2 + 5 * y[5] - 11 * y[6],
            ],
        ),
        (1.0, 2.0, 0.0, 4.0, 0.0, 1.0, 1.0),
        680.6300573,
    ),
}
"""By their numbers there."""
