"""Linear quadratic regulator (notes, 2.4): weights, the policy they make, and how far it holds."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from labs.lab import Action, Inputs, Lab, Measurement, Snapshot, State
from labs.optimal_control.lqr.comparison import COUNT, HORIZONS, compare
from labs.optimal_control.lqr.recovery import CODES, POINTS, SPAN, ClosedLoop, axes
from labs.optimal_control.lqr.regulator import (
    FINALS,
    POLICIES,
    Regulator,
    Setting,
    regulator,
    settled,
)
from labs.params import Group, Params, Value
from labs.plots import Curves, Line, Matrix, Readout, TimeSeries, Trace
from labs.problems.linear_quadratic import LqrProblem
from labs.scene import Scene
from labs.tasks.regulation.linear_systems import STEP, SYSTEMS, Force, LinearSystem, linear_system

PERIODS = {0.01: "10 ms", 0.02: "20 ms", 0.05: "50 ms", 0.1: "100 ms", 0.2: "200 ms"}
PUSH_STEPS = 20
"""World steps a push lasts: 0.2 s."""
TRAIL = 200
"""World steps of the path that is shown: 2 s."""
ROUNDS = 3
"""Of the comparison with least squares; the shortest duration of each horizon counts."""
SHOWN = 6
"""Elements of P and K that are plotted."""
ARROW = 0.04
"""[m/N] length of a force's arrow, up to LONGEST [m]."""
LONGEST = 0.6
ADVICE = "The policy knows of no limits: start closer, push less, or weigh otherwise; then reset."


SYSTEM = Group("System", effect="restart")
WEIGHTS = Group("Weights", effect="solve")
HORIZON = Group("Horizon", effect="solve")
WORLD = Group("World", effect="solve")


class LqrParams(Params):
    """What the user can turn."""

    system: str = SYSTEM.choice("cart-pole", SYSTEMS, "System")
    """What is to be kept at rest."""
    deviation: float = SYSTEM.knob(
        0.3, -3.2, 3.2, "\\Delta x_0", "rad, m", "Start off by", step=0.01
    )
    """Of the pole, the pendulum, the mass, or every joint of the UR5, at rest."""
    period: float = SYSTEM.choice(0.02, PERIODS, "Time step", "T", "s", effect="solve")
    """From t to t + 1: the policy looks once in a step and holds its control."""
    q_slide: float = WEIGHTS.knob(10.0, 0.0, 10_000.0, "q_p", "1/m²", "Position", scale="log")
    """Q's weight of what slides: the cart, the mass."""
    q_turn: float = WEIGHTS.knob(10.0, 0.0, 10_000.0, "q_\\theta", "1/rad²", "Angle", scale="log")
    """Q's weight of what turns: the pole, the pendulum, each joint of the UR5."""
    q_slide_rate: float = WEIGHTS.knob(
        1.0, 0.0, 1000.0, "q_{\\dot p}", "s²/m²", "Velocity", scale="log"
    )
    """Q's weight of the velocity of what slides."""
    q_turn_rate: float = WEIGHTS.knob(
        1.0, 0.0, 1000.0, "q_{\\dot\\theta}", "s²/rad²", "Angular velocity", scale="log"
    )
    """Q's weight of the velocity of what turns."""
    r: float = WEIGHTS.knob(0.1, 1e-4, 1e4, "r", "1/N², 1/(N·m)²", "Control", scale="log")
    """R = r I: what force or torque costs."""
    policy: str = HORIZON.choice("steady", POLICIES, "Policy")
    """The steady state's gain for ever, or those of N steps: all in turn and then over again, or
    the first of them at every step."""
    horizon: float = HORIZON.knob(100.0, 1.0, 300.0, "N", "", "Horizon", step=1.0)
    """Steps over which the cost is summed up."""
    final: str = HORIZON.choice("q", FINALS, "Final weight", "Q_f")
    """What the final weight is a multiple of."""
    alpha: float = HORIZON.knob(1.0, 0.0, 1000.0, "\\alpha", "", "Its scale", scale="log")
    """How many times as much; with 0 it does not matter where x ends."""
    limits: bool = WORLD.toggle(True, "Limits")
    """Cut every control to what the motor can give. The regulator knows of none."""
    limit: float = WORLD.knob(
        20.0, 0.5, 200.0, "u_{max}", "N, N·m", "Strongest control", scale="log"
    )
    """Of the cart, the pendulum and the mass; the UR5's joints have motors of their own."""
    push_force: float = WORLD.knob(
        1.0, 0.0, 200.0, "f_{push}", "N", "Push force", scale="log", effect="live"
    )
    """On the tip, along +y, while a push lasts, 0.2 s."""

    @property
    def linear_system(self) -> LinearSystem:
        return linear_system(self.system)

    @property
    def setting(self) -> Setting:
        weights = (self.q_slide, self.q_turn, self.q_slide_rate, self.q_turn_rate)
        return Setting(
            self.system, self.period, weights, self.r, round(self.horizon), self.final,
            self.alpha, self.policy,
        )  # fmt: skip

    @property
    def regulator(self) -> Regulator:
        return regulator(self.setting)

    @property
    def strongest(self) -> np.ndarray:
        """(nu,) [N; N m]: what the motors can give, limited or not."""
        system = self.linear_system
        own = system.mechanism.control_limit
        return own if self.system == "ur5" else np.full(system.nu, self.limit)

    @property
    def loop(self) -> ClosedLoop:
        """The closed loop whose reach is studied; not for the UR5."""
        return ClosedLoop(
            self.system,
            self.period,
            self.regulator.gains[:, 0],
            self.limit if self.limits else np.inf,
        )


