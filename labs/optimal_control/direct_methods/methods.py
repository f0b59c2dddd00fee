"""The three direct methods as one thing: a nonlinear programme, variables from a first guess, and
the motion that an iterate stands for."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from labs.algorithms.collocation import Collocation
from labs.algorithms.multiple_shooting import MultipleShooting
from labs.algorithms.single_shooting import SingleShooting
from labs.algorithms.sqp import SqpIterate
from labs.problems.continuous_control import ContinuousProblem
from labs.problems.nonlinear_program import NonlinearProgram
from labs.tasks.direct.guesses import Guess
from labs.tasks.direct.motions import (
    collocation_motion,
    multiple_shooting_motion,
    single_shooting_motion,
)
from labs.tasks.direct.trajectory import PiecewiseTrajectory

TRANSCRIPTIONS: Mapping[str, str] = {
    "single": "Single shooting",
    "multiple": "Multiple shooting",
    "collocation": "Collocation",
}
SHORT_NAMES = ("single", "multiple", "collocation")
"""Where there is little room."""


@dataclass(frozen=True)
class Transcription:
    """A problem as one of TRANSCRIPTIONS makes it finite."""

    program: NonlinearProgram
    variables: Callable[[Guess], np.ndarray]
    """Of a first guess (n,): as much of it as the method takes."""
    motion: Callable[[SqpIterate], PiecewiseTrajectory]
    """Of an iterate, in pieces that join where they are integrated in one go."""
    controls: np.ndarray
    """Which variables are controls (N, nu)."""


def transcribe(problem: ContinuousProblem, N: int, m: int, M: int) -> Mapping[str, Transcription]:
    """By each method, with the control held on N pieces: of M steps of Runge-Kutta 4 in shooting,
    in m segments; each one step of the midpoint rule in collocation."""
    return {
        "single": _single_shooting(SingleShooting(problem, N, M)),
        "multiple": _multiple_shooting(MultipleShooting(problem, N, m, M)),
        "collocation": _collocation(Collocation(problem, N)),
    }


def _single_shooting(shooting: SingleShooting) -> Transcription:
    """Of the guess it takes the controls alone."""
    return Transcription(
        shooting,
        lambda guess: shooting.pack(guess.U, guess.T),
        lambda at: single_shooting_motion(shooting, at.y),
        np.arange(shooting.N * shooting.nu).reshape(shooting.N, shooting.nu),
    )


def _multiple_shooting(shooting: MultipleShooting) -> Transcription:
    return Transcription(
        shooting,
        lambda guess: shooting.variables(*guess),
        lambda at: multiple_shooting_motion(shooting, at.y),
        shooting.segments.controls,
    )


def _collocation(program: Collocation) -> Transcription:
    return Transcription(
        program,
        lambda guess: program.variables(*guess),
        lambda at: collocation_motion(program, at),
        program.grid.controls,
    )
