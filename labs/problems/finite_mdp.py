"""Finite Markov decision processes as arrays (notes, 3.3.3): <X, U, P, C, gamma>.

With X states and U controls, numbered from 0,

    P[u, x, y] = Pr(x_(t+1) = y | x_t = x, u_t = u),    C[x, u] = l(x, u),    gamma in [0, 1],

and V(x) = E[sum over k of gamma^k l(x_k, u_k)] is a cost-to-go: it is minimised. Dynamics are
either such a P or, where nothing is left to chance, a table y = successor[x, u]. A terminal
state ends an episode: it leads to itself and costs nothing.

A policy is either (X,) integers, u = pi(x), or (X, U) probabilities pi(u | x).
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from labs.errors import LabError

ROUNDING = 1e-9
"""How far a row of probabilities may be from summing to 1."""


@dataclass(frozen=True, eq=False)
class FiniteMDP:
    """A finite Markov decision process; its arrays are never written into.

    Raises LabError, naming the state and the control, where they do not fit together."""

    C: np.ndarray
    """(X, U) cost of a control in a state."""
    gamma: float
    """Discount of the cost of the next step, in [0, 1]."""
    terminal: np.ndarray
    """(X,) bool."""
    successor: np.ndarray | None = None
    """(X, U) int32: the next state; or else"""
    P: np.ndarray | None = None
    """(U, X, X) probabilities of the next state."""

    def __post_init__(self) -> None:
        _check_costs(self)
        if (self.successor is None) == (self.P is None):
            raise LabError("an MDP has either a table of successors or probabilities P, not both")
        if self.successor is not None:
            _check_successors(self, self.successor)
        if self.P is not None:
            _check_probabilities(self, self.P)

    @property
    def X(self) -> int:
        """Number of states."""
        return int(self.C.shape[0])

    @property
    def U(self) -> int:
        """Number of controls."""
        return int(self.C.shape[1])

    @property
    def deterministic(self) -> bool:
        """Whether the dynamics are a table of successors."""
        return self.successor is not None

    @cached_property
    def largest_cost(self) -> float:
        """max |C(x, u)|."""
        return float(np.abs(self.C).max())

    @cached_property
    def probabilities(self) -> np.ndarray:
        """P (U, X, X), also of a deterministic MDP: for small ones."""
        if self.P is not None:
            return self.P
        P = np.zeros((self.U, self.X, self.X))
        for u, y in enumerate(self.successors.T):
            P[u, np.arange(self.X), y] = 1.0
        return P

    @property
    def successors(self) -> np.ndarray:
        """The table (X, U) int32. Raises LabError where chance has a say."""
        if self.successor is None:
            raise LabError("this MDP leaves the next state to chance: it has no successor table")
        return self.successor

    @cached_property
    def cumulative(self) -> np.ndarray:
        """(U, X, X) sums of P along each row, for sampling: with r uniform in [0, 1), the next
        state is the first y with r < cumulative[u, x, y]. From the last y on that can be next
        the sums are exactly 1."""
        sums: np.ndarray = np.cumsum(self.probabilities, axis=2)
        last = self.X - 1 - (self.probabilities[..., ::-1] > 0.0).argmax(axis=2)
        sums[np.arange(self.X) >= last[..., None]] = 1.0
        return sums

    def transition_matrix(self, policy: np.ndarray) -> np.ndarray:
        """P^pi (X, X): of the Markov chain that remains under a policy."""
        weights = self._weights(policy)
        if self.successor is None:
            return np.asarray(np.einsum("xu,uxy->xy", weights, self.probabilities))
        matrix = np.zeros((self.X, self.X))
        np.add.at(matrix, (np.arange(self.X)[:, None], self.successor), weights)
        return matrix

    def policy_cost(self, policy: np.ndarray) -> np.ndarray:
        """C^pi (X,): the expected cost of one step under a policy."""
        if policy.ndim == 1:
            cost: np.ndarray = self.C[np.arange(self.X), policy]
        else:
            terms = self._weights(policy) * self.C
            cost = terms.sum(axis=1)
            # Costs that cancel are 0, and not what rounding leaves of them.
            cost[np.abs(cost) <= 4.0 * np.finfo(float).eps * np.abs(terms).sum(axis=1)] = 0.0
        return cost

    def reachable(self, starts: Iterable[int]) -> np.ndarray:
        """(X,) bool: what some controls may lead to from these states, themselves included."""
        found: np.ndarray = np.zeros(self.X, bool)
        found[list(starts)] = True
        fresh = found
        while fresh.any():
            if self.successor is not None:
                ahead: np.ndarray = np.zeros(self.X, bool)
                ahead[self.successor[fresh]] = True
            else:
                ahead = np.any(self.probabilities[:, fresh] > 0.0, axis=(0, 1))
            fresh = ahead & ~found
            found = found | fresh
        return found

    @cached_property
    def can_end(self) -> np.ndarray:
        """(X,) bool: from where some controls may lead to a terminal state."""
        found: np.ndarray = self.terminal.copy()
        while True:
            if self.successor is not None:
                leads = found[self.successor].any(axis=1)
            else:
                leads = (self.probabilities @ found > 0.0).any(axis=0)
            if not (leads & ~found).any():
                return found
            found |= leads

    def report(self, starts: Iterable[int]) -> str:
        """In words: its size, its terminal states, and what cannot be reached from `starts`."""
        lost = int((~self.reachable(starts)).sum())
        return (
            f"{self.X} states and {self.U} controls, {int(self.terminal.sum())} of the states "
            f"terminal, {lost} never reached from the start."
        )

    def _weights(self, policy: np.ndarray) -> np.ndarray:
        """pi(u | x) (X, U) of either kind of policy."""
        if policy.ndim == 1:
            return np.asarray(np.eye(self.U)[policy])
        if policy.shape != self.C.shape or np.abs(policy.sum(axis=1) - 1.0).max() > ROUNDING:
            raise LabError(
                f"a random policy has {self.X} rows of {self.U} probabilities that sum to 1; "
                f"given: shape {policy.shape}"
            )
        return policy


def random_policy(mdp: FiniteMDP) -> np.ndarray:
    """(X, U): every control alike."""
    return np.full((mdp.X, mdp.U), 1.0 / mdp.U)


def _check_costs(mdp: FiniteMDP) -> None:
    if mdp.C.ndim != 2 or 0 in mdp.C.shape:
        raise LabError(f"C has shape (X, U), a row for each state; given: {mdp.C.shape}")
    wrong = np.argwhere(~np.isfinite(mdp.C))
    if len(wrong):
        x, u = wrong[0]
        raise LabError(f"the cost of control {u} in state {x} is {mdp.C[x, u]}: it must be finite")
    if not 0.0 <= mdp.gamma <= 1.0:
        raise LabError(f"gamma = {mdp.gamma}: a discount is a number from 0 to 1")
    if mdp.terminal.shape != (mdp.X,) or mdp.terminal.dtype != bool:
        raise LabError(
            f"terminal has one true or false for each of {mdp.X} states; "
            f"given: {mdp.terminal.dtype} {mdp.terminal.shape}"
        )
    costly = np.argwhere(mdp.terminal[:, None] & (mdp.C != 0.0))
    if len(costly):
        x, u = costly[0]
        raise LabError(
            f"state {x} is terminal, yet control {u} costs {mdp.C[x, u]:g} there: 0 goes"
        )


def _check_successors(mdp: FiniteMDP, table: np.ndarray) -> None:
    if table.shape != mdp.C.shape or table.dtype != np.int32:
        raise LabError(
            f"successor is int32 and as large as C, {mdp.C.shape}; "
            f"given: {table.dtype} {table.shape}"
        )
    wrong = np.argwhere((table < 0) | (table >= mdp.X))
    if len(wrong):
        x, u = wrong[0]
        raise LabError(
            f"control {u} leads from state {x} to {table[x, u]}: states go from 0 to {mdp.X - 1}"
        )
    left = np.argwhere(mdp.terminal[:, None] & (table != np.arange(mdp.X)[:, None]))
    if len(left):
        raise LabError(_left(*left[0]))


def _check_probabilities(mdp: FiniteMDP, P: np.ndarray) -> None:
    if P.shape != (mdp.U, mdp.X, mdp.X):
        raise LabError(f"P has shape (U, X, X) = {(mdp.U, mdp.X, mdp.X)}; given: {P.shape}")
    wrong = np.argwhere(~(P >= 0.0))
    if len(wrong):
        u, x, y = wrong[0]
        raise LabError(
            f"from state {x} to state {y} under control {u} the probability is {P[u, x, y]:g}: "
            "it must be a number from 0 to 1"
        )
    sums = P.sum(axis=2)
    wrong = np.argwhere(~(np.abs(sums - 1.0) <= ROUNDING))
    if len(wrong):
        u, x = wrong[0]
        raise LabError(
            f"from state {x} under control {u} the probabilities sum to {sums[u, x]:.10g}: "
            "each row must sum to 1"
        )
    ends = np.flatnonzero(mdp.terminal)
    out = P[:, ends] > 0.0  # not "but for rounding": whoever can leave does so in the end
    out[:, np.arange(len(ends)), ends] = False
    left = np.argwhere(out.any(axis=2))
    if len(left):
        u, i = left[0]
        raise LabError(_left(ends[i], u))


def _left(x: int, u: int) -> str:
    return f"state {x} is terminal, yet control {u} leads out of it: it must lead back to {x}"
