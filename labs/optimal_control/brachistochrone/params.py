"""The tunables of the brachistochrone."""

import numpy as np

from labs.optimal_control.brachistochrone.cycloid import FastestDescent, fastest_descent
from labs.params import Group, Params

NO_FLOOR = 3.0
"""[m] of depth, which no curve reaches."""
COARSEST = 5
"""Segments to start with, from coarse to fine."""
SHALLOW = 0.05
"""[m] the least depth of a control point: a curve that starts level is never left."""

RACE = Group("Race")
WORLD = Group("World", effect="solve")
ENDS = Group("Start and end", effect="solve")
KNEE = Group("Knee", when={"race": "curves"})
YOURS = Group("Your curve", when={"race": "curves"})
SOLVER = Group("Optimiser", effect="solve")


class BrachistochroneParams(Params):
    """What the user can turn. The plane's own coordinates are x to the right and z up; from A,
    x across and y down."""

    race: str = RACE.choice(
        "curves",
        {"curves": "six curves from A to B", "starts": "six starts on one curve"},
        "Race",
        key=True,
    )
    """Who races: a bead on each of six curves, or six beads on one that ends at its lowest
    point."""
    shape: str = RACE.choice(
        "cycloid",
        {"cycloid": "the cycloid", "circle": "a quadrant"},
        "The one curve",
        when={"race": "starts"},
        key=True,
    )
    """What all six slide down. The quadrant is as deep as the cycloid."""
    release: float = RACE.knob(
        0.5, 0.02, 1.0, "s", "", "Your start", step=0.01, when={"race": "starts"}
    )
    """Where your bead is let go: part of the way from the lowest point up to A."""
    colors: str = RACE.choice(
        "speed", {"speed": "how fast the bead is", "curve": "which curve it is"}, "Colours show"
    )
    """What the colours of the curves mean: speed from dark, at rest, to bright, or the colour of
    the bead and of its lines in the plots."""
    g: float = WORLD.knob(9.81, 1.0, 25.0, "g", "m/s²", "Gravity", step=0.01, key=True)
    """Free fall: 9.81 on Earth, 1.62 on the Moon, 24.8 on Jupiter."""
    mu: float = WORLD.knob(0.0, 0.0, 0.6, r"\mu", "", "Friction", step=0.01, key=True)
    """Coefficient of friction, of what the weight presses on the curve. Beyond the notes."""
    x_a: float = ENDS.knob(0.0, -0.5, 0.5, "x_A", "m", "A, across", step=0.01)
    """Where the beads start."""
    z_a: float = ENDS.knob(1.4, 1.15, 2.4, "z_A", "m", "A, height", step=0.01)
    """Where the beads start."""
    x_b: float = ENDS.knob(2.0, 0.8, 3.2, "x_B", "m", "B, across", step=0.01)
    """Where they should arrive."""
    z_b: float = ENDS.knob(0.4, 0.1, 1.05, "z_B", "m", "B, height", step=0.01)
    """Where they should arrive; always lower than A."""
    x_k: float = KNEE.knob(0.3, 0.0, 3.0, "x_K", "m", "Across", step=0.01)
    """Of the path that goes down steeply and then straight to B: its corner, from A."""
    y_k: float = KNEE.knob(0.9, SHALLOW, 2.0, "y_K", "m", "Depth", step=0.01)
    """Of the path that goes down steeply and then straight to B: its corner, below A."""
    x_1: float = YOURS.knob(0.5, 0.0, 3.0, "x_1", "m", "1, across", step=0.01)
    """The first control point, from A. The curve starts towards it."""
    y_1: float = YOURS.knob(0.1, SHALLOW, 2.0, "y_1", "m", "1, depth", step=0.01)
    """The first control point, below A. The curve starts towards it."""
    x_2: float = YOURS.knob(1.0, 0.0, 3.0, "x_2", "m", "2, across", step=0.01)
    """The second control point, from A: it pulls at the middle."""
    y_2: float = YOURS.knob(0.5, SHALLOW, 2.0, "y_2", "m", "2, depth", step=0.01)
    """The second control point, below A: it pulls at the middle."""
    x_3: float = YOURS.knob(1.5, 0.0, 3.0, "x_3", "m", "3, across", step=0.01)
    """The third control point, from A. The curve arrives coming from it."""
    y_3: float = YOURS.knob(0.9, SHALLOW, 2.0, "y_3", "m", "3, depth", step=0.01)
    """The third control point, below A. The curve arrives coming from it."""
    segments: float = SOLVER.knob(40.0, 3.0, 400.0, "N", "", "Segments", step=1.0, key=True)
    """Of the polyline whose nodes the optimiser moves up and down."""
    grid: str = SOLVER.choice(
        "clustered",
        {"even": "evenly: x = w i/N", "clustered": "close near A: x = w (i/N)³"},
        "Nodes",
    )
    """Where the nodes are across, w being the width from A to B."""
    floor: float = SOLVER.knob(NO_FLOOR, 0.2, NO_FLOOR, r"y_{\max}", "m", "Floor", step=0.01)
    """No node of the optimiser may be deeper below A than this (or than B)."""
    refine: bool = SOLVER.toggle(False, "From coarse to fine")
    """Solve with 5 segments first and start each next grid, twice as fine, from the last curve."""
    start: str = SOLVER.choice(
        "warm", {"warm": "Warm: the present curve", "cold": "Cold: a straight line"}, "Start"
    )
    """What a change of the problem is solved from."""

    @property
    def across(self) -> float:
        """[m] from A to B."""
        return self.x_b - self.x_a

    @property
    def depth(self) -> float:
        """[m] of B below A."""
        return self.z_a - self.z_b

    @property
    def in_reach(self) -> bool:
        """Whether gravity gives more on the way to B than friction takes."""
        return self.depth > self.mu * self.across

    @property
    def generating_circle(self) -> FastestDescent:
        """What rolls the cycloid from A to B, whatever the friction."""
        return fastest_descent(self.across, self.depth, self.g)

    @property
    def knee(self) -> np.ndarray:
        """(2,) from A."""
        return np.array([self.x_k, self.y_k])

    @property
    def control_points(self) -> np.ndarray:
        """(5, 2) from A, of the Bezier curve: both ends, and three between."""
        between = [(self.x_1, self.y_1), (self.x_2, self.y_2), (self.x_3, self.y_3)]
        return np.array([(0.0, 0.0), *between, (self.across, self.depth)])

    @property
    def grids(self) -> list[int]:
        """Numbers of segments to solve with, one after the other."""
        last = round(self.segments)
        coarser = [COARSEST * 2**k for k in range(10) if COARSEST * 2**k < last]
        return [*coarser, last] if self.refine else [last]

    def world_points(self, points: np.ndarray, off: float = 0.0) -> np.ndarray:
        """(k, 3) [m] of points (k, 2) across and depth from A, `off` before the plane."""
        points = np.atleast_2d(points)
        beside = np.full(len(points), off)
        return np.stack([beside, self.x_a + points[:, 0], self.z_a - points[:, 1]], axis=1)
