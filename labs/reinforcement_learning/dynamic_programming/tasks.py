"""Problems for dynamic programming that can be watched: a walker on a grid world, and a pendulum
that looks its torque up in a table.

A problem is known by a text (JSON), so that what was computed for it can say which one it was.
"""

import json
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from labs.algorithms import backward_recursion, policy_evaluation
from labs.algorithms.policy_iteration import optimum
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.reinforcement_learning.dynamic_programming.side_by_side import RANDOM, Standing, start
from labs.tasks.grid_world.map import GridWorld
from labs.tasks.pendulum_table.table import PendulumGrid, advance, pendulum_grid

HORIZON = 40
"""Steps to go at most."""
TICK = 0.01
"""[s]"""
MOVE, PAUSE = 30, 100
"""Ticks of a walker's step, and of a rest before it starts anew."""
LOST = 120
"""Steps after which a walker starts anew."""
TRAIL = 300
"""Places kept of a path."""


@dataclass(frozen=True, eq=False)
class Problem:
    """An MDP, what it stands for, and its exact solution."""

    mdp: FiniteMDP
    place: GridWorld | PendulumGrid

    @cached_property
    def initial(self) -> np.ndarray:
        """pi_0 (X,): RANDOM on a grid, the motor off on a pendulum."""
        control = RANDOM if isinstance(self.place, GridWorld) else self.mdp.U // 2
        return np.full(self.mdp.X, control, np.int16)

    @cached_property
    def limits(self) -> np.ndarray:
        """(4, X): what each of METHODS goes to, V^(pi_0) and three times V*."""
        best, _ = self.solution
        return np.stack([policy_evaluation.exact(self.mdp, self._first), best, best, best])

    @cached_property
    def solution(self) -> tuple[np.ndarray, np.ndarray]:
        """V* (X,) and an optimal policy (X,)."""
        V, policy, _ = optimum(self.mdp, self._first)
        return V, policy

    @cached_property
    def distance(self) -> np.ndarray:
        """(X,): from each state straight to the goal [cells; rad], walls or not."""
        if isinstance(self.place, PendulumGrid):
            return np.asarray(np.abs(self.place.nodes[:, 0] - np.pi))
        goals = self.place.cells[self.mdp.terminal]
        apart = self.place.cells[:, None] - goals[None]
        return np.asarray(np.linalg.norm(apart, axis=2).min(axis=1))

    @property
    def efforts(self) -> np.ndarray:
        """(U,) [N m]: the torque of each control; 0 where nothing is driven."""
        if isinstance(self.place, PendulumGrid):
            return np.asarray(self.place.torques[:, 0])
        return np.zeros(self.mdp.U)

    @property
    def start(self) -> int:
        """Where an episode begins: S, or hanging at rest."""
        if isinstance(self.place, GridWorld):
            return self.place.start
        return int(self.place.state(np.zeros(1), np.zeros(1)))

    @property
    def _first(self) -> np.ndarray:
        """pi_0 as the algorithms take it."""
        if isinstance(self.place, GridWorld):
            return random_policy(self.mdp)
        return self.initial.astype(np.int64)


@lru_cache(maxsize=6)
def problem(key: str) -> Problem:
    """The problem a text describes."""
    told: dict[str, Any] = json.loads(key)
    gamma = told["gamma"]
    if "map" in told:
        world = GridWorld.parse(told["map"], told["kings"])
        return Problem(world.mdp(gamma, told["slip"]), world)
    grid = pendulum_grid(
        q_nodes=told["nodes"], v_nodes=told["nodes"], levels=told["levels"], torque=told["torque"]
    )
    return Problem(grid.mdp(gamma, 1.0, told["w_v"], told["w_u"]), grid)


def grid_key(text: str, kings: bool, slip: float, gamma: float) -> str:
    """Of a grid world."""
    return json.dumps({"map": text, "kings": kings, "slip": slip, "gamma": gamma})


def pendulum_key(
    nodes: int, levels: int, torque: float, w_v: float, w_u: float, gamma: float
) -> str:
    """Of a pendulum."""
    told = {"nodes": nodes, "levels": levels, "torque": torque, "w_v": w_v, "w_u": w_u}
    return json.dumps(told | {"gamma": gamma})


@lru_cache(maxsize=4)
def finite_horizon(key: str, w_f: float) -> tuple[np.ndarray, np.ndarray]:
    """V (HORIZON + 1, X) and policies (HORIZON, X) by the steps to go, with the final cost w_f
    times the straight distance to the goal."""
    found = problem(key)
    return backward_recursion.tables(found.mdp, w_f * found.distance, HORIZON)


def afresh(key: str, seed: int, spread: float) -> Standing:
    """Before the first sweep: values drawn from [0, spread], the same for all methods."""
    found = problem(key)
    V = np.random.default_rng(seed).uniform(0.0, spread, found.mdp.X)
    V[found.mdp.terminal] = 0.0
    none = np.zeros(found.mdp.X, np.int16)
    policy = np.stack([found.initial, found.initial, none, none])
    return start(found.mdp, np.tile(V, (4, 1)), policy, found.limits)


def carried(at: Standing, old: str, new: str, fresh: Standing) -> Standing:
    """Before the first sweep on a new problem, from the values found on an old one with the same
    cells or the same grid of angles and velocities; `fresh` where they do not fit."""
    before, after, mdp = problem(old).place, problem(new).place, problem(new).mdp
    V, policy = at.V, fresh.policy.copy()
    if isinstance(before, GridWorld) and isinstance(after, GridWorld):
        if before.shape != after.shape:
            return fresh
        laid = np.stack([before.on_map(row) for row in V])
        V = np.where(mdp.terminal, 0.0, laid[:, after.cells[:, 0], after.cells[:, 1]])
    elif type(before) is not type(after) or V.shape != fresh.V.shape:
        return fresh
    if at.policy.shape == policy.shape and at.policy[1].max() < mdp.U:
        policy[1] = at.policy[1]  # policy iteration goes on from the policy it has
    return start(mdp, V, policy, problem(new).limits)


