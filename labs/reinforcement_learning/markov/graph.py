"""The geometry of a Markov chain's graph: states as tiles on an ellipse, transitions as ribbons
between them that are the wider the more probable, and beads on the ribbons of one state, whose
places are its probabilities. All horizontal; lengths in metres."""

import numpy as np

ACROSS, ALONG, HEIGHT = 1.2, 0.85, 0.02
"""Half the axes of the ellipse, and how high over the floor it lies."""
TILE_SIZE = 0.26
"""Side of the tile under a state."""
NEAR, BEND = 0.2, 0.16
"""From a state's middle to where a ribbon begins; how far it bows out, by its length."""
LOOP, LOOP_OPENING = 0.15, 0.5
"""Radius of the ribbon from a state to itself; half the angle at which it is open [rad]."""
THIN, WIDE = 0.004, 0.04
"""Half the width of a ribbon of probability 0, and what probability 1 adds."""
HEAD = 0.8
"""Where on a ribbon its head begins, from 0 to 1."""
RIBBON_POINTS = 24
"""Points of a ribbon before its head."""
BEAD_START, BEAD_END = 0.12, 0.76
"""Where on a ribbon the beads of probability 0 and 1 lie, from 0 to 1."""
TOKEN_OFFSET = np.array([0.0, 0.0, 0.1])
"""From a tile to the token on it."""


def state_places(n: int) -> np.ndarray:
    """(n, 3) of the states: clockwise, the first one at the far end."""
    angle = 0.5 * np.pi - 2.0 * np.pi * np.arange(n) / n
    return np.stack([ACROSS * np.cos(angle), ALONG * np.sin(angle), np.full(n, HEIGHT)], axis=1)


def ribbon_points(where: np.ndarray, x: int, y: int, s: np.ndarray) -> np.ndarray:
    """(len(s), 3): the points at s in [0, 1] along the ribbon from state x to state y."""
    if x == y:
        outward = where[x] * (1.0, 1.0, 0.0)
        outward /= np.linalg.norm(outward)
        center = where[x] + (TILE_SIZE / 2 + LOOP) * outward
        angle = (
            np.arctan2(outward[1], outward[0])
            + np.pi
            + LOOP_OPENING
            + (2.0 * np.pi - 2.0 * LOOP_OPENING) * s
        )
        turn = np.stack([np.cos(angle), np.sin(angle), np.zeros(len(s))], axis=1)
        loop: np.ndarray = center + LOOP * turn
        return loop
    along = where[y] - where[x]
    beside = np.array([-along[1], along[0], 0.0])
    middle = 0.5 * (where[x] + where[y]) + BEND * beside
    reach = NEAR / np.linalg.norm(along)
    t = (reach + (1.0 - 2.0 * reach) * s)[:, None]
    curve: np.ndarray = (1 - t) ** 2 * where[x] + 2 * t * (1 - t) * middle + t**2 * where[y]
    return curve


def bead_place(where: np.ndarray, x: int, y: int, p: float) -> np.ndarray:
    """(3,): the place on the ribbon from x to y that stands for the probability p."""
    place: np.ndarray = ribbon_points(
        where, x, y, np.array([BEAD_START + (BEAD_END - BEAD_START) * p])
    )[0]
    return place


def probability_at(where: np.ndarray, x: int, y: int, point: np.ndarray) -> float:
    """That of the bead's place nearest to a point (3,), seen from above; in hundredths."""
    p = np.linspace(0.0, 1.0, 101)
    off = ribbon_points(where, x, y, BEAD_START + (BEAD_END - BEAD_START) * p)[:, :2] - point[:2]
    return round(float(p[np.argmin((off**2).sum(axis=1))]), 2)


def token_place(where: np.ndarray, x: int, y: int, s: float) -> np.ndarray:
    """(3,): a token that has come the part s of its way from state x to state y: it hops."""
    s = s * s * (3.0 - 2.0 * s)
    start, place, end = ribbon_points(where, x, y, np.array([0.0, s, 1.0]))
    # A ribbon begins and ends a little off the middles of the tiles.
    place = place + (1.0 - s) ** 4 * (where[x] - start) + s**4 * (where[y] - end)
    hop: np.ndarray = place + TOKEN_OFFSET + [0.0, 0.0, 0.5 * s * (1.0 - s)]
    return hop


def ribbon(where: np.ndarray, x: int, y: int, p: float) -> np.ndarray:
    """(2, columns, 3): both edges of the ribbon of probability p, which ends in a head. Its first
    and last columns are points: ribbons laid end to end leave nothing in between."""
    s = np.concatenate([[0.0], np.linspace(0.0, HEAD, RIBBON_POINTS), [HEAD, 1.0]])
    half = np.full(len(s), THIN + WIDE * p)
    half[0] = half[-1] = 0.0
    half[-2] = 2.2 * half[-2] + 0.012
    line = ribbon_points(where, x, y, s)
    ahead = ribbon_points(where, x, y, s + 1e-4) - ribbon_points(where, x, y, s - 1e-4)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    left = half[:, None] * np.stack([-ahead[:, 1], ahead[:, 0], np.zeros(len(s))], axis=1)
    return np.stack([line + left, line - left])


def ribbons(where: np.ndarray, P: np.ndarray, shown: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All those in `shown` (X, X) bool as one strip (2, columns, 3), and (columns,) which state
    each column comes from."""
    pairs = [(int(x), int(y)) for x, y in np.argwhere(shown)]
    strips = [ribbon(where, x, y, P[x, y]) for x, y in pairs]
    source = np.repeat([x for x, _ in pairs], strips[0].shape[1])
    return np.concatenate(strips, axis=1), source
