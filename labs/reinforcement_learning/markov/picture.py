"""A Markov chain drawn into the scene."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from labs.reinforcement_learning.markov.graph import TILE_SIZE, bead_place, ribbons
from labs.reinforcement_learning.markov.reward_process import RewardProcess
from labs.scene import Color, Scene

LOW, ABOVE = np.array([0.0, 0.0, 0.02]), np.array([0.0, 0.0, 0.06])
BELOW = np.array([-0.12, -0.18, 0.0])
GRAY, BLUE = np.array([0.6, 0.65, 0.72]), np.array([0.15, 0.39, 0.92])
EMPTY, FULL = np.array([0.82, 0.84, 0.87]), np.array([0.93, 0.48, 0.08])


def draw_chain(
    scene: Scene, process: RewardProcess, mu: np.ndarray, source: int, beads: Sequence[int]
) -> None:
    """Its graph. Tiles are the fuller of colour the more probable their state is under mu (X,);
    the balls of states that are left for good are gray. The ribbons of state `source` are blue,
    with beads on those to the states in `beads`."""
    scene.camera((0.0, -1.1, 1.95), (0.0, -0.1, 0.0))
    where, P = process.places, process.P
    tints = np.clip(EMPTY + np.sqrt(mu)[:, None] * (FULL - EMPTY), 0.0, 1.0)
    for x, (place, name) in enumerate(zip(where, process.table.states, strict=True)):
        corner = place - [TILE_SIZE / 2, TILE_SIZE / 2, 0.0]
        scene.cells(f"tile {x + 1}", corner, TILE_SIZE, tints[x, None, None])
        color: Color = "muted" if process.transient[x] else "actual"
        scene.sphere(f"state {x + 1}", place + LOW, 0.045, color)
        scene.label(f"name {x + 1}", f"{x + 1} {name}", place + BELOW)
    scene.surface("transitions", *_transition_strip(process, source, tuple(beads)))
    for y in beads:
        place = bead_place(where, source, y, P[source, y])
        scene.handle(f"bead {y + 1}", place + LOW, 0.05)
        scene.label(f"chance {y + 1}", f"{P[source, y]:.2g}", place + ABOVE)


@lru_cache(16)
def _transition_strip(
    process: RewardProcess, source: int, beads: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Points and colours (2, columns, 3) of all ribbons; the same in most frames."""
    shown = process.P > 0.0
    if beads:
        shown[source, beads] = True
    strip, of = ribbons(process.places, process.P, shown)
    tones = np.where(of[:, None] == source, BLUE, GRAY)
    return strip, np.stack([tones, tones])