@dataclass(kw_only=True)
class LqrState(State):
    """The system, its policy's place in the horizon, the account of its cost, and what the study
    of the policy found. Arrays are never written after they are made."""

    x: np.ndarray
    u: np.ndarray
    """(nu,) [N; N m] the control held now."""
    force: np.ndarray
    """(3,) [N] on the tip."""
    steps: int = 0
    """World steps done: t = steps * period."""
    since: int = 10**6
    """World steps since the policy last looked."""
    index: int = 0
    """t of K_t, the gain now used."""
    push_left: int = 0
    """World steps the push still lasts."""
    paid: float = 0.0
    """Cost of the steps before the present one, since `start`."""
    stage: float = 0.0
    """Cost of the present one."""
    to_go: float = 0.0
    """V_t(x_t), what the policy expected to pay from it on."""
    predicted: float = 0.0
    """V_0(x_0) when the account was opened."""
    account: str = ""
    """The setting it was opened for; empty when the next look opens another."""
    path: np.ndarray
    """(k, 2) the newest last: coordinate and rate of what the plane shows, [rad; m]."""
    region: np.ndarray
    """(POINTS, POINTS) 1 where the policy recovers, 0 where not, -1 where not known (yet)."""
    lean: float = -1.0
    """[rad; m] the largest lean it recovers from; -1 while not known."""
    differences: np.ndarray
    """(COUNT,) between Riccati and least squares; 0 where not known (yet)."""


def _elements(channel: str) -> tuple[Trace, ...]:
    return tuple(
        Trace(f"{channel}_t{i}", f"{channel}_{i}", f"i = {i}", "line", i)
        for i in range(1, SHOWN + 1)
    )


