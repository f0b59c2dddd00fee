"""A game: strategies play the same thousand tasks, and what that comes to turn by turn.

Where only what was learned counts, a test follows the lessons: as many turns again, each at the
door of least Q, and Q stands still.

A game is a mapping of arrays, P strategies on M tasks of K doors each, after t turns:

    begun                      the means (M, K) at first, and the generators (M, 2, 4) of all luck
    q, visits (P, M, K)        what the players expect, how often they chose what
    tried (P, M, K)            the same, of the lessons alone: what Q was learned from
    means (P, M, K)            the true means as they are now
    largest, regret (P, M)     the largest |cost| met, the regret so far
    random (P, M, 2, 4)        the generators as they are now: of the players, of the tasks
    regrets, best (P, t)       mean regret after each turn; share of the tasks in which the best
                               door was chosen
    costs (P,)                 mean cost of the last turn
    after, simple (k,) (P, k)  turns after each batch, and the mean regret of one more turn by
                               whoever would then take the door that seems best: what was learned
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from labs.algorithms.bandits import Bandits, Players, gaussian_testbed, init, step
from labs.algorithms.exploration import BehaviourPolicy
from labs.problems.episodes import UpdateRule
from labs.reinforcement_learning.bandits.params import TASK_COUNT, BanditParams
from labs.resumable import Resumable, split_work

Game = Mapping[str, np.ndarray]
GREEDY, NO_LEARNING = BehaviourPolicy(epsilon=0.0), UpdateRule(alpha=0.0)
"""In the test."""
OPERATIONS_PER_ARM = 20
"""Operations for a door of a task at each turn, at most about."""
_PLAYER_ARRAYS = ("q", "visits", "means", "largest", "regret")


def initial_game(params: BanditParams, rng: np.random.Generator) -> Game:
    """The tasks before the first turn."""
    means = gaussian_testbed(TASK_COUNT, 10, rng).means
    if params.world == "doors":
        means = np.tile([params.left, params.right], (TASK_COUNT, 1))
    players = init(bandits_of(params, means), rng, params.q0)
    begun = {"begun": means, "luck": np.stack([players.random, players.task_random], axis=1)}
    return reset_game(params, begun)


def reset_game(params: BanditParams, game: Mapping[str, np.ndarray]) -> Game:
    """The same tasks and the same luck, before the first turn."""
    means, luck = game["begun"], game["luck"]
    players = len(params.strategies)
    shape, none = (players, *means.shape), np.zeros((players, 0))
    return {
        "begun": means,
        "luck": luck,
        "q": np.full(shape, params.q0),
        "visits": np.zeros(shape, np.int32),
        "tried": np.zeros(shape, np.int32),
        "means": np.stack([means] * players),
        "largest": np.zeros(shape[:2]),
        "regret": np.zeros(shape[:2]),
        "random": np.stack([luck] * players),
        "costs": np.zeros(players),
        "regrets": none,
        "best": none,
        "after": np.zeros(0),
        "simple": none,
    }


def single_task_game(params: BanditParams, game: Game, m: int) -> Game:
    """Task m by itself, before the first turn."""
    return reset_game(params, {name: game[name][m : m + 1] for name in ("begun", "luck")})


def play(params: BanditParams, game: Game, turns: int) -> Resumable[Game]:
    """The game after so many further turns of all."""
    lessons = min(max(params.training_turns - game["regrets"].shape[1], 0), turns)
    for many, test in ((lessons, False), (turns - lessons, True)):
        if many:
            game = yield from _play(params, game, many, test)
    return game


def _play(params: BanditParams, game: Game, turns: int, test: bool) -> Resumable[Game]:
    bandits, rule = bandits_of(params, game["begun"]), NO_LEARNING if test else params.rule
    after = []
    for p, strategy in enumerate(params.strategies):
        measured = params.measured and strategy == "bound" and not test
        behaviour = GREEDY if test else params.behaviour(strategy)
        one, regrets, best = _players(game, p), [], []
        for some in split_work(turns, OPERATIONS_PER_ARM * game["begun"].size):
            one = step(bandits, behaviour, rule, one, some, measured)
            regrets.append(one.regrets)
            best.append(one.best)
            yield
        after.append(replace(one, regrets=np.hstack(regrets), best=np.hstack(best)))
    carried = {name: np.stack([getattr(one, name) for one in after]) for name in _PLAYER_ARRAYS}
    random = np.stack([np.stack([one.random, one.task_random], axis=1) for one in after])
    played = game["regrets"].shape[1] + turns
    return {
        **game,
        **carried,
        "tried": game["tried"] if test else carried["visits"],
        "random": random,
        "costs": np.array([one.costs[-1] for one in after]),
        "regrets": np.hstack([game["regrets"], [one.regrets for one in after]]),
        "best": np.hstack([game["best"], [one.best for one in after]]),
        "after": np.append(game["after"], played),
        "simple": np.hstack([game["simple"], simple_regret(carried)[:, None]]),
    }


def simple_regret(game: Mapping[str, np.ndarray]) -> np.ndarray:
    """(P,) mean of what the door that seems best costs more than the best one."""
    seems = game["q"].argmin(axis=2)[..., None]
    cost = np.take_along_axis(game["means"], seems, axis=2)[..., 0]
    mean: np.ndarray = (cost - game["means"].min(axis=2)).mean(axis=1)
    return mean


def bandits_of(params: BanditParams, means: np.ndarray) -> Bandits:
    """The tasks of these means (M, K)."""
    return Bandits(means, np.full(means.shape, params.deviation), params.drift)


def _players(game: Game, p: int) -> Players:
    none = np.zeros(0)
    carried = {name: game[name][p] for name in _PLAYER_ARRAYS}
    random = np.ascontiguousarray(game["random"][p].transpose(1, 0, 2))
    turns = game["regrets"].shape[1]
    return Players(
        **carried,
        turns=turns,
        random=random[0],
        task_random=random[1],
        costs=none,
        regrets=none,
        best=none,
    )
