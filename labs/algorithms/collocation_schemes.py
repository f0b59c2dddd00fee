"""Rules of collocation (notes, 2.3.3): how a step of h from s_i to s_(i+1) is tied to x' = f(x, u).

    midpoint          s_(i+1) - s_i = h f((s_i + s_(i+1)) / 2, y_i)
    trapezoidal       s_(i+1) - s_i = h (f_i + f_(i+1)) / 2
    Hermite-Simpson   s_(i+1) - s_i = h (f_i + 4 f_m + f_(i+1)) / 6,
                      s_m = (s_i + s_(i+1)) / 2 + h (f_i - f_(i+1)) / 8

The midpoint rule is that of the notes: y_i is the control of a whole step. The other two (beyond
the notes) have a control y_i at every grid point, and Hermite-Simpson state and control s_m, y_m
in the middle of a step besides. In all of them a defect is linear in the states and in f at the
points where f is asked for; the cost's integral goes by the same rule.
"""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Scheme:
    """A rule, as numbers. The variables of a trajectory are blocks (state, control), `stride` of
    them a step, and one more at the end."""

    title: str
    order: int
    """Of the error in h."""
    stride: int
    states: tuple[tuple[float, ...], ...]
    """What each kind of defect takes of the step's states, from its first block to the next
    step's first; the last kind is that of s_(i+1) - s_i."""
    slopes: tuple[tuple[float, ...], ...]
    """What it takes of -h f at the step's points."""
    quadrature: tuple[float, ...]
    """What the cost takes of h l at the step's points."""
    between: bool = False
    """Whether the point of a step is halfway between its two states, with the control of the
    first; otherwise points and blocks are the same, and the last block has a control too."""


SCHEMES: Mapping[str, Scheme] = {
    "midpoint": Scheme("Midpoint", 2, 1, ((-1.0, 1.0),), ((1.0,),), (1.0,), between=True),
    "trapezoidal": Scheme("Trapezoidal", 2, 1, ((-1.0, 1.0),), ((0.5, 0.5),), (0.5, 0.5)),
    "hermite-simpson": Scheme(
        "Hermite-Simpson",
        4,
        2,
        ((-0.5, 1.0, -0.5), (-1.0, 0.0, 1.0)),
        ((1 / 8, 0.0, -1 / 8), (1 / 6, 4 / 6, 1 / 6)),
        (1 / 6, 4 / 6, 1 / 6),
    ),
}
