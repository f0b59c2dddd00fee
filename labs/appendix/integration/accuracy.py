"""What an integration method makes of a pendulum: its errors, its cost and its largest step.

A method is named by a text: "semi" is semi-implicit Euler, a name of
`labs.algorithms.runge_kutta.TABLEAUS` that tableau, anything else a tableau spelt out. All
results are kept, so that what did not change is not computed again.
"""

from functools import lru_cache

import numpy as np

from labs.algorithms.absolute_stability import (
    StabilityFunction,
    bisect_stability_limit,
    largest_stable_step,
    stability_boundary,
)
from labs.algorithms.butcher_tableau import Tableau, parse_tableau
from labs.algorithms.discretisation import linear_step
from labs.algorithms.integrators import semi_implicit_euler
from labs.algorithms.runge_kutta import TABLEAUS, RungeKuttaStep, runge_kutta_step
from labs.appendix.integration.convergence import (
    OneStepMethod,
    exact_solution,
    global_errors,
    local_errors,
)
from labs.models.pendulums import Pendulum, pendulum

DURATION, STEP_COUNTS = 0.5, (10, 20, 40, 80, 160, 320)
"""[s] and numbers of steps of the study of errors."""
STEP_SIZES = DURATION / np.array(STEP_COUNTS)
LOCAL_ERROR_TIME = 0.2
"""[s] where the local errors are taken: in mid-swing."""
SHORTEST_STEP, LONGEST_STEP, HIGHEST_GROWTH = 1e-4, 2.0, 2.5
"""Steps [s] between which a limit is looked for, and the growth shown."""
REGION_RADIUS = 4.0
"""Of the region of stability shown."""
GROWTH_STEPS = np.geomspace(0.02, LONGEST_STEP, 160)


@lru_cache(maxsize=64)
def tableau_of(text: str) -> Tableau:
    """The named one, or the one the text spells."""
    return TABLEAUS[text] if text in TABLEAUS else parse_tableau(text)


@lru_cache(maxsize=64)
def one_step_method(text: str, rods: int, friction: float) -> OneStepMethod:
    """One step of a method."""
    plant = pendulum(rods, friction)
    if text != "semi":
        tableau, field = tableau_of(text), plant.vector_field
        return lambda x, t, h: runge_kutta_step(tableau, field, x, t, h)

    def semi_implicit(x: np.ndarray, t: float, h: float) -> RungeKuttaStep:
        q, v = semi_implicit_euler(plant.acceleration, x[:rods], x[rods:], h)
        return RungeKuttaStep(np.concatenate([q, v]), 1, 0, 0.0, "")

    return semi_implicit


@lru_cache(maxsize=4)
def _exact_motion(rods: int, friction: float, start: float) -> tuple[np.ndarray, ...]:
    """x(DURATION), x(s) and (k, 2 nq) x(s + h) for h of STEP_SIZES, s = LOCAL_ERROR_TIME."""
    field = pendulum(rods, friction).vector_field
    x = np.zeros(2 * rods)
    x[0] = start
    s = LOCAL_ERROR_TIME
    middle = exact_solution(field, x, 0.0, s)
    ends = np.array([exact_solution(field, middle, s, s + h) for h in STEP_SIZES])
    return exact_solution(field, middle, s, DURATION), middle, ends


@lru_cache(maxsize=64)
def errors_and_limit(
    text: str, rods: int, friction: float, start: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Global errors (k,), local errors (k,), costs (k,) and the largest step [s] of a method."""
    advance = one_step_method(text, rods, friction)
    end, middle, ends = _exact_motion(rods, friction, start)
    x = np.zeros(2 * rods)
    x[0] = start
    with np.errstate(all="ignore"):
        errors, costs = global_errors(advance, x, end, DURATION, STEP_COUNTS)
        local = local_errors(advance, middle, LOCAL_ERROR_TIME, ends, STEP_SIZES)
        limit = _largest_stable_step(text, rods, friction)
    return errors, local, costs, limit


@lru_cache(maxsize=64)
def _largest_stable_step(text: str, rods: int, friction: float) -> float:
    """The step [s] beyond which a small swing grows; LONGEST_STEP where none does, 0 where all do,
    however slowly."""
    plant = pendulum(rods, friction)
    if text != "semi":
        found = largest_stable_step(StabilityFunction.of(tableau_of(text)), plant.eigenvalues)
    else:
        found = bisect_stability_limit(
            lambda h: _semi_implicit_growth(plant, h), SHORTEST_STEP, LONGEST_STEP
        )
    return min(found, LONGEST_STEP)


@lru_cache(maxsize=64)
def growth_of_step(text: str, rods: int, friction: float) -> np.ndarray:
    """(160,) what one step of GROWTH_STEPS multiplies a small swing by, no more than
    HIGHEST_GROWTH: max |R(h lambda)|, or for semi-implicit Euler the spectral radius of its
    linear step."""
    plant = pendulum(rods, friction)
    if text == "semi":
        found = np.array([_semi_implicit_growth(plant, h) for h in GROWTH_STEPS])
    else:
        found = StabilityFunction.of(tableau_of(text)).spectral_radius(
            GROWTH_STEPS, plant.eigenvalues
        )
    capped: np.ndarray = np.minimum(np.nan_to_num(found, nan=HIGHEST_GROWTH), HIGHEST_GROWTH)
    return capped


def _semi_implicit_growth(plant: Pendulum, h: float) -> float:
    """The spectral radius of one step of h [s] near rest."""
    linear = plant.jacobian(np.zeros(2 * plant.model.nv), 0.0)
    no_input = np.zeros((len(linear), 0))
    transition, _ = linear_step("semi-implicit-euler", h, linear, no_input)
    return float(np.abs(np.linalg.eigvals(transition)).max())


@lru_cache(maxsize=64)
def stability_region_edge(text: str) -> np.ndarray:
    """The edge of the region of stability, complex, as far as REGION_RADIUS."""
    return stability_boundary(StabilityFunction.of(tableau_of(text)), REGION_RADIUS)
