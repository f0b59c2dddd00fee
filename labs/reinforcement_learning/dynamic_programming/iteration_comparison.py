"""Four iterations of dynamic programming on one MDP, sweep by sweep, from the same start.

    evaluation   iterative policy evaluation of a given policy pi_0      -> V^(pi_0)
    policy       policy iteration from pi_0                              -> V*
    modified     modified policy iteration with m evaluations            -> V*
    value        value iteration                                         -> V*

Sweep k of one stands beside sweep k of the others, with its distance to its limit in the max
norm. A pass makes one sweep of each that is not done, later ones a few, so that the first can be
watched one by one and the last do not take long.
"""

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from labs.algorithms import policy_evaluation, policy_iteration, value_iteration
from labs.algorithms.bellman import NO_ERROR_BOUND, Sweep, unbounded_message
from labs.number_texts import count_text
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.rounding import round_up

ITERATION_METHODS = {
    "evaluation": "Policy evaluation",
    "policy": "Policy iteration",
    "modified": "Modified policy iteration",
    "value": "Value iteration",
}
SINGLE_SWEEPS, SHARE, MAX_BATCH = 60, 20, 100
"""Sweeps made one a pass; after those a pass makes one for each SHARE made so far, at most
MAX_BATCH and ..."""
BACKUPS_PER_PASS = 500_000
"""... no more than about as many as take so many backups in each method."""
MAX_SWEEPS = 10_000
"""Sweeps after which an iteration is given up."""
FAILED = NOT_BEGUN, GIVEN_UP = "Not begun", "Given up"
"""How the sentence of an iteration begins that has not converged."""
SMALLEST_SHOWN = 1e-12
"""What a curve shows of an error of 0, on a logarithmic axis."""
RANDOM_CONTROL = -1
"""In place of controls: all alike."""


@dataclass(frozen=True)
class IterationSettings:
    """How to iterate."""

    m: int
    """Evaluations of modified policy iteration."""
    tolerance: float
    """An iteration is done when a sweep changes no value by more than this."""


@dataclass(frozen=True, eq=False)
class Iterates:
    """Where the four stand, in the order of ITERATION_METHODS; each sweep has arrays of its own."""

    V: np.ndarray
    """(4, X)."""
    policy: np.ndarray
    """(4, X) int16; RANDOM_CONTROL throughout where the even random policy is followed."""
    count: np.ndarray
    """(4,) sweeps."""
    evaluations: np.ndarray
    """(4,) as in `bellman.Sweep`."""
    errors: np.ndarray
    """(k + 1, 4) distance to the limit after 0, 1, ..., k sweeps; its last value where an
    iteration ended earlier, 0 where it never began."""
    backups: np.ndarray
    """(k + 1, 4) made after as many sweeps."""
    done: tuple[str, ...]
    """Four sentences, empty while it goes on."""

    @property
    def over(self) -> bool:
        """Whether all are done."""
        return all(self.done)

    @property
    def stop_reason(self) -> str:
        """In a sentence once all are done, else empty: whether all have converged, and how near
        they came to their limits, which are known."""
        if not self.over:
            return ""
        short = [
            f"{name}: {done[0].lower()}{done[1:]}"
            for name, done in zip(ITERATION_METHODS.values(), self.done, strict=True)
            if done.startswith(FAILED)
        ]
        if short:
            return " ".join(short)
        left = f"the largest distance left is {round_up(self.errors[-1].max())}."
        if any(NO_ERROR_BOUND in done for done in self.done):
            return f"All four iterations have stopped; {NO_ERROR_BOUND}: {left}"
        return f"All four iterations have converged: {left}"

    @property
    def started(self) -> np.ndarray:
        """(4,) bool: which of them have values to show for it, before or after the first sweep."""
        return np.array([not done.startswith(NOT_BEGUN) for done in self.done])


def initial_iterates(
    mdp: FiniteMDP, V: np.ndarray, policy: np.ndarray, limits: np.ndarray
) -> Iterates:
    """Before the first sweep. V (4, X); policy (4, X), of which the first two are followed to
    begin with; limits (4, X), infinite where there is none: such an iteration does not begin."""
    done = tuple(_not_begun_message(limit) for limit in limits)
    if not done[1] and mdp.gamma == 1.0:
        first = policy_evaluation.exact_values(mdp, unpack_policy(mdp, policy[1]))
        done = (done[0], _not_begun_message(first, "under the policy it starts from"), *done[2:])
    fresh = np.zeros((1, 4), np.int64)
    errors = _distances(V, limits)[None]
    return Iterates(V, policy, fresh[0], np.array([0, 1, 0, 0]), errors, fresh, done)


def run_passes(
    mdp: FiniteMDP, at: Iterates, settings: IterationSettings, limits: np.ndarray
) -> Iterator[tuple[Iterates, np.ndarray]]:
    """The passes after `at` until all are done, none if they are; with the wall-clock time (4,)
    [s] each pass took."""
    while not at.over:
        at, seconds = _run_pass(mdp, at, settings, limits)
        yield at, seconds


def progress(at: Iterates, tolerance: float) -> float | None:
    """The part done in [0, 1] of the one farthest behind, by the decades its error has come down;
    None while only policy iteration is left, of which nobody knows how many policies it will
    look at."""
    if at.over:
        return 1.0
    parts = []
    for i, method in enumerate(ITERATION_METHODS):
        first, now = at.errors[0, i], at.errors[-1, i]
        if method != "policy" and not at.done[i] and first > tolerance:
            part = math.log(first / max(now, tolerance)) / math.log(first / tolerance)
            parts.append(min(max(part, 0.0), 1.0))
    return min(parts, default=None)