class Lqr(Lab[LqrParams, LqrState]):
    """A system near a rest, under the policy its weights make."""

    title = "Linear quadratic regulator"
    section = "2.4"
    summary = (
        "Weigh deviation against effort and get the best policy there is: Riccati's recursion, its "
        "steady state, and how far from upright it still saves a nonlinear pole."
    )
    Params = LqrParams
    period = STEP
    plots = (
        TimeSeries("Deviation", "rad, m", Line("dq", "q - q_{eq}"), select="coordinate"),
        TimeSeries(
            "Control",
            "N, N·m",
            Line("u", "u"),
            Line("u_max", "u_{max}", "limit"),
            Line("u_min", "-u_{max}", "limit"),
            select="motor",
        ),
        Curves(
            "Where the policy recovers",
            "lean from the rest [rad] (mass: place [m])",
            "its rate [rad/s] (mass: [m/s])",
            Trace("safe_x", "safe_y", "comes back", "points", 3),
            Trace("path_x", "path_y", "so far", "line", 1),
            Trace("now_x", "now_y", "now", "points", 2),
        ),
        TimeSeries(
            "Cost",
            "",
            Line("paid", r"\text{so far}"),
            Line("total", r"\text{so far} + V_t(x_t)"),
            Line("predicted", r"x_0^T P_0\, x_0", "limit"),
        ),
        Curves(
            "Value, backward from N",
            "t [steps]",
            "Pₜ,ᵢᵢ / steady",
            *_elements("p"),
            Trace("p_mark", "p_span", "constant before", "dash", 0),
            log_y=True,
        ),
        Curves(
            "Gain, backward from N",
            "t [steps]",
            "Kₜ,₁ᵢ / steady (UR5: Kₜ,ᵢᵢ)",
            *_elements("k"),
            Trace("k_mark", "k_span", "constant before", "dash", 0),
        ),
        Curves(
            "Eigenvalues of one step",
            "Re",
            "Im",
            Trace("open_re", "open_im", "A", "points", 7),
            Trace("closed_re", "closed_im", "A + B K", "points", 1),
            guide="unit-circle",
            equal=True,
        ),
        TimeSeries("Velocity", "rad/s, m/s", Line("v", r"\dot q"), select="coordinate"),
        Curves(
            "Time to solve",
            "N",
            "seconds",
            Trace("horizons", "riccati", "Riccati, slope", "marked", 1, "riccati_slope"),
            Trace("horizons", "at_once", "least squares, slope", "marked", 2, "at_once_slope"),
            log_x=True,
            log_y=True,
        ),
        Curves(
            "Difference of the two solutions",
            "N",
            "difference",
            Trace("horizons", "difference", "share of the largest control", "marked", 4),
            log_x=True,
            log_y=True,
        ),
        Matrix("Gain now", "gain", "K_t", shade=True),
        Readout("to_end", "Time to go", "s"),
        Readout("growth", "Growth of a small deviation", "a step"),
        Readout("lean", "Largest lean recovered", "rad, m"),
        Readout("recursions", "Riccati steps to the steady state", "", whole=True),
        Readout("settled", "Constant gains, of N", "", whole=True),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Cart-pole": {},
        "Cart-pole, over again": {"policy": "window", "horizon": 80.0, "alpha": 0.0},
        "Pendulum, weak motor": {"system": "pendulum", "limit": 4.0, "r": 1.0, "push_force": 8.0},
        "Mass on a line": {"system": "mass", "deviation": 1.0, "push_force": 5.0},
        "UR5": {
            "system": "ur5",
            "q_turn": 1000.0,
            "q_turn_rate": 10.0,
            "r": 0.001,
            "push_force": 100.0,
        },
    }
    actions = (Action("push", "Push", "Pushes the tip along +y for 0.2 s.", group="World"),)

    @classmethod
    def prepare(cls) -> None:
        LqrParams().loop.recovers_in_row(0)

    def init(self, params: LqrParams, rng: np.random.Generator) -> LqrState:
        """At rest, off by the deviation: the pole, the pendulum, the mass or every joint."""
        system = params.linear_system
        nq = system.mechanism.nq
        x = system.x_eq.copy()
        x[0 if params.system == "ur5" else nq - 1 : nq] += params.deviation
        return LqrState(
            x=x,
            u=system.u_eq.copy(),
            force=np.zeros(3),
            path=system.in_plane(x)[None],
            region=np.full((POINTS, POINTS), -1),
            differences=np.zeros(COUNT),
            trouble=params.regulator.trouble,
        )

    def step(self, params: LqrParams, inputs: Inputs, state: LqrState) -> LqrState:
        """10 ms: a look of the policy where one is due, then the nonlinear system."""
        if state.trouble:
            return state
        law, system = params.regulator, params.linear_system
        if law.trouble:
            return replace(state, trouble=law.trouble)
        push_left = PUSH_STEPS if "push" in inputs.actions else state.push_left
        force = _force(params, system, push_left, inputs.handles.get("pull"))
        if state.since >= round(params.period / STEP):
            state = self._look(params, law, state)
        x = system.step(state.x, state.u, force)
        count = state.steps + 1
        if why := system.lost(x):
            return replace(state, trouble=f"At t = {state.t:.2f} s {why}. {ADVICE}")
        tip = system.mechanism.tip(x[: system.mechanism.nq])
        return replace(
            state,
            t=count * STEP,
            steps=count,
            since=state.since + 1,
            x=x,
            force=force(tip) if force else np.zeros(3),
            push_left=max(push_left - 1, 0),
            account="" if force else state.account,
            path=np.vstack([state.path[-TRAIL + 1 :], system.in_plane(x)]),
        )

    def _look(self, params: LqrParams, law: Regulator, state: LqrState) -> LqrState:
        """u_t = u_eq + K_t dx_t, cut to the limits; what it costs is put on the account. A new
        setting, the end of a push and the start of a window open a new one."""
        system, dx = law.system, state.x - law.system.x_eq
        account = repr(law.setting)
        fresh = state.account != account or state.since > 10**5
        index = 0 if fresh else (state.index + 1) % len(law.gains)
        opened = fresh or (index == 0 and params.policy == "window")
        du = law.gains[index] @ dx
        if params.limits:
            du = np.clip(system.u_eq + du, -params.strongest, params.strongest) - system.u_eq
        value = float(dx @ law.values[index] @ dx)
        return replace(
            state,
            u=system.u_eq + du,
            since=0,
            index=index,
            paid=0.0 if opened else state.paid + state.stage,
            stage=law.cost(dx, du),
            to_go=value,
            predicted=value if opened else state.predicted,
            account=account,
        )

    def solve(self, params: LqrParams, state: LqrState) -> Iterator[Snapshot]:
        """Row by row, where in the plane the policy recovers; then, horizon by horizon, what
        Riccati and least squares take for the same problem."""
        law, p = params.regulator, params.regulator.problem
        if law.trouble:
            yield Snapshot(1, done=law.trouble)
            return
        rows = POINTS if params.system in CODES else 0
        horizons = ROUNDS * tuple(enumerate(HORIZONS[params.system]))
        last, count = rows + bool(rows) + len(horizons), 0
        found: dict[str, Any] = {"region": state.region, "lean": -1.0}
        found |= {name: np.zeros(COUNT) for name in ("differences", "riccati", "at_once")}
        for row in range(rows):
            found["region"] = _with(found["region"], row, params.loop.recovers_in_row(row))
            count += 1
            yield Snapshot(count, dict(found), progress=count / last)
        if rows:
            found["lean"] = params.loop.largest_lean()
            count += 1
            yield Snapshot(count, dict(found), progress=count / last)
        for i, horizon in horizons:
            both = compare(LqrProblem(horizon, p.a, p.b, p.q, p.r, p.q))
            found["differences"] = _with(found["differences"], i, both.difference)
            for name, took in (("riccati", both.riccati), ("at_once", both.least_squares)):
                found[name] = _with(found[name], i, min(found[name][i] or np.inf, took))
            count += 1
            done = _verdict(law) if count == last else ""
            yield Snapshot(count, dict(found), done, progress=count / last)

    def accept(self, params: LqrParams, state: LqrState, snapshot: Snapshot) -> LqrState:
        found = dict(snapshot.data)
        names = [name for name in ("riccati", "at_once") if name in found]
        seconds: dict[str, Any] = {name: found.pop(name) for name in names}
        return replace(state, **found, seconds=seconds)

    def measure(self, params: LqrParams, state: LqrState) -> Measurement:
        law, system = params.regulator, params.linear_system
        nq = system.mechanism.nq
        measured: dict[str, float | np.ndarray] = {
            "dq": (state.x - system.x_eq)[:nq],
            "v": state.x[nq:],
            "u": state.u,
            "u_max": params.strongest,
            "u_min": -params.strongest,
            "paid": state.paid,
            "total": state.paid + state.to_go,
            "predicted": state.predicted,
        }
        if law.trouble:
            return measured
        if params.policy != "steady":
            left = law.setting.horizon - (state.index if params.policy == "window" else 0)
            measured["to_end"] = left * params.period
        if law.steady and not law.steady.trouble:
            measured["recursions"] = law.steady.iterations
        if state.lean >= 0.0:
            measured["lean"] = state.lean
        return measured | {"growth": law.growth, "settled": law.constant}

    def fields(self, params: LqrParams, state: LqrState) -> Mapping[str, np.ndarray]:
        law = params.regulator
        gain = law.system.u_eq[:, None] * 0.0 if law.trouble else law.gains[_index(law, state)]
        a, b = law.problem.a, law.problem.b
        opened = np.linalg.eigvals(a).astype(complex)
        closed = opened if law.trouble else np.linalg.eigvals(a + b @ gain).astype(complex)
        known = state.differences > 0.0
        horizons = np.array(HORIZONS[params.system], float)
        edge = np.array(SPAN.get(params.system, (np.inf, np.inf)))
        path = np.clip(state.path, -edge, edge)
        found = {
            "path_x": path[:, 0],
            "path_y": path[:, 1],
            "now_x": path[-1:, 0],
            "now_y": path[-1:, 1],
            "open_re": opened.real,
            "open_im": opened.imag,
            "closed_re": closed.real,
            "closed_im": closed.imag,
            "horizons": horizons,
            "difference": np.where(known, np.maximum(state.differences, 1e-17), 0.0),
            "gain": gain,
        }
        for name in ("riccati", "at_once"):
            seconds = np.array(state.seconds.get(name, np.zeros(COUNT)))
            found |= {name: seconds, f"{name}_slope": _slope(horizons, seconds)}
        return found | _region(params, state) | _backward(law)

    def draw(self, scene: Scene, params: LqrParams, state: LqrState) -> None:
        """The system, a ghost at its rest, the forces on it, and the largest lean."""
        system = params.linear_system
        world, nq = system.mechanism, system.mechanism.nq
        q, arm = state.x[:nq], system.mechanism.arm
        scene.camera(*system.camera)
        scene.arm("rest", arm, system.x_eq[:nq], ghost=True)
        effort = np.abs(state.u) / params.strongest if params.system == "ur5" else None
        scene.arm("system", arm, q, effort=effort)
        tip = world.tip(q)
        scene.handle("pull", tip, 0.05)
        if state.force.any():
            scene.arrow("force", tip, tip + _shortened(state.force))
        if params.system in ("cart-pole", "mass"):
            at = np.array([0.0, q[0], tip[2] if params.system == "mass" else arm.camera[1][2]])
            push = _shortened(np.array([0.0, state.u[0], 0.0]))
            if np.abs(push).max() > 1e-3:
                scene.arrow("control", at, at + push, "actual")


