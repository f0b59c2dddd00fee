"""Differential dynamic programming (notes, 2.4.6): swing-ups and a reach, solved and played."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from labs.algorithms import ddp
from labs.algorithms.ddp import Iterate, Options
from labs.lab import Action, Inputs, Lab, Measurement, Snapshot, State
from labs.models.mechanisms import Mechanism, mechanism
from labs.optimal_control.ddp.history import KEPT, History, spread
from labs.params import Group, Knob, Value
from labs.plots import Curves, Line, Readout, TimeSeries, Trace
from labs.problems.optimal_control import Problem
from labs.scene import Scene
from labs.tasks.motion.motions import first_guess, resampled, struck, tips, within
from labs.tasks.motion.params import MotionParams
from labs.tasks.motion.runs import (
    FEEDBACK,
    OPEN_LOOP,
    QUANTUM,
    Policy,
    Runs,
    advance,
    begin,
    kicked,
)

TOLERANCE = 1e-8
"""Of the cost: what a step must promise to be worth taking."""
BEHIND = np.array([0.06, 0.0, 0.0])
"""[m] by which the path of an iteration stands behind the next, where all lie in one plane."""
REST = 80
"""World steps between the end of a motion and its start anew: 0.8 s."""
ARROW, ARROW_STEPS = 0.08, 30
"""[m/(N s)] length of the arrow of a push, and world steps it stays."""
VELOCITY_NOISE = 10.0
"""[1/s] noise of the measured velocity [rad/s] for each radian of noise of the angle."""
APART = 0.1
"""[m] between the tips from which on the ghost says what it is."""
PHASES = ("derivatives", "backward", "forward")
BEFORE = (2, 4, 8)
"""Which earlier iterations the phase portrait shows."""


SOLVER = Group("Solver", effect="solve")
WORLD = Group("World")


class DdpParams(MotionParams):
    """What the user can turn."""

    method: str = SOLVER.choice(
        "ilqr", {"ilqr": "iLQR (Gauss-Newton)", "ddp": "DDP (second derivatives)"}, "Method"
    )
    """Whether the second derivatives of the dynamics enter."""
    start: str = SOLVER.choice(
        "warm", {"warm": "Warm: the present solution", "cold": "Cold: the first guess"}, "Start"
    )
    """What a change of the problem is solved from."""
    guess: float = SOLVER.knob(0.0, -1.0, 1.0, "A", "u_0", "First guess", step=0.01)
    """Size of the controls guessed at first, u = u_ref + A u_0 cos(2 pi f_0 t)."""
    guess_rate: float = SOLVER.knob(0.0, 0.0, 2.0, "f_0", "Hz", "Its frequency", step=0.05)
    """Of the first guess; at 0 it is a constant push."""
    mu: float = SOLVER.knob(0.0, 0.0, 1e4, r"\mu", "", "First regularisation", scale="log")
    """What is added to the diagonal of Q_uu in the first iteration."""
    mu_factor: float = SOLVER.knob(4.0, 1.1, 20.0, r"k_\mu", "", "Its factor", scale="log")
    """By which mu grows after a bad iteration and shrinks after a good one."""
    c1: float = SOLVER.knob(1e-3, 1e-6, 0.95, "c_1", scale="log")
    """Least part of the expected improvement for which a step is taken."""
    c2: float = SOLVER.knob(0.25, 1e-3, 0.95, "c_2", scale="log")
    """Least part of the expected improvement for which mu shrinks; at least c_1 counts."""
    iterations: float = SOLVER.knob(200.0, 1.0, 300.0, "n_{max}", "", "Most iterations", step=1.0)
    """Before the solver stops short."""
    payload: float = WORLD.knob(0.0, 0.0, 3.0, "m_{load}", "kg", "Payload", step=0.01)
    """A point mass at the tip that the plan does not know of."""
    friction: float = WORLD.knob(0.0, 0.0, 10.0, "b", "N·m·s/rad", "Friction", scale="log")
    """Viscous friction at every joint that the plan does not know of."""
    noise: float = WORLD.knob(0.0, 0.0, 0.05, r"\sigma_x", "rad", "Sensor noise", scale="log")
    """Standard deviation of the measured angles; of the velocities it is 10/s times this."""
    noise_torque: float = WORLD.knob(0.0, 0.0, 1.0, r"\sigma_u", "u_0", "Torque noise", scale="log")
    """Standard deviation of what the motors add to the control, the same in both runs."""
    push: float = WORLD.knob(0.5, -5.0, 5.0, "p_{push}", "N·s", "Push", step=0.05)
    """Impulse a push gives the tip of both robots, along y."""

    @property
    def options(self) -> Options:
        return Options(
            second_order=self.method == "ddp",
            c1=self.c1,
            c2=max(self.c1, self.c2),
            mu=self.mu,
            mu_factor=self.mu_factor,
            tolerance=TOLERANCE,
            iterations=round(self.iterations),
        )


@dataclass(kw_only=True)
class DdpState(State):
    """The plan, how it was found, and how it is being played."""

    plan: Policy
    history: History
    failed: bool = False
    """Whether the last solve ended without a solution."""
    runs: Runs
    rested: int = 0
    """World steps since the motion ended."""
    paid: np.ndarray
    """(2,) cost of the last whole motion with feedback and in open loop; (0,) before it."""
    missed: np.ndarray
    """Likewise, how far the tip ended from where it should be [m]."""
    pushed: int = 0
    """World steps the arrow of a push still stays."""
    steps: int = 0
    """World steps done: t = steps * period."""
    key: int = 0
    """Of the noise's random numbers; their counter is `steps`."""


