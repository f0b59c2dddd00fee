"""The race: every method solves the same problem from the same guess, an iteration each in turn."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from labs.algorithms import sqp
from labs.algorithms.sqp import SqpIterate
from labs.optimal_control.direct_methods.methods import TRANSCRIPTIONS, Transcription, transcribe
from labs.optimal_control.direct_methods.params import DirectMethodsParams
from labs.optimal_control.direct_methods.structure import ProgramStructure, program_structure
from labs.resumable import Resumable, run_to_completion
from labs.tasks.direct.guesses import Guess, first_guess, start_guess
from labs.tasks.direct.history import IterationHistory
from labs.tasks.direct.trajectory import PiecewiseTrajectory


@dataclass(frozen=True, eq=False)
class MethodRun:
    """How far one method is. Arrays are never written into again."""

    motion: PiecewiseTrajectory
    history: IterationHistory
    structure: ProgramStructure
    stopped: str = ""
    """Why, in a sentence; empty while it goes on."""
    converged: bool = False
    reusable: bool = False
    """Whether a change may be solved from the motion: it is of a solve that did not fail."""

    @property
    def failed(self) -> bool:
        return bool(self.stopped) and not self.converged


MethodRuns = Mapping[str, MethodRun]
"""By the keys of TRANSCRIPTIONS."""


def initial_runs(params: DirectMethodsParams) -> MethodRuns:
    """Before the first iteration."""
    race = {}
    for name, method in _transcriptions(params).items():
        at = sqp.init(
            method.program, method.variables(first_guess(params, params.N)), params.options
        )
        race[name] = run_to_completion(_initial_run(params, method, at))
    return race


def run_methods(
    params: DirectMethodsParams, before: MethodRuns, seconds: dict[str, float]
) -> Iterator[MethodRuns | None]:
    """The race after each iteration of all that still go on; None within. `seconds` gets what an
    iteration of each took on average [s]."""
    methods = _transcriptions(params)
    iterates, race = dict[str, SqpIterate](), dict[str, MethodRun]()
    total = dict.fromkeys(methods, 0.0)
    for name, method in methods.items():
        guess = start_guess(params, before[name].motion, before[name].reusable, params.N)
        y = method.variables(guess)
        iterates[name] = sqp.init(method.program, y, params.options)
        race[name] = yield from _initial_run(params, method, iterates[name])
    if all(at.stopped for at in iterates.values()):
        yield dict(race)
    while not all(at.stopped for at in iterates.values()):
        for name, method in methods.items():
            at = iterates[name]
            if at.stopped:
                continue
            at = yield from sqp.resumable_step(method.program, params.options, at)
            yield None
            iterates[name] = at
            total[name] += sum(at.seconds.values())
            seconds[name] = total[name] / max(at.iteration, 1)
            race[name] = yield from _updated_run(params, method, race[name], at)
        yield dict(race)


def outcome_message(race: MethodRuns) -> str:
    """How all of them ended, in a line."""
    if all(entrant.converged for entrant in race.values()):
        counts = [
            f"{TRANSCRIPTIONS[name].lower()} {at.history.iterations}" for name, at in race.items()
        ]
        return f"All three converged. Iterations: {', '.join(counts)}."
    return " ".join(
        f"{TRANSCRIPTIONS[name]}: {_short_message(entrant)}" for name, entrant in race.items()
    )


def _short_message(entrant: MethodRun) -> str:
    """The first thing that its sentence says, for there are three of them."""
    if entrant.converged:
        n = entrant.history.iterations
        return f"converged after {n} iteration{'s'[: n != 1]}."
    said = entrant.stopped.split("; ")[0].split(". ")[0].rstrip(".")
    return f"{said[:1].lower()}{said[1:]}."


def _transcriptions(params: DirectMethodsParams) -> Mapping[str, Transcription]:
    return transcribe(params.problem, params.N, params.m, params.M)


def _initial_run(
    params: DirectMethodsParams, method: Transcription, at: SqpIterate
) -> Resumable[MethodRun]:
    """At its first guess; at rest at the start where that diverges."""
    shown = at
    if not np.isfinite(at.values.f):
        task = params.task
        X, U = np.tile(task.x0, (params.N + 1, 1)), np.tile(task.holding, (params.N, 1))
        y = method.variables(Guess(X, U, params.horizon))
        shown = sqp.init(method.program, y, params.options)
    motion = method.motion(shown)
    structure = yield from program_structure(method, shown, params.task.u_0, whole=False)
    return MethodRun(motion, IterationHistory.start(params, shown, motion), structure, at.stopped)


def _updated_run(
    params: DirectMethodsParams, method: Transcription, before: MethodRun, at: SqpIterate
) -> Resumable[MethodRun]:
    """An iteration later; once it has stopped, with all that is told of its programme."""
    motion, structure = method.motion(at), before.structure
    if at.stopped:
        structure = yield from program_structure(method, at, params.task.u_0, whole=True)
    history = before.history.append(params, at, motion)
    return replace(
        before,
        motion=motion,
        history=history,
        structure=structure,
        stopped=at.stopped,
        converged=at.converged,
        reusable=at.reusable,
    )
