"""Numerical integration (notes, A.1 and A.2): one pendulum for each method, side by side."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np
from pydantic import field_validator

from labs.algorithms.absolute_stability import (
    StabilityFunction,
    boundary,
    measured_limit,
    spectral_radius,
)
from labs.algorithms.convergence import Stepper, exact, global_errors, local_errors, slope
from labs.algorithms.integrators import semi_implicit_euler
from labs.algorithms.runge_kutta import (
    TABLEAUS,
    Step,
    Tableau,
    gauss_legendre,
    order,
    order_conditions,
    parse,
    step,
)
from labs.errors import LabError
from labs.lab import Inputs, Lab, Measurement, Snapshot, State
from labs.models.pendulums import GRAY, LENGTH, Pendulum, hanging, pendulum
from labs.params import Params, Value, choice, knob, text
from labs.plots import Bars, Curves, Line, Readout, TimeSeries, Trace
from labs.scene import Scene

METHODS = {
    "euler": "Euler",
    "semi": "Semi-implicit",
    "midpoint": "Midpoint",
    "heun": "Heun",
    "rk3": "RK3",
    "rk4": "RK4",
    "implicit": "Implicit",
    "yours": "Yours",
}
NAMES = tuple(METHODS)
COLORS = tuple(
    tuple(int(code[i : i + 2], 16) / 255 for i in (0, 2, 4))
    for code in ["0068ad", "cf5300", "00875f", "b5518f", "a57c00", "5a5fd0", "8b9097", "1391a6"]
)
"""Of the plots' eight lines."""
SYSTEMS = {"pendulum": "Pendulum", "double-pendulum": "Double pendulum"}
IMPLICIT = {
    "implicit-midpoint": "Implicit midpoint",
    "gauss-legendre": "Gauss-Legendre, 2 stages",
    "implicit-euler": "Implicit Euler",
}
REFERENCE = gauss_legendre(3)
"""Order 6, with steps of 10 ms: what the others are compared with in the scene."""
SPACING = (-0.05, 0.36, 0.0)
"""[m] from the hinge of one pendulum to the next: behind and beside it."""
FASTEST = 40.0
"""[rad/s] a pendulum faster than this has blown up; one that falls from upright makes 11."""
DURATION, COUNTS = 0.5, (10, 20, 40, 80, 160, 320)
"""[s] and numbers of steps of the study of errors."""
LADDER = DURATION / np.array(COUNTS)
LOCAL_FROM = 0.2
"""[s] where the local errors are taken: in mid-swing."""
LONGEST, SMALL, HIGHEST = 2.0, 1e-4, 2.5
"""The search for the limit: longest step [s], size of the deviation; and the growth shown."""
GRID = np.geomspace(0.02, LONGEST, 160)


class IntegrationParams(Params):
    """What the user can turn."""

    system: str = choice(
        "pendulum",
        SYSTEMS,
        label="System",
        group="System",
        effect="restart",
        help="What every method integrates: one rod of half a metre, or two.",
    )
    start: float = knob(
        1.0,
        0.0,
        3.1,
        symbol="q(0)",
        unit="rad",
        label="Start angle",
        group="System",
        step=0.01,
        effect="restart",
        help="Of the first rod from hanging; the second starts in line with it. All start at rest.",
    )
    friction: float = knob(
        0.0,
        0.0,
        5.0,
        symbol="b",
        unit="N·m·s/rad",
        label="Friction",
        group="System",
        scale="log",
        effect="solve",
        help="Viscous, at every hinge. It moves the eigenvalues to the left.",
    )
    h: float = knob(
        0.04,
        0.002,
        1.0,
        symbol="h",
        unit="s",
        label="Step",
        group="Methods",
        scale="log",
        help="Of all methods alike. A pendulum stands still between two steps.",
    )
    implicit: str = choice(
        "implicit-midpoint",
        IMPLICIT,
        label="Implicit method",
        group="Methods",
        effect="solve",
        help="Which one the gray pendulum follows; its stages are found by Newton's method.",
    )
    tableau: str = text(
        "0 |\n1/3 | 1/3\n2/3 | 0 2/3\n| 1/4 0 3/4",
        label="Your tableau",
        group="Methods",
        rows=6,
        effect="solve",
        help="A row a stage, c | a ..., then | b ... at the end. Fractions go, and so do weights "
        "on and above the diagonal (implicit).",
    )

    @field_validator("tableau")
    @classmethod
    def _is_a_tableau(cls, value: str) -> str:
        try:
            parse(value)
        except LabError as error:
            raise ValueError(str(error)) from None
        return value

    @property
    def rods(self) -> int:
        return 2 if self.system == "double-pendulum" else 1

    @property
    def plant(self) -> Pendulum:
        return pendulum(self.rods, self.friction)

    def x0(self) -> np.ndarray:
        """(2 nq,) the start, [rad] and [rad/s]."""
        x = np.zeros(2 * self.rods)
        x[0] = self.start
        return x


