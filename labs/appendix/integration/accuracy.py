"""What an integration method makes of a pendulum: its errors, its cost and its largest step.

A method is named by a text: "semi" is semi-implicit Euler, a name of
`labs.algorithms.runge_kutta.TABLEAUS` that tableau, anything else a tableau spelt out. All
results are kept, so that what did not change is not computed again.
"""

from functools import lru_cache

import numpy as np

from labs.algorithms.absolute_stability import (
    StabilityFunction,
    boundary,
    measured_limit,
    spectral_radius,
)
from labs.algorithms.integrators import semi_implicit_euler
from labs.algorithms.runge_kutta import TABLEAUS, Step, Tableau, parse, step
from labs.appendix.integration.convergence import Stepper, exact, global_errors, local_errors
from labs.models.pendulums import pendulum

DURATION, COUNTS = 0.5, (10, 20, 40, 80, 160, 320)
"""[s] and numbers of steps of the study of errors."""
LADDER = DURATION / np.array(COUNTS)
LOCAL_FROM = 0.2
"""[s] where the local errors are taken: in mid-swing."""
LONGEST, SMALL, HIGHEST = 2.0, 1e-4, 2.5
"""The search for the limit: longest step [s], size of the deviation; and the growth shown."""
REACH = 4.0
"""Of the region of stability shown."""
GRID = np.geomspace(0.02, LONGEST, 160)


@lru_cache(maxsize=64)
def tableau_of(text: str) -> Tableau:
    """The named one, or the one the text spells."""
    return TABLEAUS[text] if text in TABLEAUS else parse(text)


@lru_cache(maxsize=64)
def stepper_of(text: str, rods: int, friction: float) -> Stepper:
    """One step of a method."""
    plant = pendulum(rods, friction)
    if text != "semi":
        tableau, flow = tableau_of(text), plant.flow
        return lambda x, t, h: step(tableau, flow, x, t, h)

    def semi_implicit(x: np.ndarray, t: float, h: float) -> Step:
        q, v = semi_implicit_euler(plant.acceleration, x[:rods], x[rods:], h)
        return Step(np.concatenate([q, v]), 1, 0, 0.0, "")

    return semi_implicit


@lru_cache(maxsize=4)
def _reference(rods: int, friction: float, start: float) -> tuple[np.ndarray, ...]:
    """x(DURATION), x(LOCAL_FROM) and (k, 2 nq) x(LOCAL_FROM + h) for h of LADDER."""
    flow = pendulum(rods, friction).flow
    x = np.zeros(2 * rods)
    x[0] = start
    middle = exact(flow, x, 0.0, LOCAL_FROM)
    ends = np.array([exact(flow, middle, LOCAL_FROM, LOCAL_FROM + h) for h in LADDER])
    return exact(flow, middle, LOCAL_FROM, DURATION), middle, ends


@lru_cache(maxsize=64)
def errors_and_limit(
    text: str, rods: int, friction: float, start: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Global errors (k,), local errors (k,), costs (k,) and the largest step [s] of a method."""
    advance = stepper_of(text, rods, friction)
    end, middle, ends = _reference(rods, friction, start)
    x = np.zeros(2 * rods)
    x[0] = start
    with np.errstate(all="ignore"):
        errors, costs = global_errors(advance, x, end, DURATION, COUNTS)
        local = local_errors(advance, middle, LOCAL_FROM, ends, LADDER)
        limit = _limit(text, rods, friction)
    return errors, local, costs, limit


@lru_cache(maxsize=64)
def _limit(text: str, rods: int, friction: float) -> float:
    """The step [s] beyond which a small swing grows, found on the method itself by raising it;
    LONGEST where none does."""
    advance = stepper_of(text, rods, friction)

    def growth(h: float) -> float:
        return spectral_radius(lambda x: advance(x, 0.0, h).x, 2 * rods, SMALL)

    return min(measured_limit(growth, float(GRID[0]), LONGEST), LONGEST)


@lru_cache(maxsize=64)
def growth_of(text: str, rods: int, friction: float) -> np.ndarray:
    """(160,) what one step of GRID multiplies a small swing by, no more than HIGHEST: max |R(h
    lambda)|, or for semi-implicit Euler the spectral radius of its linear step."""
    plant = pendulum(rods, friction)
    if text == "semi":
        linear = plant.jacobian(np.zeros(2 * rods), 0.0)
        eye, none = np.eye(rods), np.zeros((rods, rods))
        steps = []
        for h in GRID:
            kick = np.block(
                [[eye, none], [h * linear[rods:, :rods], eye + h * linear[rods:, rods:]]]
            )
            drift = np.block([[eye, h * eye], [none, eye]])
            steps.append(np.abs(np.linalg.eigvals(drift @ kick)).max())
        found = np.array(steps)
    else:
        found = StabilityFunction.of(tableau_of(text)).growth(GRID, plant.eigenvalues)
    capped: np.ndarray = np.minimum(np.nan_to_num(found, nan=HIGHEST), HIGHEST)
    return capped


@lru_cache(maxsize=64)
def edge_of(text: str) -> np.ndarray:
    """The edge of the region of stability, complex, as far as REACH."""
    return boundary(StabilityFunction.of(tableau_of(text)), REACH)
