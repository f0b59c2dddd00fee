"""The tunables of integration: a pendulum, a step, and the two methods one can choose."""

from functools import lru_cache
from typing import Annotated

import numpy as np

from labs.algorithms.butcher_tableau import parse_tableau
from labs.models.pendulums import Pendulum, pendulum
from labs.params import Group, Params, validated_by

METHOD_TITLES = {
    "euler": "Euler",
    "semi": "Semi-implicit",
    "midpoint": "Midpoint",
    "heun": "Heun",
    "rk3": "RK3",
    "rk4": "RK4",
    "implicit": "Implicit",
    "yours": "Yours",
}
METHOD_NAMES = tuple(METHOD_TITLES)
SYSTEMS = {"pendulum": "Pendulum", "double-pendulum": "Double pendulum"}
IMPLICIT_METHODS = {
    "implicit-midpoint": "Implicit midpoint",
    "gauss-legendre": "Gauss-Legendre, 2 stages",
    "implicit-euler": "Implicit Euler",
}

DORMAND_PRINCE = """\
0 |
1/5  | 1/5
3/10 | 3/40 9/40
4/5  | 44/45 -56/15 32/9
8/9  | 19372/6561 -25360/2187 64448/6561 -212/729
1    | 9017/3168 -355/33 46732/5247 49/176 -5103/18656
1    | 35/384 0 500/1113 125/192 -2187/6784 11/84
     | 35/384 0 500/1113 125/192 -2187/6784 11/84 0
     | 5179/57600 0 7571/16695 393/640 -92097/339200 187/2100 1/40"""
"""The embedded pair of orders 5 and 4 (Dormand and Prince 1980)."""
PAIR = {"first": "First row of b", "second": "Second row of b"}

SYSTEM = Group("System", effect="restart")
STEPPING = Group("Methods", effect="solve")


@lru_cache(maxsize=16)
def _canonical_tableau(text: str, pick: int) -> str:
    return parse_tableau(text, pick).text


class IntegrationParams(Params):
    """What the user can turn."""

    system: str = SYSTEM.choice("pendulum", SYSTEMS, "System", key=True)
    """What every method integrates: one rod of half a metre, or two."""
    start: float = SYSTEM.knob(1.0, 0.0, 3.1, "q(0)", "rad", "Start angle", step=0.01, key=True)
    """Of the first rod from hanging; the second starts in line with it. All start at rest."""
    friction: float = SYSTEM.knob(
        0.0, 0.0, 5.0, "b", "N·m·s/rad", "Friction", scale="log", effect="solve", key=True
    )
    """Viscous, at every hinge. It moves the eigenvalues to the left."""
    h: float = STEPPING.knob(
        0.04, 0.002, 1.0, "h", "s", "Step", scale="log", effect="live", key=True
    )
    """Of all methods alike. A pendulum stands still between two steps."""
    implicit: str = STEPPING.choice("implicit-midpoint", IMPLICIT_METHODS, "Implicit method")
    """Which one the gray pendulum follows; its stages are found by Newton's method."""
    tableau: Annotated[str, validated_by(parse_tableau)] = STEPPING.text(
        "0 |\n1/3 | 1/3\n2/3 | 0 2/3\n| 1/4 0 3/4", "Your tableau", rows=6, max_length=1500
    )
    """A row a stage, c | a ..., then | b ... at the end, or two of an embedded pair. Fractions go,
    and so do weights on and above the diagonal (implicit)."""
    pair: str = STEPPING.choice("first", PAIR, "Of a pair take")
    """Which row of b counts where your tableau has two."""

    @property
    def rods(self) -> int:
        return 2 if self.system == "double-pendulum" else 1

    @property
    def plant(self) -> Pendulum:
        return pendulum(self.rods, self.friction)

    @property
    def own_tableau(self) -> str:
        """Your tableau, spelt out, with the row of b that counts."""
        return _canonical_tableau(self.tableau, list(PAIR).index(self.pair))

    def x0(self) -> np.ndarray:
        """(2 nq,) the start, [rad] and [rad/s]."""
        x = np.zeros(2 * self.rods)
        x[0] = self.start
        return x

    def method(self, name: str) -> tuple[str, int, float]:
        """What fixes a method, one of METHOD_NAMES, and its system: the arguments of
        `labs.appendix.integration.accuracy`."""
        text = {"yours": self.own_tableau, "implicit": self.implicit}.get(name, name)
        return text, self.rods, self.friction