@dataclass(kw_only=True)
class IntegrationState(State):
    """Where each method is, and what the study of their errors has found so far. The rows are
    in the order of METHODS."""

    x: np.ndarray
    """(8, 2 nq) the last step of each."""
    reference: np.ndarray
    """(2 nq,) the motion itself, at t."""
    stopped: np.ndarray
    """(8,) whether it has blown up."""
    steps: int = 0
    """World steps done: t = steps * period."""
    clock: float = 0.0
    """[s] the time the methods have reached; behind t by less than h."""
    newton: int = 0
    """Iterations in the last implicit step."""
    global_errors: np.ndarray
    """(8, k) for LADDER; 0 where there is none (yet)."""
    local_errors: np.ndarray
    """(8, k)."""
    costs: np.ndarray
    """(8, k) evaluations of f."""
    limits: np.ndarray
    """(8,) [s] largest step that does not blow up; -1 while unknown, LONGEST where none does."""


class Integration(Lab[IntegrationParams, IntegrationState]):
    """Eight ways to integrate one motion."""

    title = "Numerical integration"
    section = "A.1"
    summary = (
        "Eight methods swing the same pendulum with the same step: their order, their cost, "
        "what they do to energy, and when they blow up."
    )
    Params = IntegrationParams
    period = 0.01
    plots = (
        TimeSeries(
            "Sideways position of the tip",
            "m",
            (
                *(Line(f"tip_{m}", rf"\text{{{name}}}") for m, name in METHODS.items()),
                Line("tip", r"\text{exact}", "limit"),
            ),
        ),
        TimeSeries(
            "Energy drift, decades",
            "log₁₀ of a fall's energy",
            tuple(Line(f"drift_{m}", rf"\text{{{name}}}") for m, name in METHODS.items()),
        ),
        Curves(
            "Global error after half a second",
            tuple(
                Trace("ladder", f"global_{m}", name, "marked", i + 1, f"order_{m}")
                for i, (m, name) in enumerate(METHODS.items())
            ),
            "step h [s]",
            "error",
            log_x=True,
            log_y=True,
        ),
        Curves(
            "Local error of one step",
            tuple(
                Trace("ladder", f"local_{m}", name, "marked", i + 1, f"local_order_{m}")
                for i, (m, name) in enumerate(METHODS.items())
            ),
            "step h [s]",
            "error",
            log_x=True,
            log_y=True,
        ),
        Curves(
            "Global error against cost",
            tuple(
                Trace(f"cost_{m}", f"global_{m}", name, "marked", i + 1)
                for i, (m, name) in enumerate(METHODS.items())
            ),
            "evaluations of f in half a second",
            "error",
            log_x=True,
            log_y=True,
        ),
        Curves(
            "Growth of a small swing in one step",
            (
                *(
                    Trace("grid", f"growth_{m}", name, "line", i + 1, f"limit_{m}")
                    for i, (m, name) in enumerate(METHODS.items())
                ),
                *(
                    Trace(f"limit_{m}", f"one_{m}", "", "points", i + 1)
                    for i, m in enumerate(METHODS)
                ),
                Trace("now", "all", "h now", "dash"),
            ),
            "step h [s]",
            "factor",
            log_x=True,
        ),
        Curves(
            "Region of absolute stability",
            (
                *(
                    Trace(f"edge_re_{m}", f"edge_im_{m}", METHODS[m], "line", NAMES.index(m) + 1)
                    for m in NAMES
                    if m != "semi"
                ),
                Trace("z_re", "z_im", "hλ", "points"),
            ),
            "Re z",
            "Im z",
            guide="imaginary-axis",
            equal=True,
        ),
        TimeSeries(
            "Energy",
            "J",
            (
                *(Line(f"energy_{m}", rf"\text{{{name}}}") for m, name in METHODS.items()),
                Line("energy", r"\text{exact}", "limit"),
            ),
        ),
        Bars("Order conditions of your tableau", "conditions", r"\text{off by}", ""),
        Readout("own_order", "Order of your tableau", ""),
        Readout("own_sum", "Sum of its b", ""),
        Readout("reach", "h |λ|, fastest swing", ""),
        Readout("newton", "Newton iterations in a step", ""),
        Readout("going", "Methods still going", "of 8"),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Large steps": {"h": 0.3},
        "Small steps": {"h": 0.005},
        "Double pendulum": {"system": "double-pendulum", "start": 1.5, "h": 0.02},
        "Strong friction": {"friction": 2.0, "h": 0.1},
        "Gauss-Legendre": {"implicit": "gauss-legendre", "h": 0.2},
    }

    def init(self, params: IntegrationParams, rng: np.random.Generator) -> IntegrationState:
        x, many, k = params.x0(), len(NAMES), len(COUNTS)
        return IntegrationState(
            x=np.tile(x, (many, 1)),
            reference=x,
            stopped=np.zeros(many, bool),
            global_errors=np.zeros((many, k)),
            local_errors=np.zeros((many, k)),
            costs=np.zeros((many, k)),
            limits=np.full(many, -1.0),
        )

    def step(
        self, params: IntegrationParams, inputs: Inputs, state: IntegrationState
    ) -> IntegrationState:
        """10 ms of the motion itself, and of the methods the whole steps of h that are due."""
        if state.trouble:
            return state
        t, n = (state.steps + 1) * self.period, params.rods
        x, stopped, clock, newton = state.x.copy(), state.stopped.copy(), state.clock, state.newton
        steppers = [_stepper(*_key(m, params)) for m in NAMES]
        with np.errstate(all="ignore"):
            while clock + params.h <= t + 1e-9:
                for i, advance in enumerate(steppers):
                    if stopped[i]:
                        continue
                    done = advance(x[i], clock, params.h)
                    if done.status or not np.abs(done.x[n:]).max() <= FASTEST:
                        stopped[i] = True
                        continue
                    x[i] = done.x
                    newton = done.iterations if NAMES[i] == "implicit" else newton
                clock += params.h
            exactly = step(REFERENCE, params.plant.flow, state.reference, state.t, self.period)
        reference = state.reference if exactly.status else exactly.x
        return replace(
            state,
            t=t,
            steps=state.steps + 1,
            x=x,
            stopped=stopped,
            clock=clock,
            newton=newton,
            reference=reference,
        )

    def solve(self, params: IntegrationParams, state: IntegrationState) -> Iterator[Snapshot]:
        """One method an iteration: its errors for every step of LADDER, and its limit."""
        for i, name in enumerate(NAMES):
            errors, local, costs, limit = _studied(*_key(name, params), params.start)
            found = {"method": i, "global": errors, "local": local, "cost": costs, "limit": limit}
            done = "All methods studied." if i == len(NAMES) - 1 else ""
            yield Snapshot(i + 1, found, done)

    def accept(
        self, params: IntegrationParams, state: IntegrationState, snapshot: Snapshot
    ) -> IntegrationState:
        data, i = snapshot.data, snapshot.data["method"]
        return replace(
            state,
            global_errors=_with(state.global_errors, i, data["global"]),
            local_errors=_with(state.local_errors, i, data["local"]),
            costs=_with(state.costs, i, data["cost"]),
            limits=_with(state.limits, i, data["limit"]),
        )

    def measure(self, params: IntegrationParams, state: IntegrationState) -> Measurement:
        plant, own = params.plant, _tableau(params.tableau)
        fall = plant.energy(np.eye(2 * params.rods)[0] * np.pi)
        begun = plant.energy(params.x0())
        measured: dict[str, float | np.ndarray] = {
            "tip": float(_tip(state.reference[: params.rods])[1]),
            "energy": plant.energy(state.reference),
            "own_order": float(order(own)),
            "own_sum": float(own.b.sum()),
            "reach": params.h * float(np.abs(plant.eigenvalues).max()),
            "newton": float(state.newton),
            "going": float(len(NAMES) - state.stopped.sum()),
        }
        for x, name in zip(state.x, NAMES, strict=True):
            energy = plant.energy(x)
            measured[f"tip_{name}"] = float(_tip(x[: params.rods])[1])
            measured[f"energy_{name}"] = energy
            measured[f"drift_{name}"] = float(np.log10(max(abs(energy - begun) / fall, 1e-12)))
        return measured

    def fields(
        self, params: IntegrationParams, state: IntegrationState
    ) -> Mapping[str, np.ndarray]:
        z = params.h * params.plant.eigenvalues
        found: dict[str, np.ndarray] = {
            "ladder": LADDER,
            "grid": GRID,
            "now": np.full(2, params.h),
            "all": np.array([0.0, HIGHEST]),
            "z_re": z.real,
            "z_im": z.imag,
            "conditions": order_conditions(_tableau(params.tableau)),
        }
        for i, name in enumerate(NAMES):
            errors, local = state.global_errors[i], state.local_errors[i]
            limit = state.limits[i : i + 1]
            limit = limit[(limit >= GRID[0]) & (limit < LONGEST)]
            found |= {
                f"global_{name}": errors,
                f"local_{name}": local,
                f"cost_{name}": state.costs[i],
                f"order_{name}": _number(slope(LADDER, errors)),
                f"local_order_{name}": _number(slope(LADDER, local)),
                f"growth_{name}": _growth(*_key(name, params)),
                f"limit_{name}": limit,
                f"one_{name}": np.ones(len(limit)),
            }
            if name != "semi":
                edge = _edge(_key(name, params)[0])
                found |= {f"edge_re_{name}": edge.real, f"edge_im_{name}": edge.imag}
        return found

    def draw(self, scene: Scene, params: IntegrationParams, state: IntegrationState) -> None:
        """The pendulums in echelon, the exact one in front, and a line through all the places
        where its tip would be."""
        rods, top = params.rods, 0.25 + LENGTH * params.rods
        scene.camera((1.3 + 0.65 * rods, 0.0, 0.4 + 0.5 * rods), (0.0, 0.0, 0.15 + 0.35 * rods))
        many = len(NAMES) + 1
        hinges = np.outer(np.arange(many) - (many - 1) / 2, SPACING)
        hinges[:, 2] = top
        scene.trail("beam", hinges, "muted")
        scene.trail("exact", hinges + _tip(state.reference[:rods]), "reference")
        scene.arm("pendulum exact", hanging(rods, _xy(hinges[0]), GRAY), state.reference[:rods])
        scene.label("name exact", "Exact", hinges[0] + [0.0, 0.0, 0.1])
        for i, (name, title) in enumerate(METHODS.items()):
            q, lost, hinge = state.x[i, :rods], bool(state.stopped[i]), hinges[i + 1]
            scene.arm(f"pendulum {name}", hanging(rods, _xy(hinge), COLORS[i]), q)
            above = [0.0, 0.0, (0.16, 0.1)[i % 2]]
            scene.label(f"name {name}", f"{title} ✗" if lost else title, hinge + above)
            if lost:
                scene.sphere(f"lost {name}", hinge + _tip(q), 0.06, "warning")


