"""The curves that race, from A to B, as polylines: across and depth from A [m].

All but the optimiser's: it is a polyline by itself. Smooth curves have NODES nodes, closer together
near A, where a bead is slow and most of the time is spent."""

from itertools import pairwise

import numpy as np

from labs.optimal_control.brachistochrone.cycloid import cycloid_points, fastest_descent

NODES = 1201


def straight_line(across: float, depth: float) -> np.ndarray:
    """(2, 2)"""
    return np.array([[0.0, 0.0], [across, depth]])


def knee_polyline(knee: np.ndarray, across: float, depth: float) -> np.ndarray:
    """(3, 2): straight to the knee (2,) and straight on."""
    return np.array([[0.0, 0.0], knee, [across, depth]])


def circle_arc(across: float, depth: float) -> np.ndarray:
    """(NODES, 2): the circle that leaves A plumb, its centre level with A."""
    radius = (across**2 + depth**2) / (2.0 * across)
    angle = np.linspace(0.0, np.arctan2(depth, radius - across), NODES)
    return np.asarray(radius * np.stack([1.0 - np.cos(angle), np.sin(angle)], axis=1))


def cycloid(across: float, depth: float) -> np.ndarray:
    """(NODES, 2): the one through B, which is the fastest without friction."""
    found = fastest_descent(across, depth, 1.0)
    return cycloid_points(found.radius, np.linspace(0.0, found.theta, NODES))


def bezier(control: np.ndarray) -> np.ndarray:
    """(NODES, 2): the Bezier curve of control points (k, 2), by de Casteljau. It starts towards the
    second and ends coming from the last but one."""
    s = np.linspace(0.0, 1.0, NODES)[:, None] ** 2
    rows = [np.broadcast_to(point, (NODES, 2)) for point in control]
    while len(rows) > 1:
        rows = [(1.0 - s) * a + s * b for a, b in pairwise(rows)]
    return np.asarray(rows[0])


def cycloid_to_bottom(radius: float, theta: float) -> np.ndarray:
    """(NODES, 2) from its angle theta to the lowest point, at pi."""
    return cycloid_points(radius, np.pi - (np.pi - theta) * _clustered_parameter())


def circle_to_bottom(radius: float, theta: float) -> np.ndarray:
    """(NODES, 2) of a quadrant from its angle theta, in [0, pi/2], to the lowest point."""
    angle = np.pi / 2 - (np.pi / 2 - theta) * _clustered_parameter()
    return np.asarray(radius * np.stack([1.0 - np.cos(angle), np.sin(angle)], axis=1))


def _clustered_parameter() -> np.ndarray:
    """(NODES,) from 1 to 0, slowly at first."""
    return 1.0 - np.linspace(0.0, 1.0, NODES) ** 2
