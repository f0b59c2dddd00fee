"""One learner at work in the scene, a step at a time: TD(0) learns from each step as it is done,
Monte Carlo from all of them once the episode has ended.

The steps are drawn as those of the many learners are, and learned from by the same rules."""

from dataclasses import dataclass, replace

import numpy as np

from labs.algorithms.monte_carlo import every_visit, first_visit
from labs.algorithms.temporal_difference import td0
from labs.problems.episodes import UpdateRule, initial_state
from labs.problems.prediction import Episode, sample_step
from labs.reinforcement_learning.prediction.worlds import PredictionWorld

REST = 1.0
"""Steps' time that the walker rests at the end of an episode."""


@dataclass(frozen=True, eq=False)
class LiveLearner:
    """Where the walker is, and what it has come to. Its arrays are never written into."""

    states: np.ndarray
    """(T + 2,) int64: of the episode so far, and where the step under way leads."""
    controls: np.ndarray
    """(T + 1,) int64."""
    V: np.ndarray
    """(2, X) of Monte Carlo and of TD(0)."""
    visits: np.ndarray
    """(2, X) int32."""
    random: np.ndarray
    """(4,) uint64."""
    phase: float = 0.0
    """The part of the step under way that is done, in [0, 1 + REST)."""
    episodes: int = 0
    """Ended so far."""

    @property
    def over(self) -> bool:
        """Whether the step under way was the last one, and has been learned from."""
        return self.phase >= 1.0


def start_live_learner(world: PredictionWorld, random: np.ndarray, v0: float) -> LiveLearner:
    """At the start of the first episode. `random` (4,) stays as it is."""
    V = np.tile(np.where(world.mdp.terminal, 0.0, v0), (2, 1))
    return _new_episode(world, V, np.zeros(V.shape, np.int32), random.copy(), 0)


def advance_live_learner(
    world: PredictionWorld,
    rules: tuple[UpdateRule, UpdateRule],
    first: bool,
    live: LiveLearner,
    part: float,
) -> LiveLearner:
    """The learner when another `part` in [0, 1] of a step is done."""
    phase = live.phase + part
    if live.over:
        if phase < 1.0 + REST:
            return replace(live, phase=phase)
        return _new_episode(world, live.V, live.visits, live.random.copy(), live.episodes)
    if phase < 1.0:
        return replace(live, phase=phase)
    live = _learn_step(world, rules, first, live)
    y = int(live.states[-1])
    if world.mdp.terminal[y] or len(live.controls) >= world.task.task.horizon:
        return replace(live, phase=1.0, episodes=live.episodes + 1)
    random = live.random.copy()
    u, ahead = sample_step(world.task, y, random)
    return replace(
        live,
        states=np.append(live.states, ahead),
        controls=np.append(live.controls, u),
        random=random,
        phase=phase - 1.0,
    )


def _new_episode(
    world: PredictionWorld, V: np.ndarray, visits: np.ndarray, random: np.ndarray, episodes: int
) -> LiveLearner:
    """`random` changes in place."""
    x = initial_state(world.task.task, random)
    u, y = sample_step(world.task, x, random)
    return LiveLearner(np.array([x, y]), np.array([u]), V, visits, random, 0.0, episodes)


def _learn_step(
    world: PredictionWorld, rules: tuple[UpdateRule, UpdateRule], first: bool, live: LiveLearner
) -> LiveLearner:
    """What the step that was just done teaches."""
    V, visits, gamma, T = live.V.copy(), live.visits.copy(), world.mdp.gamma, len(live.controls)
    td0(gamma, _last_steps(world, live, 1), 1, rules[1], V[1], visits[1])
    if world.mdp.terminal[live.states[-1]]:
        update = first_visit if first else every_visit
        update(gamma, _last_steps(world, live, T), T, True, rules[0], V[0], visits[0])
    return replace(live, V=V, visits=visits)


def _last_steps(world: PredictionWorld, live: LiveLearner, many: int) -> Episode:
    """As an episode."""
    states, controls = live.states[-many - 1 :], live.controls[-many:]
    costs = np.ascontiguousarray(world.mdp.C[states[:-1], controls])
    return Episode(states, controls, costs, np.empty(many))