def _with(array: np.ndarray, i: int, value: float | np.ndarray) -> np.ndarray:
    """A copy of the array with another entry or row i."""
    changed = array.copy()
    changed[i] = value
    return changed


def _index(law: Regulator, state: LqrState) -> int:
    return min(state.index, len(law.gains) - 1)


def _verdict(law: Regulator) -> str:
    """Said when the study is over."""
    if law.steady is None:
        return "Studied; there is no steady state to go to."
    if law.steady.trouble:
        return law.steady.trouble
    if law.mismatch < 0.0:
        return "Studied. SciPy does not solve this equation."
    return f"Studied. Recursion and SciPy differ by {law.mismatch:.0e} of P's size."


def _force(
    params: LqrParams,
    system: LinearSystem,
    push_left: int,
    handle: tuple[float, float, float] | None,
) -> Force | None:
    """On the tip: a push while it lasts, and a spring towards the handle while it is held."""
    push = np.array([0.0, params.push_force if push_left > 0 else 0.0, 0.0])
    if handle is None:
        return (lambda tip: push) if push.any() else None
    target = np.array(handle)
    return lambda tip: push + _within(system.spring * (target - tip), 0.5 * system.spring)


def _within(vector: np.ndarray, longest: float) -> np.ndarray:
    size = float(np.linalg.norm(vector))
    return vector if size <= longest else vector * (longest / size)


