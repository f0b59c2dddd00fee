"""The tunables of integration: a pendulum, a step, and the two methods one can choose."""

import numpy as np
from pydantic import field_validator

from labs.algorithms.runge_kutta import parse_tableau
from labs.errors import LabError
from labs.models.pendulums import Pendulum, pendulum
from labs.params import Group, Params

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

SYSTEM = Group("System", effect="restart")
STEPPING = Group("Methods", effect="solve")


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
    tableau: str = STEPPING.text("0 |\n1/3 | 1/3\n2/3 | 0 2/3\n| 1/4 0 3/4", "Your tableau", rows=6)
    """A row a stage, c | a ..., then | b ... at the end. Fractions go, and so do weights on and
    above the diagonal (implicit)."""

    @field_validator("tableau")
    @classmethod
    def _is_a_tableau(cls, value: str) -> str:
        try:
            parse_tableau(value)
        except LabError as error:
            raise ValueError(str(error)) from None
        return value

    @property
    def rods(self) -> int:
        return 2 if self.system == "double-pendulum" else 1

    @property
    def plant(self) -> Pendulum:
        return pendulum(self.rods, self.friction)

    def x0(self) -> np.ndarray:
        """(2 nq,) the start, [rad] and [rad/s]."""
        x = np.zeros(2 * self.rods)
        x[0] = self.start
        return x

    def method(self, name: str) -> tuple[str, int, float]:
        """What fixes a method, one of METHOD_NAMES, and its system: the arguments of
        `labs.appendix.integration.accuracy`."""
        text = {"yours": self.tableau, "implicit": self.implicit}.get(name, name)
        return text, self.rods, self.friction
