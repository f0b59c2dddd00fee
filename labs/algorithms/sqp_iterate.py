"""What an iteration of sequential quadratic programming begins and ends with (notes, 2.3.1)."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from labs.algorithms.sqp_active_set import ActiveSet
from labs.algorithms.sqp_bfgs import BlockBfgs
from labs.algorithms.sqp_filter import Filter
from labs.algorithms.sqp_optimality import Optimality
from labs.algorithms.sqp_qp_solver import QpSolver
from labs.errors import LabError
from labs.problems.nonlinear_program import ProgramDerivatives, ProgramValues

HESSIANS: Mapping[str, str] = {
    "gauss-newton": "Gauss-Newton",
    "exact": "Exact",
    "bfgs": "Damped BFGS",
}


@dataclass(frozen=True)
class SqpOptions:
    """How the iterations go. Raises LabError."""

    hessian: str = "exact"
    """A key of HESSIANS."""
    tolerance: float = 1e-8
    """Of the conditions of optimality, in parts of what they are made of."""
    iterations: int = 200
    correction: bool = True
    """Whether steps get second-order corrections."""

    def __post_init__(self) -> None:
        if self.hessian not in HESSIANS:
            raise LabError(f"no Hessian is named {self.hessian!r}; there are {', '.join(HESSIANS)}")
        if not (0.0 < self.tolerance < 1.0 and self.iterations > 0):
            raise LabError(
                f"tolerance = {self.tolerance:g}, iterations = {self.iterations}: takes a "
                "tolerance between 0 and 1, and at least one iteration"
            )


@dataclass(frozen=True, eq=False)
class PrimalDualPoint:
    """Of an iterate, with its multipliers: what another solve may begin with."""

    y: np.ndarray
    lam: np.ndarray
    mu: np.ndarray
    nu: np.ndarray


@dataclass(frozen=True, eq=False)
class SqpIterate:
    """Where the solver is. Arrays are never written into again."""

    y: np.ndarray
    """(n,)"""
    values: ProgramValues
    """f, c and g there."""
    lam: np.ndarray
    """Multipliers of c."""
    mu: np.ndarray
    """Of g."""
    nu: np.ndarray
    """(n,) of the bounds."""
    filter: Filter
    iteration: int = 0
    alpha: float = 0.0
    """Accepted by the last iteration; 0 if it accepted none."""
    corrected: bool = False
    """Whether its step was corrected to second order."""
    theta: float = 1.0
    """Share of the exact Hessian in its model, the rest being Gauss-Newton's."""
    delta: float = 0.0
    """What it added to the Hessian's diagonal to make it convex."""
    penalty: float = 0.0
    """gamma while in elastic mode, else 0."""
    damping: float = 0.0
    """What the elastic mode adds to the Hessian's diagonal to keep its steps short."""
    elastic: tuple[float, ...] = ()
    """theta before the last elastic steps in a row."""
    optimality: Optimality | None = None
    """How far the conditions are met here, once the derivatives are known."""
    stopped: str = ""
    """Why no further iteration makes sense, in a sentence."""
    converged: bool = False
    infeasible: bool = False
    """Whether it stopped because nothing lowers the violation."""
    out_of_iterations: bool = False
    """Whether it stopped because there were no more of them."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """Of the wall clock, spent by the last iteration in derivatives, QP and line search."""
    derivatives: ProgramDerivatives | None = None
    """At y."""
    bfgs: BlockBfgs | None = None
    """BFGS's Hessian."""
    active: ActiveSet | None = None
    """What the last QP's solution pushed against."""
    active_set_settled: bool = False
    """Whether that was nearly so in the one before, too."""
    qp_inexact: bool = False
    """Whether the last QP was not solved wholly: then it takes another one to converge."""
    solver: QpSolver = field(default_factory=QpSolver)
    """What the QPs are solved with, which remembers their structure."""
    largest_gradient: float = 0.0
    """The largest |f_y| met so far."""

    @property
    def reusable(self) -> bool:
        """Whether another solve may begin here: not where this one was infeasible or failed."""
        return not self.stopped or self.converged or self.out_of_iterations

    @property
    def violation(self) -> float:
        """The largest |c_i| or g_i > 0, each in its own unit."""
        c = np.abs(self.values.c).max(initial=0.0)
        return float(max(c, self.values.g.max(initial=0.0)))

    @property
    def active_bounds(self) -> np.ndarray:
        """(n,): 1 where a variable pushes against its upper bound, -1 its lower one, else 0."""
        return np.asarray(np.sign(self.nu))

    @property
    def active_inequalities(self) -> np.ndarray:
        """(number of inequalities,) whether each is pushed against."""
        return np.asarray(self.mu > np.maximum(-self.values.g, 0.0))

    def gradient(self, d: ProgramDerivatives) -> np.ndarray:
        """(n,) of the Lagrangian but for its bounds, by these derivatives and the multipliers
        here."""
        return np.asarray(d.f_y + d.c_y.T @ self.lam + d.g_y.T @ self.mu)