def _run_pass(
    mdp: FiniteMDP, at: Iterates, settings: IterationSettings, limits: np.ndarray
) -> tuple[Iterates, np.ndarray]:
    made = len(at.errors) - 1
    affordable = max(1, BACKUPS_PER_PASS // (mdp.X * mdp.U))
    sweeps = 1 if made < SINGLE_SWEEPS else min(made // SHARE, MAX_BATCH, affordable)
    sweeps = min(sweeps, MAX_SWEEPS - made)
    errors = np.vstack([at.errors, np.tile(at.errors[-1], (sweeps, 1))])
    backups = np.vstack([at.backups, np.tile(at.backups[-1], (sweeps, 1))])
    ends, done, seconds = [], list(at.done), np.zeros(4)
    for i, method in enumerate(ITERATION_METHODS):
        sweep = _sweep_of_method(mdp, at, i)
        for k in range(made + 1, made + 1 + sweeps):
            if sweep.done:
                break
            begin = time.perf_counter()
            sweep = _step(method, mdp, sweep, settings)
            seconds[i] += time.perf_counter() - begin
            errors[k:, i] = np.abs(sweep.V - limits[i]).max()
            backups[k:, i] = sweep.backups
        done[i] = sweep.done
        if made + sweeps >= MAX_SWEEPS and not sweep.done:
            done[i] = f"{GIVEN_UP} after {MAX_SWEEPS} sweeps."
        ends.append(sweep)
    iterates = Iterates(
        V=np.stack([sweep.V for sweep in ends]),
        policy=np.stack([_pack_policy(sweep.policy) for sweep in ends]),
        count=np.array([sweep.count for sweep in ends]),
        evaluations=np.array([sweep.evaluations for sweep in ends]),
        errors=errors,
        backups=backups,
        done=tuple(done),
    )
    return iterates, seconds


def _step(method: str, mdp: FiniteMDP, at: Sweep, settings: IterationSettings) -> Sweep:
    match method:
        case "evaluation":
            return policy_evaluation.step(mdp, at, settings.tolerance)
        case "policy":
            return policy_iteration.step(mdp, at, math.inf, settings.tolerance)
        case "modified":
            return policy_iteration.step(mdp, at, settings.m, settings.tolerance)
        case _:
            return value_iteration.step(mdp, at, settings.tolerance)


def _sweep_of_method(mdp: FiniteMDP, at: Iterates, i: int) -> Sweep:
    return Sweep(
        V=at.V[i],
        policy=unpack_policy(mdp, at.policy[i]),
        count=int(at.count[i]),
        backups=int(at.backups[-1, i]),
        evaluations=int(at.evaluations[i]),
        done=at.done[i],
    )


def _pack_policy(policy: np.ndarray) -> np.ndarray:
    if policy.ndim == 2:
        return np.full(len(policy), RANDOM_CONTROL, np.int16)
    return policy.astype(np.int16)


def unpack_policy(mdp: FiniteMDP, policy: np.ndarray) -> np.ndarray:
    """A row (X,) of `Iterates.policy` as the algorithms take it: controls (X,), or where it is
    RANDOM_CONTROL the even probabilities (X, U)."""
    return random_policy(mdp) if policy[0] == RANDOM_CONTROL else policy.astype(np.int64)


def _distances(V: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """(4,) in the max norm; 0 where a limit is infinite."""
    with np.errstate(invalid="ignore"):
        found = np.abs(V - limits).max(axis=1)
    return np.where(np.isfinite(found), found, 0.0)


def _not_begun_message(limit: np.ndarray, why: str = "") -> str:
    message = unbounded_message(limit, why)
    return f"{NOT_BEGUN}: {message}" if message else ""


def convergence_curves(at: Iterates, gamma: float, most: int) -> dict[str, np.ndarray]:
    """For each method its distance to the limit ("error_...") over sweeps ("sweep_...") and over
    backups ("backups_..."), at `most` places and none where it is not started; and the bound
    gamma^k |V_0 - V*|."""
    found = {}
    for i, method in enumerate(ITERATION_METHODS):
        last = int(at.count[i])
        places = np.unique(np.rint(np.linspace(0, last, min(last + 1, most))).astype(int))
        places = places[: len(places) * at.started[i]]
        found[f"sweep_{method}"] = places.astype(float)
        found[f"error_{method}"] = np.maximum(at.errors[places, i], SMALLEST_SHOWN)
        found[f"backups_{method}"] = at.backups[places, i].astype(float)
    found["bound"] = gamma ** found["sweep_value"] * at.errors[0, -1]
    return found


def iteration_report(at: Iterates, seconds: Mapping[str, object]) -> str:
    """What each took, a line a method. `seconds` by method, as far as they are known."""
    lines = []
    for i, (method, name) in enumerate(ITERATION_METHODS.items()):
        spent = seconds.get(method)
        took = f", {1e3 * spent:.3g} ms" if isinstance(spent, float) and spent else ""
        lines.append(
            f"{name}: {count_text(int(at.count[i]), 'sweep')}, "
            f"{count_text(int(at.backups[-1, i]), 'backup')}{took}. "
            f"{at.done[i] or 'On its way.'}"
        )
    return "\n".join(lines)
