"""Many states let loose at once in one closed loop, step by step."""

from dataclasses import dataclass, replace

import numpy as np

from labs.appendix.lyapunov.closed_loop import clip_states
from labs.tasks.phase_plane.systems import SIMULATION_STEP, PlaneSystem

TRAIL_STEPS = 6
"""Steps of the way that is shown behind each state."""
RUN_STEPS = 120
"""Of a run, before all start anew."""


@dataclass(frozen=True, eq=False)
class StateEnsemble:
    """Where M states are, k steps after they were let loose. Arrays are never written into."""

    X: np.ndarray
    """(M, 2)"""
    U: np.ndarray
    """(M, 1) held now."""
    tail: np.ndarray
    """(up to TRAIL_STEPS, M, 2): at the last steps."""
    left: np.ndarray
    """(M,): whether each has left the set."""
    distances: np.ndarray
    """(k + 1, M): |x|"""
    V: np.ndarray
    """(k + 1, M)"""
    clock: int = 0
    """Periods of the world since the law looked."""

    @property
    def k(self) -> int:
        return len(self.V) - 1


def initial_ensemble(starts: np.ndarray) -> StateEnsemble:
    """At `starts` (M, 2), before the law has looked."""
    none = np.empty((0, len(starts)))
    return StateEnsemble(
        starts, np.zeros((len(starts), 1)), starts[None], np.zeros(len(starts), bool), none, none
    )


def hold_controls(
    runs: StateEnsemble, U: np.ndarray, V: np.ndarray, outside: np.ndarray
) -> StateEnsemble:
    """The law has looked and holds U (M, 1); V (M,) now, and which are outside of the set."""
    distances = np.linalg.norm(runs.X, axis=1)
    return replace(
        runs,
        U=U,
        tail=np.concatenate([runs.tail, runs.X[None]])[-TRAIL_STEPS:],
        left=runs.left | outside,
        distances=np.vstack([runs.distances, distances]),
        V=np.vstack([runs.V, V]),
    )


def advance_ensemble(runs: StateEnsemble, system: PlaneSystem, substeps: int) -> StateEnsemble:
    """10 ms later, of `substeps` to the next look."""
    X = clip_states(system.step(runs.X, runs.U, SIMULATION_STEP))
    return replace(runs, X=X, clock=(runs.clock + 1) % substeps)
