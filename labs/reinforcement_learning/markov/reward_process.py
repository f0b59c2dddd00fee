"""What a table, a policy and a few edits leave of it: a Markov reward process (notes, 3.3)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from labs.algorithms.markov_chain import (
    CommunicatingClass,
    CostToGo,
    communicating_classes,
    cost_to_go,
    eigenvalues,
    long_run_distribution,
)
from labs.reinforcement_learning.markov.chains import (
    replace_rows,
    set_probability,
    shift_probability,
)
from labs.reinforcement_learning.markov.graph import probability_at, state_places
from labs.tasks.mdp_table.table import MdpTable


@dataclass(frozen=True)
class ChainEdit:
    """Changes to a chain without controls: rows in the place of its own, by the number of the
    state from 0; then one probability shifted. What does not fit changes nothing."""

    rows: Mapping[int, np.ndarray]
    source: int
    target: int
    shift: float


@dataclass(frozen=True, eq=False)
class RewardProcess:
    """<X, P, C> under a policy, and what follows from it."""

    table: MdpTable
    policy: np.ndarray
    """(X, U) pi(u | x)."""
    unedited: np.ndarray
    """(X, X) P before any edit."""
    P: np.ndarray
    C: np.ndarray
    """(X,)."""
    classes: list[CommunicatingClass]
    long_run: np.ndarray
    """(X, X): shares of time in the long run, by the state of the start."""
    places: np.ndarray
    """(X, 3) [m] of the states in the scene."""

    def can_edit(self, *states: int) -> bool:
        """Whether these states exist, in a chain without controls: it can be edited there."""
        return len(self.table.controls) == 1 and max(states) < len(self.P)

    @cached_property
    def transient(self) -> np.ndarray:
        """(X,) bool: the states that are left for good sooner or later."""
        stays = np.concatenate([c.states for c in self.classes if c.closed])
        return ~np.isin(np.arange(len(self.P)), stays)

    @cached_property
    def eigenvalues(self) -> np.ndarray:
        """(X,) of P."""
        return eigenvalues(self.P)

    def cost_to_go(self, gamma: float) -> CostToGo:
        """V (X,) of the policy."""
        return cost_to_go(self.P, self.C, gamma, self.classes)

    def action_values(self, gamma: float, V: np.ndarray) -> np.ndarray:
        """(X, U): Q(x, u) = C(x, u) + gamma E[V(x')], one control and then what V (X,) says."""
        values: np.ndarray = self.table.C + gamma * (self.table.P @ V).T
        return values

    def bead_targets(self, x: int, y: int) -> list[int]:
        """The states to which beads lead from x: where it goes, and y; none where x, or any of
        its probabilities, cannot be edited."""
        if not self.can_edit(x):
            return []
        leads = self.unedited[x] + self.P[x] > 0.0
        leads[y : y + 1] = True
        return [int(z) for z in np.flatnonzero(leads)]

    def row_with_bead_at(self, x: int, y: int, point: np.ndarray) -> np.ndarray:
        """(X,): row x with its probability of y where a bead dragged to `point` (3,) [m] says."""
        p = probability_at(self.places, x, y, point)
        return set_probability(self.P[x], y, p, self.unedited[x])


def reward_process(table: MdpTable, first: float, edit: ChainEdit) -> RewardProcess:
    """Of the policy that in every state takes the first control with this probability; the
    others share what is left."""
    X, U = table.C.shape
    policy = np.full((X, U), (1.0 - first) / max(U - 1, 1))
    policy[:, 0] = first if U > 1 else 1.0
    mdp = table.mdp(1.0)
    P = own = mdp.transition_matrix(policy)
    if U == 1:
        P = replace_rows(own, edit.rows)
        x, y = edit.source, edit.target
        if max(x, y) < X and edit.shift != 0.0:
            P[x] = set_probability(P[x], y, shift_probability(P[x, y], edit.shift), own[x])
    classes = communicating_classes(P)
    C = mdp.policy_cost(policy)
    return RewardProcess(
        table, policy, own, P, C, classes, long_run_distribution(P, classes), state_places(X)
    )
