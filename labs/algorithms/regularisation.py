"""The regularisation mu of Q_uu + mu I (notes, 2.4.6): how it grows and shrinks.

Its least and its largest value are parts of the size of Q_uu, so that a cost in other units is
minimised by the same iterations.
"""

from typing import NamedTuple

import numpy as np

from labs.problems.optimal_control import Expansion

MIN_RELATIVE_MU = 1e-7
"""Below this part of the size of Q_uu mu is zero."""


class Regularisation(NamedTuple):
    """What mu may be, zero apart, in the unit of Q_uu."""

    factor: float
    smallest: float
    limit: float

    def increase(self, mu: float) -> float:
        """The next larger one."""
        return max(mu * self.factor, self.smallest)

    def decrease(self, mu: float) -> float:
        """The next smaller one."""
        return mu / self.factor if mu / self.factor >= self.smallest else 0.0


def regularisation(model: Expansion, factor: float, limit: float) -> Regularisation:
    """With `limit` in parts of the size of Q_uu: of the largest entry on the diagonals of
    l_uu + f_u' l_xx f_u, which is what Q_uu is one step before an end."""
    ahead = np.einsum("tki,tkl,tli->ti", model.B, model.cost.l_xx[1:], model.B)
    size = float(np.abs(np.einsum("tii->ti", model.cost.l_uu) + ahead).max())
    return Regularisation(factor, MIN_RELATIVE_MU * size, limit * size)