# In motion ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Walk:
    """Where the walker or the pendulum is."""

    at: np.ndarray
    """(2,): (row, column) of the cell it comes from, or (q, v) [rad, rad/s]."""
    to: np.ndarray
    """(2,): the cell it goes to, or the node where the table sees the pendulum next; where
    nothing is under way the same as `at`."""
    path: np.ndarray
    """(k, 2) where it has been since the start, the last TRAIL places."""
    u: int = 0
    """The present control."""
    tick: int = 0
    """Ticks since it was chosen."""
    steps: int = 0
    """Controls chosen since the start."""
    paid: float = 0.0
    """Discounted cost of those."""
    drawn: int = 0
    """Random numbers used since t = 0."""
    resting: int = 0
    """Ticks left until it starts anew."""


def begin(found: Problem, drawn: int = 0) -> Walk:
    """At the start."""
    if isinstance(found.place, GridWorld):
        at = found.place.cells[found.start].astype(float)
    else:
        at = np.zeros(2)
    return Walk(at, at, at[None], drawn=drawn)


def fits(found: Problem, walk: Walk) -> bool:
    """Whether both cells are still there."""
    return isinstance(found.place, PendulumGrid) or all(
        0 <= r < found.place.shape[0]
        and 0 <= c < found.place.shape[1]
        and found.place.index[r, c] >= 0
        for r, c in (walk.at.astype(int), walk.to.astype(int))
    )


def state_of(found: Problem, where: np.ndarray) -> int:
    """The state of a place (2,) as in `Walk`."""
    if isinstance(found.place, GridWorld):
        row, column = where.astype(int)
        return int(found.place.index[row, column])
    return int(found.place.state(where[:1], where[1:]))


def tick(found: Problem, walk: Walk, policy: np.ndarray | None, seed: int) -> Walk:
    """TICK [s] later. `policy` (X,) says what to do at the next choice; None: nothing is left to
    do."""
    if walk.resting:
        if walk.resting == 1:
            return begin(found, walk.drawn)
        walk = replace(walk, resting=walk.resting - 1)
    elif walk.tick == 0:
        x = state_of(found, walk.at)
        over = found.mdp.terminal[x] or policy is None
        if over or (walk.steps >= LOST and isinstance(found.place, GridWorld)):
            walk = replace(walk, resting=PAUSE)
        else:
            assert policy is not None
            walk = _choose(found, walk, x, int(policy[x]), seed)
    if isinstance(found.place, PendulumGrid):
        return _swing(found.place, walk)
    if walk.resting:
        return walk
    if walk.tick + 1 < MOVE:
        return replace(walk, tick=walk.tick + 1)
    return replace(walk, at=walk.to, tick=0, path=np.vstack([walk.path, walk.to])[-TRAIL:])


def _choose(found: Problem, walk: Walk, x: int, u: int, seed: int) -> Walk:
    rng, mdp = np.random.default_rng((seed, walk.drawn)), found.mdp
    if u == RANDOM:
        u = int(rng.integers(mdp.U))
    paid = walk.paid + mdp.gamma**walk.steps * float(mdp.C[x, u])
    chosen = replace(walk, u=u, paid=paid, steps=walk.steps + 1, drawn=walk.drawn + 1)
    if mdp.successor is not None:
        y = int(mdp.successor[x, u])
    else:
        y = int((rng.random() >= mdp.cumulative[u, x]).sum())
    if isinstance(found.place, PendulumGrid):
        return replace(chosen, to=found.place.nodes[y])
    return replace(chosen, to=found.place.cells[y].astype(float))


def _swing(grid: PendulumGrid, walk: Walk) -> Walk:
    torque = np.zeros(1) if walk.resting else grid.torques[walk.u]
    q, v = advance(walk.at[:1], walk.at[1:], torque, grid.friction, TICK)
    at = np.concatenate([q, v])
    due = (walk.tick + 1) % round(grid.dt / TICK) if not walk.resting else 0
    to = walk.to if due else at
    return replace(walk, at=at, to=to, tick=due, path=np.vstack([walk.path, at])[-TRAIL:])


def nudged(found: Problem, walk: Walk, seed: int) -> Walk:
    """After a push: the pendulum gets 4 rad/s, a walker finds itself in some other cell."""
    if isinstance(found.place, PendulumGrid):
        at = walk.at + np.array([0.0, 4.0])
        return replace(walk, at=at, to=at)
    x = int(np.random.default_rng((seed, walk.drawn)).choice(np.flatnonzero(~found.mdp.terminal)))
    at = found.place.cells[x].astype(float)
    return Walk(at, at, at[None], drawn=walk.drawn + 1)


def rollout(found: Problem, policies: np.ndarray) -> np.ndarray:
    """(k, 2) cells from the start on, were nothing left to chance, under one policy (X,) or, from
    N steps to go down to 1, policies (N, X) by the steps to go less one."""
    assert isinstance(found.place, GridWorld)
    successor, _ = found.place.table
    x, path = found.start, [found.start]
    stationary = policies.ndim == 1
    for k in range(LOST if stationary else len(policies), 0, -1):
        if found.mdp.terminal[x]:
            break
        policy = policies if stationary else policies[k - 1]
        x = int(successor[x, policy[x]])
        path.append(x)
    return found.place.cells[path]
