"""What is measured in the lab of TD(lambda): the mean error of 100 learners over their first
episodes, point by point: over all step sizes, for every n or lambda.

All settings meet the same episodes. A sweep has three parts: the setting of now, both methods over
all step sizes, and the whole family of the first method."""

from collections.abc import Generator, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from labs.algorithms import prediction
from labs.algorithms.prediction import Predictors
from labs.lab import Snapshot
from labs.problems.episodes import UpdateRule
from labs.reinforcement_learning.td_lambda.params import (
    LAMBDA_METHODS,
    METHOD_NUMBERS,
    TdLambdaParams,
)
from labs.reinforcement_learning.td_lambda.tasks import PredictionPlace

ALPHAS = np.array([0, 2, 4, 6, 8, *range(10, 101, 5)]) / 100.0
"""Denser where Monte Carlo is at its best."""
N_VALUES = (1, 2, 4, 8, 16, 32, 64, 128)
LAMBDA_VALUES = (0.0, 0.4, 0.8, 0.9, 0.95, 0.975, 0.99, 1.0)
"""Of the family; those of figures 7.2 and 12.3 of Sutton and Barto, but for n = 256 and 512."""
LEARNERS = 100
CHUNK_STEPS = 40_000
"""Steps learned from at once: some milliseconds."""
MAX_RELATIVE_ERROR = 10.0
"""Times the error of having learned nothing: larger errors, of learners that diverge, are given as
that."""

SweepErrors = Mapping[str, Mapping[str, str | np.ndarray]]
"""By the part: "key", which says of what, and "errors" (k,), those measured so far, in order."""
EMPTY_SWEEP: SweepErrors = {
    part: {"key": "", "errors": np.zeros(0)} for part in ("here", "own", "family")
}


class SweepPart(NamedTuple):
    """What is to be measured."""

    key: str
    rules: list[tuple[str, UpdateRule]]
    """A method's name and its rule for every point."""


def family_values(method: str) -> tuple[float, ...]:
    """The n or lambda of each curve of a method; one number without a meaning if it has neither."""
    if method == "n-step":
        return N_VALUES
    return LAMBDA_VALUES if method in LAMBDA_METHODS else (0.0,)


def family_names(method: str) -> tuple[str, ...]:
    """The same in words."""
    if method == "n-step":
        return tuple(f"n = {n}" for n in N_VALUES)
    return tuple(f"λ = {lam:g}" for lam in LAMBDA_VALUES) if method in LAMBDA_METHODS else ("any",)


@lru_cache(maxsize=4)
def sweep_parts(params: TdLambdaParams) -> Mapping[str, SweepPart]:
    """The parts of the sweep under these parameters, in order."""
    general = (*params.place_key, params.episodes, params.offline)
    own = (*general, *params.methods, round(params.n), params.lam)
    rules = {name: params.rule(name) for name in params.methods}
    first = rules[params.method]
    members = [
        first._replace(n=int(value)) if params.method == "n-step" else
        first._replace(trace_decay=float(value))
        for value in family_values(params.method)
    ]  # fmt: skip
    return {
        "here": SweepPart(repr((*own, params.alpha)), list(rules.items())),
        "own": SweepPart(
            repr(own), [(m, r) for name in rules for m, r in _rules_by_alpha(name, rules[name])]
        ),
        "family": SweepPart(
            repr((*general, params.method)),
            [point for rule in members for point in _rules_by_alpha(params.method, rule)],
        ),
    }


def _rules_by_alpha(method: str, rule: UpdateRule) -> list[tuple[str, UpdateRule]]:
    return [(method, rule._replace(alpha=float(alpha))) for alpha in ALPHAS]


def known_errors(sweep: SweepErrors, part: str, wanted: SweepPart) -> np.ndarray:
    """(k,) the errors of a part known so far; none if they are about something else."""
    there = sweep[part]
    errors = there["errors"] if there["key"] == wanted.key else np.zeros(0)
    assert isinstance(errors, np.ndarray)
    return errors


def run_sweep(
    params: TdLambdaParams, seed: np.ndarray, sweep: SweepErrors
) -> Iterator[Snapshot | None]:
    """Measures what is not known yet, a point an iteration."""
    parts = sweep_parts(params)
    known = {name: known_errors(sweep, name, part) for name, part in parts.items()}
    total = sum(len(part.rules) for part in parts.values())
    place, episodes = params.place, round(params.episodes)
    learners = prediction.init(place.task, LEARNERS, np.random.default_rng(seed))
    left = [
        (name, point) for name, part in parts.items() for point in part.rules[len(known[name]) :]
    ]
    for i, (name, (method, rule)) in enumerate(left, 1):
        error = yield from mean_error(place, METHOD_NUMBERS[method], rule, learners, episodes)
        known = {**known, name: np.append(known[name], error)}
        data = {part: {"key": parts[part].key, "errors": known[part]} for part in parts}
        last = i == len(left)
        done = f"{total} settings measured, {LEARNERS} learners of {episodes} episodes each."
        yield Snapshot(i, data, done if last else "", 1.0 - (len(left) - i) / total)
    if not left:
        yield Snapshot(1, sweep, f"All {total} settings had been measured.", 1.0)


def mean_error(
    place: PredictionPlace, method: int, rule: UpdateRule, learners: Predictors, episodes: int
) -> Generator[None, None, float]:
    """The mean error after each of the first episodes; yields None in between."""
    several = max(1, int(CHUNK_STEPS / (episodes * min(place.mean_steps, place.task.task.horizon))))
    errors = []
    for first in range(0, len(learners.V), several):
        if first:
            yield None
        some = _select_learners(learners, slice(first, first + several))
        errors.append(prediction.step(place.task, rule, method, some, episodes).errors)
    return float(min(np.concatenate(errors).mean(), MAX_RELATIVE_ERROR * place.initial_error))


def _select_learners(learners: Predictors, which: slice) -> Predictors:
    names = ("V", "visits", "random", "errors", "lengths", "bounded")
    return replace(learners, **{name: getattr(learners, name)[which] for name in names})
