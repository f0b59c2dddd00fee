"""Numerical integration (notes, A.1 and A.2): one pendulum for each method, side by side."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from pydantic import field_validator

from labs.algorithms.runge_kutta import (
    gauss_legendre,
    order,
    order_conditions,
    parse_tableau,
    runge_kutta_step,
)
from labs.appendix.integration.accuracy import (
    COUNTS,
    GRID,
    HIGHEST,
    LADDER,
    LONGEST,
    edge_of,
    errors_and_limit,
    growth_of,
    stepper_of,
    tableau_of,
)
from labs.appendix.integration.convergence import slope
from labs.errors import LabError
from labs.lab import Inputs, Lab, Measurement, Snapshot, State
from labs.models.pendulums import GRAY, LENGTH, Pendulum, hanging, pendulum
from labs.params import Group, Params, Value
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
SPACING = (-0.04, 0.36, 0.0)
"""[m] from the hinge of one pendulum to the next: behind and beside it."""
FASTEST = 40.0
"""[rad/s] a pendulum faster than this has blown up; one that falls from upright makes 11."""


SYSTEM = Group("System", effect="restart")
METHODS_GROUP = Group("Methods", effect="solve")


class IntegrationParams(Params):
    """What the user can turn."""

    system: str = SYSTEM.choice("pendulum", SYSTEMS, "System")
    """What every method integrates: one rod of half a metre, or two."""
    start: float = SYSTEM.knob(1.0, 0.0, 3.1, "q(0)", "rad", "Start angle", step=0.01)
    """Of the first rod from hanging; the second starts in line with it. All start at rest."""
    friction: float = SYSTEM.knob(
        0.0, 0.0, 5.0, "b", "N·m·s/rad", "Friction", scale="log", effect="solve"
    )
    """Viscous, at every hinge. It moves the eigenvalues to the left."""
    h: float = METHODS_GROUP.knob(0.04, 0.002, 1.0, "h", "s", "Step", scale="log", effect="live")
    """Of all methods alike. A pendulum stands still between two steps."""
    implicit: str = METHODS_GROUP.choice("implicit-midpoint", IMPLICIT, "Implicit method")
    """Which one the gray pendulum follows; its stages are found by Newton's method."""
    tableau: str = METHODS_GROUP.text(
        "0 |\n1/3 | 1/3\n2/3 | 0 2/3\n| 1/4 0 3/4", "Your tableau", rows=6
    )
    """A row a stage, c | a ..., then | b ... at the end. Fractions go, and so do weights on and
    above the diagonal (implicit)."""

    @field_validator("tableau")
    @classmethod
    def _is_a_tableau(cls, value: str) -> str:
        try:
            parse_tableau(value)
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


def _lines(channel: str) -> tuple[Line, ...]:
    """One for each method."""
    return tuple(Line(f"{channel}_{m}", rf"\text{{{name}}}") for m, name in METHODS.items())


def _traces(
    x: str, y: str, style: Literal["line", "marked", "points"], note: str = ""
) -> tuple[Trace, ...]:
    """One for each method, in its colour; the grids are common to all."""
    return tuple(
        Trace(
            x if x in {"ladder", "grid"} else f"{x}_{m}",
            f"{y}_{m}",
            name,
            style,
            i + 1,
            f"{note}_{m}" if note else "",
        )
        for i, (m, name) in enumerate(METHODS.items())
    )