class Ddp(Lab[DdpParams, DdpState]):
    """Plans a motion by DDP or iLQR before one's eyes, and plays it on a plant it does not
    quite know."""

    title = "Differential dynamic programming"
    section = "2.4.6"
    summary = (
        "Swing up pendulums and reach with a UR5: watch DDP find the motion, then play it with "
        "and without its feedback gains."
    )
    Params = DdpParams
    period = 0.01
    plots = (
        Curves(
            "Cost",
            "iteration",
            "cost",
            Trace("iterations", "cost", "J", "marked"),
            Trace("stepped", "expected", "expected improvement", "line", 1),
            Trace("stepped", "actual", "actual improvement", "points", 2),
            log_y=True,
        ),
        Curves(
            "Line search and regularisation",
            "iteration",
            "",
            Trace("stepped", "alpha", "α", "points", 1),
            Trace("stepped", "mu", "μ", "marked", 2),
            Trace("stepped", "gradient", "max |dJ/dU|", "line"),
            log_y=True,
        ),
        TimeSeries(
            "Position",
            "rad; m",
            Line("q", "q"),
            Line("q_open", r"q^{\text{open}}", "dash"),
            Line("q_bar", r"\bar q", "limit"),
            select="joint",
        ),
        TimeSeries(
            "Control",
            "N·m; N",
            Line("u", r"u = \bar u + K (x - \bar x)"),
            Line("u_bar", r"\bar u", "limit"),
            select="motor",
        ),
        Curves(
            "Phase portrait",
            "angle [rad]",
            "velocity [rad/s]",
            *(
                Trace(f"angle_{i}", f"speed_{i}", f"{i} before", "line", 2 + k)
                for k, i in reversed(tuple(enumerate(BEFORE)))
            ),
            Trace("angle_0", "speed_0", "this iteration", "line", 1),
            Trace("angle_played", "speed_played", "played with feedback", "dash"),
        ),
        Curves(
            "Gains of the first motor",
            "time in the motion [s]",
            "gain",
            Trace("gain_t", "gain_q1", "∂u₁/∂q₁", "line", 1),
            Trace("gain_t", "gain_v1", "∂u₁/∂v₁", "line", 2),
            Trace("gain_t2", "gain_q2", "∂u₁/∂q₂", "line", 3),
            Trace("gain_t2", "gain_v2", "∂u₁/∂v₂", "line", 4),
        ),
        Curves(
            "Time of an iteration",
            "iteration",
            "ms",
            *tuple(Trace("timed", phase, phase, "line", i + 1) for i, phase in enumerate(PHASES)),
            log_y=True,
        ),
        TimeSeries(
            "Velocity",
            "rad/s; m/s",
            Line("v", "v"),
            Line("v_open", r"v^{\text{open}}", "dash"),
            Line("v_bar", r"\bar v", "limit"),
            select="joint",
        ),
        Readout("cost", "Cost J of the plan", ""),
        Readout("iteration", "Iterations", "", whole=True),
        Readout("paid", "Cost paid with feedback", ""),
        Readout("paid_open", "Cost paid in open loop", ""),
        Readout("missed", "Tip off the goal, feedback", "m"),
        Readout("missed_open", "Tip off the goal, open loop", "m"),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Weak motor": {"limited": True, "limit": 0.3, "horizon": 3.0},
        "Cart-pole": {"system": "cart-pole"},
        "Double pendulum": {"system": "double-pendulum"},
        "Acrobot": {"system": "acrobot", "horizon": 2.5},
        "Pendubot": {"system": "pendubot"},
        "UR5 reach": {"system": "ur5", "horizon": 1.0, "goal": 3000.0},
        "UR5 with an unknown payload": {
            "system": "ur5",
            "horizon": 1.0,
            "goal": 3000.0,
            "control": 0.01,
            "payload": 2.0,
        },
    }
    actions = (
        Action("push", "Push", "Strikes the tip of both robots, while the motion plays.", "World"),
    )

    def init(self, params: DdpParams, rng: np.random.Generator) -> DdpState:
        """The first guess, rolled out, is the first plan; the start at rest, where it diverges."""
        problem = _problem(params)
        at = ddp.init(problem, _first_guess(params, problem), params.options)
        if at.stopped:
            X = np.tile(problem.x0, (problem.N + 1, 1))
            U = first_guess(problem, params.size, 0.0, 0.0)
            at = replace(at, X=X, U=U, cost=problem.cost.value(X, U))
        plan = Policy(at.X, at.U, at.K, params.h)
        return DdpState(
            plan=plan,
            history=History.begun(at, *_path(params, at), None),
            runs=begin(plan),
            paid=np.zeros(0),
            missed=np.zeros(0),
            key=int(rng.integers(2**63)),
        )

    # The solver's clock -----------------------------------------------------------------------

    def solve(self, params: DdpParams, state: DdpState) -> Iterator[Snapshot | None]:
        """One iteration of DDP a snapshot. A first guess that diverges leaves what there was."""
        problem = _problem(params)
        at = ddp.init(problem, _start(params, problem, state), params.options)
        if at.stopped:
            yield Snapshot(1, _data(state.plan, state.history, True, {}), at.stopped)
            return
        history = History.begun(at, *_path(params, at), state.history)
        seconds = {phase: np.zeros(0) for phase in PHASES}
        while not at.stopped:
            at = yield from ddp.step_in_pieces(problem, params.options, at)
            history = history.after(at, *_path(params, at))
            seconds = {name: np.append(seconds[name], at.seconds[name]) for name in PHASES}
            plan = Policy(at.X, at.U, at.K, params.h)
            failed = bool(at.stopped) and not at.converged
            yield Snapshot(at.iteration, _data(plan, history, failed, seconds), at.stopped)

    def accept(self, params: DdpParams, state: DdpState, snapshot: Snapshot) -> DdpState:
        """Whatever is taken in is played from its start."""
        plan: Policy = snapshot.data["plan"]
        return replace(
            state,
            plan=plan,
            history=snapshot.data["history"],
            failed=snapshot.data["failed"],
            seconds=snapshot.data["seconds"],
            runs=begin(plan),
            rested=0,
            pushed=0,
            paid=np.zeros(0),
            missed=np.zeros(0),
        )

    def edit(
        self, params: DdpParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The ball is the UR5's target, to the millimetre."""
        if handle != "target":
            return {}
        changes: dict[str, Value] = {}
        for name, value in zip(("target_x", "target_y", "target_z"), point, strict=True):
            tunable = params.tunables[name]
            assert isinstance(tunable, Knob)
            changes[name] = min(max(round(float(value), 3), tunable.low), tunable.high)
        return changes

    # The world's clock ------------------------------------------------------------------------

    def step(self, params: DdpParams, inputs: Inputs, state: DdpState) -> DdpState:
        """10 ms of both runs; at the end of the motion a rest, and then from the start."""
        if state.trouble:
            return state
        plant = mechanism(params.system, params.payload, params.friction)
        steps = state.steps + 1
        state = replace(state, t=steps * self.period, steps=steps, pushed=max(state.pushed - 1, 0))
        if state.runs.finished(state.plan):
            if state.rested < REST:
                return replace(state, rested=state.rested + 1)
            return replace(state, rested=0, runs=begin(state.plan))
        runs, pushed = state.runs, state.pushed
        if "push" in inputs.actions:
            runs, pushed = _pushed(plant, runs, params.push), ARROW_STEPS
        disturbance, noise = _noise(params, state)
        held = np.zeros(plant.nu)
        runs = advance(
            state.plan,
            runs,
            (plant.acceleration(held), held),
            round(self.period / QUANTUM),
            params.bound,
            disturbance,
            noise,
        )
        state = replace(state, runs=runs, pushed=pushed)
        return self._ended(params, state) if runs.finished(state.plan) else state

    def _ended(self, params: DdpParams, state: DdpState) -> DdpState:
        """What each run paid, at the present weights, and where it came to."""
        cost = params.problem(state.plan.N, state.plan.h).cost
        both = tuple(zip(state.runs.X, state.runs.U, strict=True))
        known, goal = mechanism(params.system), _goal(params)
        return replace(
            state,
            paid=np.array([cost.value(X, U) for X, U in both]),
            missed=np.array([np.linalg.norm(known.tip(X[-1][: known.nq]) - goal) for X, _ in both]),
        )

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: DdpParams, state: DdpState) -> Measurement:
        """Costs and misses of the two runs: of the last motion that came to its end."""
        plan, runs = state.plan, state.runs
        n, k = plan.X.shape[1] // 2, runs.clock // plan.quanta
        planned = plan.X[k]
        measured: dict[str, float | np.ndarray] = {
            "q": runs.x[FEEDBACK, :n],
            "q_open": runs.x[OPEN_LOOP, :n],
            "q_bar": planned[:n],
            "v": runs.x[FEEDBACK, n:],
            "v_open": runs.x[OPEN_LOOP, n:],
            "v_bar": planned[n:],
            "u": runs.u[FEEDBACK],
            "u_bar": plan.U[min(k, plan.N - 1)],
            "cost": float(state.history.cost[-1]),
            "iteration": float(len(state.history.alpha)),
        }
        for i, suffix in ((FEEDBACK, ""), (OPEN_LOOP, "_open")):
            if len(state.paid):
                measured[f"paid{suffix}"] = float(state.paid[i])
                measured[f"missed{suffix}"] = float(state.missed[i])
        return measured

    def fields(self, params: DdpParams, state: DdpState) -> Mapping[str, np.ndarray]:
        """The iterations so far, and the gains along the motion."""
        history, plan = state.history, state.plan
        n, joint = plan.X.shape[1] // 2, params.motion.shown
        played = state.runs.X[FEEDBACK, : state.runs.clock // plan.quanta + 1]
        t, none = plan.h * np.arange(plan.N), np.zeros(0)
        found: dict[str, np.ndarray] = {
            "iterations": np.arange(len(history.cost), dtype=float),
            "stepped": np.arange(1.0, len(history.alpha) + 1.0),
            "cost": history.cost,
            "expected": -history.expected,
            "actual": -history.actual,
            "alpha": history.alpha,
            "mu": history.mu,
            "gradient": history.gradient,
            "angle_played": played[:, joint],
            "speed_played": played[:, n + joint],
            "gain_t": t,
            "gain_q1": plan.K[:, 0, 0],
            "gain_v1": plan.K[:, 0, n],
            "gain_t2": t if n > 1 else none,
            "gain_q2": plan.K[:, 0, 1] if n > 1 else none,
            "gain_v2": plan.K[:, 0, n + 1] if n > 1 else none,
        }
        for i in (0, *BEFORE):
            angle, speed = history.phases[-1 - i].T
            found |= {f"angle_{i}": angle, f"speed_{i}": speed}
        spent = [1e3 * np.asarray(state.seconds.get(phase, none)) for phase in PHASES]
        found["timed"] = np.arange(1.0, len(spent[0]) + 1.0)
        return found | dict(zip(PHASES, spent, strict=True))

    def draw(self, scene: Scene, params: DdpParams, state: DdpState) -> None:
        """The robot under feedback, its open-loop ghost, the path of the plan, and fading behind
        it those of earlier iterations."""
        plant, runs = mechanism(params.system), state.runs
        n, paths = plant.nq, state.history.tips
        behind = BEHIND if params.motion.goal else 0.0
        scene.camera(*params.motion.camera)
        effort = (
            None if params.bound is None else plant.S @ (np.abs(runs.u[FEEDBACK]) / params.bound)
        )
        scene.arm("robot", plant.arm, runs.x[FEEDBACK, :n], effort=effort)
        scene.arm("open loop", plant.arm, runs.x[OPEN_LOOP, :n], ghost=True)
        for i in range(KEPT - 1):
            if not np.array_equal(paths[i], paths[i + 1]):
                age = KEPT - 1 - i
                scene.trail(f"before {age}", paths[i] - age * behind, "muted", (i + 1) / KEPT)
        scene.trail("plan", paths[-1], "warning" if state.failed else "reference")
        gone = runs.clock // state.plan.quanta + 1
        if gone > 1:
            scene.trail("played", tips(plant, spread(runs.X[FEEDBACK, :gone])))
        ends = [plant.tip(x[:n]) for x in runs.x]
        if np.linalg.norm(ends[FEEDBACK] - ends[OPEN_LOOP]) > APART:
            scene.label("of open loop", "open loop", ends[OPEN_LOOP])
        if state.pushed:
            impulse = np.array([0.0, ARROW * params.push, 0.0])
            scene.arrow("push", ends[FEEDBACK], ends[FEEDBACK] + impulse)
        if params.motion.goal:
            scene.sphere("goal", _goal(params), 0.03, "reference")
        else:
            scene.handle("target", params.target, 0.04)

    @classmethod
    def prepare(cls) -> None:
        """One iteration of every kind."""
        for changes in ({}, {"method": "ddp"}, {"limited": True}):
            params = DdpParams(**changes)
            problem = params.problem(3, params.h)
            ddp.step(problem, params.options, ddp.init(problem, np.zeros((3, 1)), params.options))


@lru_cache(maxsize=16)
def _problem(params: DdpParams) -> Problem:
    return params.problem(round(params.horizon / params.h), params.h)


def _first_guess(params: DdpParams, problem: Problem) -> np.ndarray:
    return first_guess(problem, params.size, params.guess, params.guess_rate)


def _start(params: DdpParams, problem: Problem, state: DdpState) -> np.ndarray:
    """U to start from: the present solution, if there is one and it is wanted."""
    if params.start == "cold" or not len(state.history.alpha):
        return _first_guess(params, problem)
    return within(problem, resampled(state.plan.U, state.plan.h, params.h, problem.N))


def _data(
    plan: Policy, history: History, failed: bool, seconds: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    return {"plan": plan, "history": history, "failed": failed, "seconds": seconds}


def _path(params: DdpParams, at: Iterate) -> tuple[np.ndarray, np.ndarray]:
    """Of the tip (POINTS, 3), and of the joint shown (POINTS, 2)."""
    moved, joint = mechanism(params.system), params.motion.shown
    X = spread(at.X)
    return tips(moved, X), X[:, [joint, moved.nq + joint]]


def _goal(params: DdpParams) -> np.ndarray:
    """Where the tip should end (3,) [m]."""
    goal = params.motion.goal
    return mechanism(params.system).tip(np.array(goal)) if goal else params.target


def _pushed(plant: Mechanism, runs: Runs, push: float) -> Runs:
    impulse, n = np.array([0.0, push, 0.0]), plant.nq
    jumps = [struck(plant, x[:n], impulse) for x in runs.x]
    return kicked(runs, np.concatenate([np.zeros((2, n)), jumps], axis=1))


def _noise(params: DdpParams, state: DdpState) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Of this world step: torque (nu,), and measurement (quanta, nx)."""
    if not (params.noise or params.noise_torque):
        return None, None
    counter = state.steps << 64  # each step has 2^64 numbers of its own
    generator = np.random.Generator(np.random.Philox(key=state.key, counter=counter))
    nu, nx = state.plan.U.shape[1], state.plan.X.shape[1]
    torque = params.noise_torque * params.size * generator.standard_normal(nu)
    spread = params.noise * np.repeat([1.0, VELOCITY_NOISE], nx // 2)
    return torque, spread * generator.standard_normal((round(Ddp.period / QUANTUM), nx))
