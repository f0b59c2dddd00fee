"""Walkers on a grid world that follow policies, one or several of them side by side.

At a decision each walker takes the control that its policy has for its cell, and pays for it; the
step then takes `move` periods of the world's clock. Who is at a goal stays there, at no cost. When
a walk has lasted long enough, and begins anew, is for the lab to say.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from labs.problems.finite_mdp import FiniteMDP
from labs.tasks.grid_world.cells import CellWorld

PATH_LENGTH = 300
"""Cells kept of a walk."""


@dataclass(frozen=True, eq=False)
class GridWalk:
    """Where M walkers are. Its arrays are never written into."""

    at: np.ndarray
    """(M, 2) int: the cell (row, column) each comes from."""
    to: np.ndarray
    """(M, 2) int: the cell it goes to; the same where no step is under way."""
    cost: np.ndarray
    """(M,) discounted cost since the start."""
    path: np.ndarray
    """(k, M, 2) int: the cells since the start, the last PATH_LENGTH of them."""
    move: int
    """Periods of a step."""
    steps: int = 0
    """Decisions since the start."""
    idle: int = 0
    """How many of the last ones found all walkers at a goal."""
    clock: int = 0
    """Periods since the last decision; 0: the next one is due."""


def start_walk(world: CellWorld, move: int, walkers: int = 1, start: int | None = None) -> GridWalk:
    """At the start of the map, or in the state `start`, before the first decision."""
    at = np.tile(world.cells[world.start if start is None else start], (walkers, 1))
    return GridWalk(at, at, np.zeros(walkers), at[None], move)


def is_valid_walk(world: CellWorld, walk: GridWalk) -> bool:
    """Whether the cells of a walk are states of this world: its map may have changed."""
    return all(world.state(cell) >= 0 for cell in (*walk.at, *walk.to))


def choose_steps(
    world: CellWorld,
    mdp: FiniteMDP,
    policies: np.ndarray,
    walk: GridWalk,
    random: Callable[[], float],
) -> GridWalk:
    """The decision that is due. `policies` (M, X) holds each walker's controls; `random` draws
    evenly from [0, 1), once a walker where the next state is left to chance."""
    # Where the map was changed under a walker, it is back at the start.
    found = [world.state(cell) for cell in walk.at]
    states = [world.start if x < 0 else x for x in found]
    controls = [int(policy[x]) for policy, x in zip(policies, states, strict=True)]
    ahead = [mdp.sample(x, u, random) for x, u in zip(states, controls, strict=True)]
    return replace(
        walk,
        at=world.cells[states],
        to=world.cells[ahead],
        cost=walk.cost + mdp.gamma**walk.steps * mdp.C[states, controls],
        steps=walk.steps + 1,
        idle=walk.idle + 1 if mdp.terminal[states].all() else 0,
    )


def advance_walk(walk: GridWalk) -> GridWalk:
    """One period later."""
    clock = (walk.clock + 1) % walk.move
    if clock:
        return replace(walk, clock=clock)
    path = np.concatenate([walk.path, walk.to[None]])[-PATH_LENGTH:]
    return replace(walk, at=walk.to, path=path, clock=0)


def nominal_path(world: CellWorld, policies: np.ndarray | Sequence[np.ndarray]) -> np.ndarray:
    """(k, 2) cells from the start on, were nothing left to chance: under one policy (X,) to a goal
    or to where the way comes again; or, from N steps to go down to 1, under policies (N, X) by
    the steps to go less one."""
    successor = world.nominal
    policies = np.asarray(policies)
    stationary = policies.ndim == 1
    x, path = world.start, [world.start]
    while not world.terminal[x] and (stationary or len(path) <= len(policies)):
        policy = policies if stationary else policies[-len(path)]
        x = int(successor[x, policy[x]])
        if stationary and x in path:
            break
        path.append(x)
    return world.cells[path]