def _errors(title: str, x: str, y: str, note: str) -> Curves:
    """Errors over steps or costs, doubly logarithmic."""
    label = "step h [s]" if x == "ladder" else "evaluations of f in half a second"
    return Curves(title, label, "error", *_traces(x, y, "marked", note), log_x=True, log_y=True)


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
            *_lines("tip"),
            Line("tip", r"\text{exact}", "limit"),
        ),
        TimeSeries("Energy drift, decades", "log₁₀ of a fall's energy", *_lines("drift")),
        _errors("Global error after half a second", "ladder", "global", "order"),
        _errors("Local error of one step", "ladder", "local", "local_order"),
        _errors("Global error against cost", "cost", "global", ""),
        Curves(
            "Growth of a small swing in one step",
            "step h [s]",
            "factor",
            *_traces("grid", "growth", "line", "limit"),
            *(replace(t, label="") for t in _traces("limit", "one", "points")),
            Trace("now", "all", "h now", "dash"),
            log_x=True,
        ),
        Curves(
            "Region of absolute stability",
            "Re z",
            "Im z",
            *(t for t in _traces("edge_re", "edge_im", "line") if t.label != METHODS["semi"]),
            Trace("z_re", "z_im", "hλ", "points"),
            guide="imaginary-axis",
            equal=True,
        ),
        TimeSeries("Energy", "J", *_lines("energy"), Line("energy", r"\text{exact}", "limit")),
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

    def runge_kutta_step(
        self, params: IntegrationParams, inputs: Inputs, state: IntegrationState
    ) -> IntegrationState:
        """10 ms of the motion itself, and of the methods the whole steps of h that are due."""
        if state.trouble:
            return state
        t, n = (state.steps + 1) * self.period, params.rods
        x, stopped, clock, newton = state.x.copy(), state.stopped.copy(), state.clock, state.newton
        steppers = [stepper_of(*_key(m, params)) for m in NAMES]
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
            exactly = runge_kutta_step(
                REFERENCE, params.plant.vector_field, state.reference, state.t, self.period
            )
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
        """One method an iteration: its errors for every step of LADDER, and its limit. What was
        found for other parameters stands until it is replaced."""
        found = {
            "global_errors": state.global_errors,
            "local_errors": state.local_errors,
            "costs": state.costs,
            "limits": state.limits,
        }
        for i, name in enumerate(NAMES):
            errors, local, costs, limit = errors_and_limit(*_key(name, params), params.start)
            found = {
                "global_errors": _with(found["global_errors"], i, errors),
                "local_errors": _with(found["local_errors"], i, local),
                "costs": _with(found["costs"], i, costs),
                "limits": _with(found["limits"], i, limit),
            }
            done = "All methods studied." if i == len(NAMES) - 1 else ""
            yield Snapshot(i + 1, found, done, (i + 1) / len(NAMES))

    def accept(
        self, params: IntegrationParams, state: IntegrationState, snapshot: Snapshot
    ) -> IntegrationState:
        return replace(state, **snapshot.data)

    def measure(self, params: IntegrationParams, state: IntegrationState) -> Measurement:
        plant, own = params.plant, tableau_of(params.tableau)
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
            "conditions": order_conditions(tableau_of(params.tableau)),
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
                f"growth_{name}": growth_of(*_key(name, params)),
                f"limit_{name}": limit,
                f"one_{name}": np.ones(len(limit)),
            }
            if name != "semi":
                edge = edge_of(_key(name, params)[0])
                found |= {f"edge_re_{name}": edge.real, f"edge_im_{name}": edge.imag}
        return found

    def draw(self, scene: Scene, params: IntegrationParams, state: IntegrationState) -> None:
        """The pendulums in echelon, the exact one in front, and a line through all the places
        where its tip would be."""
        rods, top = params.rods, 0.25 + LENGTH * params.rods
        scene.camera((1.75 + 0.6 * rods, 0.0, 0.35 + 0.5 * rods), (0.0, -0.04, 0.15 + 0.35 * rods))
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
            above = [0.0, 0.0, (0.22, 0.1)[i % 2]]
            scene.label(f"name {name}", f"{title} ✗" if lost else title, hinge + above)
            if lost:
                scene.sphere(f"lost {name}", hinge + _tip(q), 0.06, "warning")


def _key(name: str, params: IntegrationParams) -> tuple[str, int, float]:
    """What fixes a method and its system."""
    text = {"yours": params.tableau, "implicit": params.implicit}.get(name, name)
    return text, params.rods, params.friction


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
