"""Finite Markov decision processes as arrays (notes, 3.3.3): <X, U, P, C, gamma>.

With X states and U controls, numbered from 0,

    P[u, x, y] = Pr(x_(t+1) = y | x_t = x, u_t = u),    C[x, u] = l(x, u),    gamma in [0, 1],

and V(x) = E[sum over k of gamma^k l(x_k, u_k)] is a cost-to-go: it is minimised. Dynamics are
either such a P or, where nothing is left to chance, a table y = successor[x, u]. Where each control
leads to K states at most, P may be written for those only, P[u, x, k] that of outcomes[u, x, k].
A terminal state ends an episode: it leads to itself and costs nothing.

Not every state need have every control: `available` says which it has. The others are there for
the tables to be full, and do exactly what one of those it has does.

A policy is either (X,) integers, u = pi(x), or (X, U) probabilities pi(u | x).
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

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
    """(U, X, X) probabilities of the next state, or (U, X, K) of the states in ..."""
    outcomes: np.ndarray | None = None
    """(U, X, K) int32; the same state may stand there twice."""
    available: np.ndarray | None = None
    """(X, U) bool: which controls a state has; None: all."""

    def __post_init__(self) -> None:
        _check_costs(self)
        if (self.successor is None) == (self.P is None):
            raise LabError("an MDP has either a table of successors or probabilities P, not both")
        if self.successor is not None:
            _check_successors(self, self.successor)
        if self.P is not None:
            _check_probabilities(self, self.P)
        if self.available is not None and not (
            self.available.shape == self.C.shape and self.available.any(axis=1).all()
        ):
            raise LabError(
                f"available has shape (X, U) = {self.C.shape}: every state has a control"
            )

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
        if self.P is not None and self.outcomes is None:
            return self.P
        P = np.zeros((self.U, self.X, self.X))
        if self.P is not None and self.outcomes is not None:
            at = np.indices(self.P.shape)
            np.add.at(P, (at[0], at[1], self.outcomes), self.P)
            return P
        for u, y in enumerate(self.successors.T):
            P[u, np.arange(self.X), y] = 1.0
        return P

    @property
    def successors(self) -> np.ndarray:
        """The table (X, U) int32. Raises LabError where chance has a say."""
        if self.successor is None:
            raise LabError("this MDP leaves the next state to chance: it has no successor table")
        return self.successor

    def expected_value(self, V: np.ndarray) -> np.ndarray:
        """(X, U): E[V(x') | x, u], V (X,) finite."""
        if self.successor is not None:
            return np.asarray(V[self.successor])
        assert self.P is not None
        if self.outcomes is None:
            return np.asarray((self.P @ V).T)
        return np.asarray(np.einsum("uxk,uxk->xu", self.P, V[self.outcomes]))

    @cached_property
    def cumulative(self) -> np.ndarray:
        """(U, X, K) sums of P along each row, for sampling: with r uniform in [0, 1), the next
        state is the first y (of the outcomes) with r < cumulative[u, x, y]. From the last y on
        that can be next the sums are exactly 1."""
        return cumulative_sums(self.probabilities if self.P is None else self.P)

    def sample(self, x: int, u: int, random: Callable[[], float]) -> int:
        """The next state; `random` draws evenly from [0, 1), once where chance has a say."""
        if self.successor is not None:
            return int(self.successor[x, u])
        k = int(np.searchsorted(self.cumulative[u, x], random(), side="right"))
        return k if self.outcomes is None else int(self.outcomes[u, x, k])

    def transition_matrix(self, policy: np.ndarray) -> np.ndarray:
        """P^pi (X, X): of the Markov chain that remains under a policy."""
        if self.outcomes is not None:
            return np.asarray(self.sparse_chain(policy).toarray())
        weights = self._weights(policy)
        if self.successor is None:
            return np.asarray(np.einsum("xu,uxy->xy", weights, self.probabilities))
        matrix = np.zeros((self.X, self.X))
        np.add.at(matrix, (np.arange(self.X)[:, None], self.successor), weights)
        return matrix

    def sparse_chain(self, policy: np.ndarray) -> csr_array:
        """The same (X, X), of an MDP with outcomes, where most of it is 0."""
        assert self.P is not None
        assert self.outcomes is not None
        x = np.indices(self.P.shape)[1]
        share = self.P * self._weights(policy).T[:, :, None]
        some = share > 0.0
        return csr_array((share[some], (x[some], self.outcomes[some])), shape=(self.X, self.X))

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
            ahead: np.ndarray = np.zeros(self.X, bool)
            if self.successor is not None:
                ahead[self.successor[fresh]] = True
            elif self.P is not None and self.outcomes is not None:
                ahead[self.outcomes[:, fresh][self.P[:, fresh] > 0.0]] = True
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
            leads = (self.expected_value(found.astype(float)) > 0.0).any(axis=1)
            if not (leads & ~found).any():
                return found
            found |= leads

    def describe(self, starts: Iterable[int]) -> str:
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
    """(X, U): every control a state has alike."""
    if mdp.available is None:
        return np.full((mdp.X, mdp.U), 1.0 / mdp.U)
    return np.asarray(mdp.available / mdp.available.sum(axis=1, keepdims=True))


def cumulative_sums(probabilities: np.ndarray) -> np.ndarray:
    """(..., k) sums of probabilities (..., k) along their rows, for sampling: from the last entry
    on that is not 0 they are exactly 1, whatever rounding makes of them."""
    count = probabilities.shape[-1]
    sums: np.ndarray = np.cumsum(probabilities, axis=-1)
    last = count - 1 - (probabilities[..., ::-1] > 0.0).argmax(axis=-1)
    sums[np.arange(count) >= last[..., None]] = 1.0
    return sums


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
    dense = (mdp.U, mdp.X, mdp.X)
    ahead = np.broadcast_to(np.arange(mdp.X), dense) if mdp.outcomes is None else mdp.outcomes
    if P.shape != ahead.shape or P.shape[:-1] != dense[:-1]:
        raise LabError(f"P has shape (U, X, X) = {dense}; given: {P.shape}")
    if ((ahead < 0) | (ahead >= mdp.X)).any():
        raise LabError(f"outcomes holds {ahead.min()} to {ahead.max()}: states below {mdp.X} go")
    wrong = np.argwhere(~(P >= 0.0))
    if len(wrong):
        u, x, k = wrong[0]
        raise LabError(
            f"from state {x} to state {ahead[u, x, k]} under control {u} the probability is "
            f"{P[u, x, k]:g}: it must be a number from 0 to 1"
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
    # Not "but for rounding": whoever can leave does so in the end.
    out = (P[:, ends] > 0.0) & (ahead[:, ends] != ends[:, None])
    left = np.argwhere(out.any(axis=2))
    if len(left):
        u, i = left[0]
        raise LabError(_left(ends[i], u))


def _left(x: int, u: int) -> str:
    return f"state {x} is terminal, yet control {u} leads out of it: it must lead back to {x}"