def _key(name: str, params: IntegrationParams) -> tuple[str, int, float]:
    """What fixes a method and its system."""
    text = {"yours": params.tableau, "implicit": params.implicit}.get(name, name)
    return text, params.rods, params.friction


@lru_cache(maxsize=64)
def _tableau(text: str) -> Tableau:
    return TABLEAUS[text] if text in TABLEAUS else parse(text)


@lru_cache(maxsize=64)
def _stepper(text: str, rods: int, friction: float) -> Stepper:
    """One step of a method."""
    plant = pendulum(rods, friction)
    if text != "semi":
        tableau, flow = _tableau(text), plant.flow
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
def _studied(
    text: str, rods: int, friction: float, start: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Global errors (k,), local errors (k,), costs (k,) and the largest step [s] of a method."""
    advance = _stepper(text, rods, friction)
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
    advance = _stepper(text, rods, friction)

    def growth(h: float) -> float:
        return spectral_radius(lambda x: advance(x, 0.0, h).x, 2 * rods, SMALL)

    return min(measured_limit(growth, float(GRID[0]), LONGEST), LONGEST)


@lru_cache(maxsize=64)
def _growth(text: str, rods: int, friction: float) -> np.ndarray:
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
        found = StabilityFunction.of(_tableau(text)).growth(GRID, plant.eigenvalues)
    capped: np.ndarray = np.minimum(np.nan_to_num(found, nan=HIGHEST), HIGHEST)
    return capped


@lru_cache(maxsize=64)
def _edge(text: str) -> np.ndarray:
    return boundary(StabilityFunction.of(_tableau(text)))


def _number(value: float) -> np.ndarray:
    """A field of this number, or of none."""
    return np.array([value]) if np.isfinite(value) else np.zeros(0)


def _with(rows: np.ndarray, i: int, row: np.ndarray | float) -> np.ndarray:
    """A copy with one row replaced."""
    new = rows.copy()
    new[i] = row
    return new


def _xy(point: np.ndarray) -> tuple[float, float]:
    return float(point[0]), float(point[1])


def _tip(q: np.ndarray) -> np.ndarray:
    """(3,) [m] from the hinge to the end of the last rod."""
    angles = np.cumsum(q)
    return LENGTH * np.array([0.0, np.sin(angles).sum(), -np.cos(angles).sum()])
