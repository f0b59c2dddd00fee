"""A motion in pieces that need not join yet, as the iterates of collocation and multiple shooting
have it."""

from dataclasses import dataclass

import numpy as np

from labs.models.mechanisms import Mechanism


@dataclass(frozen=True, eq=False)
class PiecewiseTrajectory:
    """k pieces of the same duration. Piece i starts at state i and ends where the dynamics lead
    it; what is missing to state i + 1 is its gap. Arrays are never written into again."""

    T: float
    """[s]"""
    X: np.ndarray
    """(k + 1, nx)"""
    ends: np.ndarray
    """(k, nx)"""
    U: np.ndarray
    """(k, 2, nu): the control where a piece starts and ends, linear in between."""

    @property
    def pieces(self) -> int:
        return len(self.ends)

    @property
    def times(self) -> np.ndarray:
        """(k + 1,) [s]"""
        return np.linspace(0.0, self.T, self.pieces + 1)

    @property
    def gaps(self) -> np.ndarray:
        """(k, nx): x_(i+1) less where piece i ends."""
        return np.asarray(self.X[1:] - self.ends)

    def state(self, t: float) -> np.ndarray:
        """x (nx,) at t [s], from state to state, linear in between."""
        place = min(max(t / self.T, 0.0), 1.0) * self.pieces
        i = min(int(place), self.pieces - 1)
        return np.asarray(self.X[i] + (place - i) * (self.X[i + 1] - self.X[i]))

    def states(self, mechanism: Mechanism, times: np.ndarray) -> np.ndarray:
        """X (n, nx) at `times` [s]: cubic from state to state, with the slopes that the dynamics
        have there."""
        h = self.T / self.pieces
        place = np.clip(times / h, 0.0, self.pieces)
        i = np.minimum(place.astype(int), self.pieces - 1)
        begin, end = (
            h * mechanism.derivatives(X, self.U[:, side])[0]
            for side, X in enumerate((self.X[:-1], self.X[1:]))
        )
        s = (place - i)[:, None]
        rise = self.X[i + 1] - self.X[i]
        bend = (1.0 - s) * (begin[i] - rise) + s * (rise - end[i])
        return np.asarray(self.X[i] + s * rise + s * (1.0 - s) * bend)

    def mean_controls(self, edges: np.ndarray) -> np.ndarray:
        """(n, nu): the mean control between each two of the n + 1 ascending `edges` [s]; beyond
        the end the last one lasts."""
        h, (begin, end) = self.T / self.pieces, self.U.swapaxes(0, 1)
        total = np.concatenate([np.zeros((1, begin.shape[1])), np.cumsum(h * (begin + end) / 2, 0)])
        inside = np.minimum(edges, self.T)
        i = np.minimum((inside / h).astype(int), self.pieces - 1)
        since = (inside - i * h)[:, None]
        impulse = total[i] + since * (begin[i] + 0.5 * since / h * (end[i] - begin[i]))
        impulse += (edges - inside)[:, None] * end[-1]
        return np.asarray(np.diff(impulse, axis=0) / np.diff(edges)[:, None])

    def arcs(self, points: int) -> np.ndarray:
        """(k, points, nx): the pieces, straight from where each starts to where it ends."""
        s = np.linspace(0.0, 1.0, points)[:, None]
        return np.asarray(self.X[:-1, None] + s * (self.ends - self.X[:-1])[:, None])
