"""The equation of motion of an arm, its terms and its two problems (notes, 1.1.5).

    M(q) q'' + C(q, q') q' + g(q) = tau + J(q)^T w,    h(q, q') = C(q, q') q' + g(q)

Direct dynamics asks for q'' and gets it by the articulated-body algorithm, in O(n) and without
M; inverse dynamics asks for tau and gets it by the recursive Newton-Euler algorithm, also
without M. The terms themselves come from three further algorithms (composite rigid bodies, the
Coriolis recursion, gravity), so that putting them together checks all five (Featherstone, Rigid
Body Dynamics Algorithms, 2008, chapters 5 to 7).
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin


@dataclass(frozen=True, eq=False)
class EquationTerms:
    """The terms at one state (q, v)."""

    mass: np.ndarray
    """M(q), (nv, nv) [kg m^2]: symmetric, positive definite."""
    coriolis: np.ndarray
    """C(q, v), (nv, nv) [kg m^2/s], of the factorisation for which M' - 2 C is skew."""
    gravity: np.ndarray
    """g(q), (nv,) [N m]"""

    def bias(self, v: np.ndarray) -> np.ndarray:
        """h = C v + g, (nv,) [N m]."""
        h: np.ndarray = self.coriolis @ v + self.gravity
        return h


def equation_terms(model: pin.Model, data: pin.Data, q: np.ndarray, v: np.ndarray) -> EquationTerms:
    """M(q), C(q, v) and g(q) at q (nq,) [rad] and v (nv,) [rad/s]."""
    mass = mass_matrix(model, data, q)
    coriolis = pin.computeCoriolisMatrix(model, data, q, v).copy()
    gravity = pin.computeGeneralizedGravity(model, data, q).copy()
    return EquationTerms(mass, coriolis, gravity)


def mass_matrix(model: pin.Model, data: pin.Data, q: np.ndarray) -> np.ndarray:
    """M(q), (nv, nv), both triangles [kg m^2], at q (nq,) [rad]."""
    upper = np.triu(pin.crba(model, data, q))
    mass: np.ndarray = upper + np.triu(upper, 1).T
    return mass


def direct_dynamics(
    model: pin.Model, data: pin.Data, q: np.ndarray, v: np.ndarray, applied: np.ndarray
) -> np.ndarray:
    """q'' (nv,) [rad/s^2] with M q'' + h = applied, where applied = tau + J^T w (nv,) [N m]."""
    acceleration: np.ndarray = pin.aba(model, data, q, v, applied).copy()
    return acceleration


def inverse_dynamics(
    model: pin.Model, data: pin.Data, q: np.ndarray, v: np.ndarray, a: np.ndarray
) -> np.ndarray:
    """tau + J^T w = M a + h (nv,) [N m] that gives the acceleration a (nv,) [rad/s^2]."""
    applied: np.ndarray = pin.rnea(model, data, q, v, a).copy()
    return applied
