"""TD(0) with a nonlinear approximator that diverges on-policy: the spiral of Tsitsiklis and Van Roy
("An analysis of temporal-difference learning with function approximation", IEEE Transactions on
Automatic Control 42, 1997, section X).

Three states in a circle, each of which stays or goes on with probability 1/2; all costs are 0, so
that the true value is 0. The approximator has one weight w; V(w) moves along a curve in R^3,

    dV/dw = (Q + eps I) V,    V(0) = (10, -7, -3)

    P = [1/2  0  1/2]    Q = [ 1  1/2 3/2]
        [1/2 1/2  0 ]        [3/2  1  1/2]
        [ 0  1/2 1/2]        [1/2 3/2  1 ]

In the plane where the three values sum to 0, V(w) turns by sqrt(3)/2 and grows by the factor e^eps
per unit of w: a spiral, which comes to the truth as w goes to -inf. The mean step of TD(0) is

    dw/dt = 1/3 (dV/dw)' (gamma P - I) V = 1/3 |V|^2 (3 gamma / 8 - eps (1 - gamma / 4))

outwards where gamma > 8 eps / (3 + 2 eps). Monte Carlo's is -eps |V|^2 / 3: it comes to the truth.

A training has, besides what every one has, of S learners with one weight each:

    w (S,)  random (S, 4)      error, path (S, k)   sqrt of the value error, and w, so far
"""

import numpy as np

from labs.arrays import Training
from labs.compiled import compiled
from labs.problems.episodes import UpdateRule, step_size
from labs.random_numbers import random_integer, random_states, uniform
from labs.reinforcement_learning.function_approximation.params import (
    ITERATIONS,
    LEARNERS,
    ApproximationParams,
)
from labs.resumable import Resumable

EPS = 0.05
TURN_RATE = np.sqrt(3.0) / 2.0
"""[rad] per unit of w."""
INITIAL_VALUES = np.array([10.0, -7.0, -3.0])
"""V(0)."""
QUARTER_TURN_VALUES = np.array(
    [
        INITIAL_VALUES[1] - INITIAL_VALUES[2],
        INITIAL_VALUES[2] - INITIAL_VALUES[0],
        INITIAL_VALUES[0] - INITIAL_VALUES[1],
    ]
) / np.sqrt(3.0)
"""V(0) after a quarter of a turn: V(w) =
e^(eps w) (cos(TURN_RATE w) INITIAL_VALUES - sin(TURN_RATE w) QUARTER_TURN_VALUES)."""
P = np.array([[0.5, 0.0, 0.5], [0.5, 0.5, 0.0], [0.0, 0.5, 0.5]])
Q = np.array([[1.0, 0.5, 1.5], [1.5, 1.0, 0.5], [0.5, 1.5, 1.0]])
DIVERGENCE_LIMIT = 300.0
"""A value beyond this has diverged: the weight stays at the one before."""


def spiral_values(w: np.ndarray) -> np.ndarray:
    """V (..., 3) of weights (...)."""
    w = np.asarray(w, float)[..., None]
    return np.asarray(
        np.exp(EPS * w)
        * (np.cos(TURN_RATE * w) * INITIAL_VALUES - np.sin(TURN_RATE * w) * QUARTER_TURN_VALUES)
    )


def divergence_threshold() -> float:
    """The discount beyond which TD(0) goes outwards."""
    return 8.0 * EPS / (3.0 + 2.0 * EPS)


def initial_training(params: ApproximationParams, rng: np.random.Generator) -> Training:
    """At V(0)."""
    return {
        "w": np.zeros(LEARNERS),
        "random": random_states(rng, LEARNERS),
        "steps": np.zeros(1),
        "error": value_error(np.zeros(LEARNERS))[:, None],
        "path": np.zeros((LEARNERS, 1)),
        "sound": np.array(True),
    }


def learn(params: ApproximationParams, training: Training) -> Resumable[Training]:
    """The next hundredth of the updates."""
    part = max(1, round(params.updates / ITERATIONS))
    w, random = training["w"].copy(), training["random"].copy()
    done = int(training["steps"][-1])
    rule = UpdateRule(params.alpha, params.omega, limit=DIVERGENCE_LIMIT)
    sound = update_weights(w, random, rule, params.gamma, params.bootstrap, part, done)
    yield from ()
    return {
        "w": w,
        "random": random,
        "steps": np.append(training["steps"], float(done + part)),
        "error": np.column_stack([training["error"], value_error(w)]),
        "path": np.column_stack([training["path"], w]),
        "sound": np.array(bool(sound.all())),
    }


def value_error(w: np.ndarray) -> np.ndarray:
    """sqrt of the value error (...) of weights (...)."""
    return np.asarray(np.linalg.norm(spiral_values(w), axis=-1) / np.sqrt(3.0))


@compiled
def _value(w: float, x: int) -> float:
    return float(
        np.exp(EPS * w)
        * (
            np.cos(TURN_RATE * w) * INITIAL_VALUES[x]
            - np.sin(TURN_RATE * w) * QUARTER_TURN_VALUES[x]
        )
    )


@compiled
def update_weights(
    weights: np.ndarray,
    random: np.ndarray,
    rule: UpdateRule,
    gamma: float,
    bootstrap: bool,
    updates: int,
    done: int,
) -> np.ndarray:
    """The weights (S,) after so many further updates, `done` of which were made before; changed in
    place, as are the generators (S, 4). Whether each of them is sound (S,)."""
    sound = np.ones(len(weights), np.bool_)
    for s in range(len(weights)):
        w = weights[s]
        for n in range(done + 1, done + updates + 1):
            x = random_integer(random[s], 3)
            y = x if uniform(random[s]) < 0.5 else (x + 2) % 3
            v = _value(w, x)
            turned = (
                np.sin(TURN_RATE * w) * INITIAL_VALUES[x]
                + np.cos(TURN_RATE * w) * QUARTER_TURN_VALUES[x]
            )
            slope = EPS * v - TURN_RATE * np.exp(EPS * w) * turned
            target = gamma * _value(w, y) if bootstrap else 0.0
            moved = w + step_size(rule, n) * (target - v) * slope
            largest = max(abs(_value(moved, 0)), abs(_value(moved, 1)), abs(_value(moved, 2)))
            if not largest <= rule.limit:
                sound[s] = False
                break
            w = moved
        weights[s] = w
    return sound


def in_plane(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two coordinates (...) of values (..., 3) that sum to 0: along V(0) and across it."""
    length = np.linalg.norm(INITIAL_VALUES)
    return values @ INITIAL_VALUES / length, values @ QUARTER_TURN_VALUES / length