def _shortened(force: np.ndarray) -> np.ndarray:
    """[m] the arrow of a force [N]."""
    return _within(ARROW * force, LONGEST)


def _region(params: LqrParams, state: LqrState) -> dict[str, np.ndarray]:
    """The points of the plane from which it recovers."""
    if params.system not in CODES:
        return {"safe_x": np.zeros(0), "safe_y": np.zeros(0)}
    places, rates = axes(params.system)
    rows, columns = np.nonzero(state.region == 1)
    return {"safe_x": places[columns], "safe_y": rates[rows]}


def _backward(law: Regulator) -> dict[str, np.ndarray]:
    """How P_t and K_t come to rest, with a mark where they are constant."""
    found: dict[str, np.ndarray] = {}
    for name, shares in zip("pk", law.shares(), strict=True):
        steps = np.arange(len(shares), dtype=float)
        for i in range(SHOWN):
            there = i < shares.shape[1]
            found[f"{name}_t{i + 1}"] = steps if there else np.zeros(0)
            found[f"{name}_{i + 1}"] = shares[:, i] if there else np.zeros(0)
        mark = settled(shares)
        found[f"{name}_mark"] = np.full(2 if mark >= 0 else 0, float(mark))
        span = np.array([shares.min(initial=1.0), shares.max(initial=1.0)])
        found[f"{name}_span"] = span if mark >= 0 else np.zeros(0)
    return found


def _slope(horizons: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Of log(seconds) over log(N), through the last three; none while they are not known."""
    if not (seconds > 0.0).all():
        return np.zeros(0)
    fit = np.polyfit(np.log(horizons[-3:]), np.log(seconds[-3:]), 1)
    return np.round(fit[:1], 1)
