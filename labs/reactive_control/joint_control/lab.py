"""Joint motion control (notes, 1.2): an arm follows a reference motion of its joints."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import ClassVar

import numpy as np

from labs.algorithms.integrators import INTEGRATORS
from labs.algorithms.joint_control import LAWS, Gains, Law
from labs.lab import Action, Handle, Inputs, Lab, Measurement, State
from labs.models.arms import load
from labs.models.plant import Force, Plant, plant
from labs.params import Group, Params, Value
from labs.plots import Curves, Line, Readout, TimeSeries, Trace
from labs.reactive_control.joint_control.divergence import Menu, explain
from labs.reactive_control.joint_control.references import cycles_per_second, motion
from labs.reactive_control.joint_control.sampled_control import (
    UNIT,
    Loop,
    run,
    ticks,
    time_between_ticks,
    units,
)
from labs.reactive_control.joint_control.sampled_stability import LinearLoop, Robot, Setting
from labs.reactive_control.joint_control.step_response import StepResponse
from labs.scene import Scene

PUSH_STEPS = 20
"""World steps a push lasts: 0.2 s."""
SPRING = 400.0
"""[N/m] between the end-effector and the handle that pulls it."""
STRONGEST_PULL = 150.0
"""[N]"""
VELOCITY_NOISE = 10.0
"""[1/s] noise of the measured velocity [rad/s] for each radian of noise of the angle."""
FASTEST = 100.0
"""[rad/s] a joint faster than this has diverged; real arms reach about 3."""
LAST = 100
"""World steps over which the steady-state error is a mean: 1 s."""
TRAIL, TRAIL_EVERY = 150, 2
"""Points of a trail, and world steps between two: 3 s."""
ARROW = 1.0 / 250.0
"""[m/N] length of the force's arrow."""

ROBOTS = {"ur5": "UR5", "panda": "Franka Panda", "double-pendulum": "Double pendulum"}
CONTROLLERS = {
    "open-loop": "Open loop",
    "pid": "PID",
    "pd-gravity": "PD + gravity compensation",
    "computed-torque": "Computed torque (beyond the notes)",
}
REFERENCES = {"set-point": "Set point", "sinusoid": "Sinusoid", "minimum-jerk": "Minimum jerk"}
HIGHEST_KD = 200.0
PERIODS = {0.001: "1 ms", 0.002: "2 ms", 0.005: "5 ms", 0.01: "10 ms", 0.02: "20 ms", 0.05: "50 ms"}
STEPS = {
    0.0001: "0.1 ms",
    0.0002: "0.2 ms",
    0.0005: "0.5 ms",
    0.001: "1 ms",
    0.002: "2 ms",
    0.005: "5 ms",
    0.01: "10 ms",
}
DIRECTIONS = {"x": "+x", "y": "+y", "z": "+z", "-x": "-x", "-y": "-y", "-z": "-z"}


ROBOT = Group("Robot", effect="restart")
REFERENCE = Group("Reference")
CONTROLLER = Group("Controller")
WORLD = Group("World")
SIMULATION = Group("Simulation")
PUSH = Group("Push")


class JointParams(Params):
    """What the user can turn."""

    robot: str = ROBOT.choice("ur5", ROBOTS, "Robot")
    """The arm to control."""
    reference: str = REFERENCE.choice("sinusoid", REFERENCES, "Reference")
    """The motion every joint should make, around the robot's home posture."""
    amplitude: float = REFERENCE.knob(0.3, 0.0, 0.8, "A", "rad", "Amplitude", step=0.01)
    """How far every joint moves from home. Moving this slider moves q_ref at once."""
    frequency: float = REFERENCE.knob(0.3, 0.05, 2.0, "f", "Hz", "Frequency", step=0.01)
    """Of the sinusoid. A change keeps the phase, so the reference does not jump."""
    duration: float = REFERENCE.knob(1.5, 0.3, 5.0, "D", "s", "Duration", step=0.05)
    """Of one minimum-jerk move; a rest of half of it follows."""
    initial_error: float = REFERENCE.knob(
        0.0, -0.5, 0.5, "q(0) - q^{ref}(0)", "rad", "Initial error", effect="restart"
    )
    """How far every joint starts from where the reference starts."""
    controller: str = CONTROLLER.choice("pd-gravity", CONTROLLERS, "Controller")
    """The law that turns the state and the reference into torques."""
    kp: float = CONTROLLER.knob(200.0, 0.0, 2000.0, "k_p", "N·m/rad", scale="log")
    """Torque per error. In computed torque an acceleration per error, 1/s²."""
    ki: float = CONTROLLER.knob(0.0, 0.0, 2000.0, "k_i", "N·m/(rad·s)", scale="log")
    """Torque per integrated error, PID only. At zero the integral is emptied."""
    kd: float = CONTROLLER.knob(30.0, 0.0, HIGHEST_KD, "k_d", "N·m·s/rad", scale="log")
    """Torque per error of velocity. In computed torque 1/s."""
    payload: float = WORLD.knob(0.0, 0.0, 10.0, "m_{load}", "kg", "Payload", step=0.1)
    """A point mass at the end-effector that the controller does not know of."""
    friction: float = WORLD.knob(0.0, 0.0, 20.0, "b", "N·m·s/rad", "Friction", step=0.1)
    """Viscous friction at every joint that the controller does not know of."""
    torque_limits: bool = WORLD.toggle(True, "Torque limits")
    """Cut every torque to what the motor can give. The plot shows the limits either way."""
    noise: float = WORLD.knob(0.0, 0.0, 0.02, "\\sigma", "rad", "Sensor noise", scale="log")
    """Standard deviation of the measured angles; of the velocities it is 10/s times this."""
    control_period: float = SIMULATION.choice(0.001, PERIODS, "Control period", "T", "s")
    """Time between two looks of the controller; rounded up to whole integration steps."""
    integrator: str = SIMULATION.choice(
        "semi-implicit-euler",
        {name: method.title for name, method in INTEGRATORS.items()},
        "Integrator",
    )
    """The method that integrates the robot's motion."""
    step: float = SIMULATION.choice(0.001, STEPS, "Integration step", "h", "s")
    """Length of one step of the integrator."""
    push_force: float = PUSH.knob(80.0, 0.0, 200.0, "f_{push}", "N", "Push force", step=1.0)
    """Force on the end-effector while a push lasts, 0.2 s."""
    push_direction: str = PUSH.choice("-y", DIRECTIONS, "Push direction")
    """Along which axis of the world to push."""

    @property
    def gains(self) -> Gains:
        return Gains(self.kp, self.ki, self.kd)

    @property
    def rate(self) -> float:
        """Of the reference [cycles/s]."""
        return cycles_per_second(self.reference, self.frequency, self.duration)

    @property
    def integrates(self) -> bool:
        """Whether the controller sums up its error."""
        return self.controller == "pid" and self.ki > 0.0

    @property
    def setting(self) -> Setting:
        """The loop, for the analysis of its stability."""
        period = time_between_ticks(units(self.control_period), units(self.step)) * UNIT
        return Setting(self.controller, self.gains, period, self.integrator, self.step)


@dataclass(kw_only=True)
class JointState(State):
    """The robot, its controller's memory and what the read-outs remember. Arrays are never
    written after they are made; every step makes new ones."""

    q: np.ndarray
    v: np.ndarray
    q_ref: np.ndarray
    integral: np.ndarray
    """(nv,) [rad s] the controller's integral of the error."""
    torque: np.ndarray
    """(nv,) [N m] the torque held now; zero before the first control tick."""
    force: np.ndarray
    """(3,) [N] on the end-effector, in the world's axes."""
    steps: int = 0
    """World steps done: t = steps * period."""
    since: int = 0
    """Time since the last control tick, in units of 0.1 ms."""
    phase: float = 0.0
    """Of the reference [cycles]."""
    key: int = 0
    """Of the noise's random numbers; their counter is `steps`."""
    push_left: int = 0
    """World steps the push still lasts."""
    squares: float = 0.0
    """Sum over the steps of the mean squared error [rad^2]."""
    peak_torque: float = 0.0
    errors: np.ndarray
    """(LAST, nv) [rad] the newest last."""
    trail: np.ndarray
    """(TRAIL, 3) [m] where the end-effector was, the newest last."""
    ghost_trail: np.ndarray
    """(TRAIL, 3) [m] where the reference would have had it."""
    response: StepResponse | None = None
    """To the last step of a set point."""


class JointControl(Lab[JointParams, JointState]):
    """An arm whose joints follow a reference motion."""

    title = "Joint motion control"
    section = "1.2"
    summary = (
        "Make a robot arm follow a motion of its joints: open loop, PID, PD with gravity "
        "compensation, computed torque."
    )
    Params = JointParams
    period = 0.01
    plots = (
        TimeSeries(
            "Position", "rad", Line("q", "q"), Line("q_ref", "q^{ref}", "dash"), select="joint"
        ),
        TimeSeries("Error", "rad", Line("error", "e = q^{ref} - q"), select="joint"),
        TimeSeries(
            "Torque",
            "N·m",
            Line("torque", r"\tau"),
            Line("torque_limit", r"\tau_{max}", "limit"),
            Line("torque_floor", r"-\tau_{max}", "limit"),
            select="joint",
        ),
        TimeSeries(
            "Energy", "J", Line("kinetic", "T"), Line("potential", "U"), Line("total", "T + U")
        ),
        Curves(
            "Closed-loop eigenvalues",
            "Re [1/s]",
            "Im [1/s]",
            Trace("poles_re", "poles_im", style="points", series=1),
            guide="left-half-plane",
        ),
        Curves(
            "Eigenvalues of one control period",
            "Re",
            "Im",
            Trace("map_re", "map_im", style="points", series=1),
            guide="unit-circle",
        ),
        Readout("rms_error", "RMS error", "rad"),
        Readout("steady_state_error", "Steady-state error (last second)", "rad"),
        Readout("overshoot", "Overshoot", "%"),
        Readout("settling_time", "Settling time (2 %)", "s"),
        Readout("peak_torque", "Peak torque", "N·m"),
        Readout("force", "Force on the end-effector", "N"),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "PID at a set point": {
            "controller": "pid",
            "reference": "set-point",
            "kp": 500.0,
            "ki": 500.0,
            "kd": 60.0,
        },
        "Stiff and fast": {"kp": 1500.0, "kd": 80.0, "frequency": 0.6},
        "Computed torque": {"controller": "computed-torque", "frequency": 0.8},
        "Zero gravity, to be pushed": {"reference": "set-point", "kp": 0.0, "kd": 2.0},
        "Panda, minimum jerk": {"robot": "panda", "reference": "minimum-jerk"},
        "Double pendulum": {"robot": "double-pendulum", "amplitude": 0.6, "frequency": 0.5},
    }
    actions = (Action("push", "Push", "Pushes the end-effector for 0.2 s."),)
    handles = (Handle("pull", "Pulls the end-effector towards where it is dragged."),)

    def init(self, params: JointParams, rng: np.random.Generator) -> JointState:
        """q(0) = q_ref(0) + initial error, v(0) = v_ref(0)."""
        world = plant(params.robot, params.payload)
        q_ref, v_ref, _ = self._reference(params, np.zeros(1))
        q = q_ref[0] + params.initial_error
        error = q_ref[0] - q
        tip, ghost = world.tip(q), world.tip(q_ref[0])
        return JointState(
            q=q,
            v=v_ref[0].copy(),
            q_ref=q_ref[0].copy(),
            integral=np.zeros_like(q),
            torque=np.zeros_like(q),
            force=np.zeros(3),
            since=units(max(PERIODS)),
            key=int(rng.integers(2**63)),
            squares=float(error @ error) / len(error),
            errors=np.tile(error, (LAST, 1)),
            trail=np.tile(tip, (TRAIL, 1)),
            ghost_trail=np.tile(ghost, (TRAIL, 1)),
            response=StepResponse.to(0.0, error) if params.reference == "set-point" else None,
        )

    def step(self, params: JointParams, inputs: Inputs, state: JointState) -> JointState:
        """10 ms: control ticks and the integration steps between them. Beyond `FASTEST` the
        state keeps its last sane values and says what happened."""
        if state.trouble:
            return state
        world = plant(params.robot, params.payload)
        push_left = PUSH_STEPS if "push" in inputs.actions else state.push_left
        force = _force(params, push_left, inputs.handles.get("pull"))
        h = units(params.step)
        steps = units(self.period) // h
        due, since = ticks(state.since, units(params.control_period), h, steps)

        phase = state.phase + params.rate * _offsets(due, steps, h)
        q_ref, v_ref, a_ref = self._reference(params, phase)
        loop = self._loop(params, world, force, state.torque.copy())
        with np.errstate(all="ignore"):
            q, v, z, torques = run(
                loop,
                due,
                steps,
                (q_ref[1:], v_ref[1:], a_ref[1:]),
                self._noise(params, state, due),
                state.q,
                state.v,
                state.integral if params.integrates else np.zeros_like(state.q),
            )
            diverging = _diverging(v)
        if diverging:
            return self._diverged(params, world, state)

        count = state.steps + 1
        t = count * self.period
        response = self._response(params, state, q_ref[0])
        error = q_ref[-1] - q
        tip = world.tip(q)
        trail, ghost_trail = state.trail.copy(), state.ghost_trail.copy()
        if count % TRAIL_EVERY == 0:
            trail, ghost_trail = _pushed(trail, tip), _pushed(ghost_trail, world.tip(q_ref[-1]))
        return JointState(
            t=t,
            q=q,
            v=v,
            q_ref=q_ref[-1].copy(),
            integral=z,
            torque=loop.held,
            force=force(tip) if force else np.zeros(3),
            steps=count,
            since=since,
            phase=float(phase[-1]) % 1.0,
            key=state.key,
            push_left=max(push_left - 1, 0),
            squares=state.squares + float(error @ error) / len(error),
            peak_torque=max(state.peak_torque, float(np.abs(torques).max(initial=0.0))),
            errors=_pushed(state.errors, error),
            trail=trail,
            ghost_trail=ghost_trail,
            response=response.after(t, error) if response else None,
        )

    def measure(self, params: JointParams, state: JointState) -> Measurement:
        """At the state's time. RMS: since the start, over all joints. Steady-state error: the
        largest |mean error| of a joint over the last second. Overshoot and settling time: of
        the last step of a set point. With torque limits off, the limits are still those of
        the motors."""
        world = plant(params.robot, params.payload)
        kinetic, potential = world.energy(state.q, state.v)
        limit = world.arm.torque_limit
        measured: dict[str, float | np.ndarray] = {
            "q": state.q,
            "q_ref": state.q_ref,
            "v": state.v,
            "error": state.q_ref - state.q,
            "torque": state.torque,
            "torque_limit": limit,
            "torque_floor": -limit,
            "kinetic": kinetic,
            "potential": potential,
            "total": kinetic + potential,
            "rms_error": (state.squares / (state.steps + 1)) ** 0.5,
            "peak_torque": state.peak_torque,
            "force": float(state.force @ state.force) ** 0.5,
        }
        if state.steps >= LAST:
            mean = np.add.reduce(state.errors) / LAST
            measured["steady_state_error"] = float(np.abs(mean).max())
        if response := state.response:
            measured["overshoot"] = 100.0 * response.overshoot
            if response.settled >= 0.0:
                measured["settling_time"] = response.settled
        return measured

    def fields(self, params: JointParams, state: JointState) -> Mapping[str, np.ndarray]:
        """Eigenvalues of the loop linearised at rest at the reference: under continuous
        control, and of one control period as simulated."""
        loop = _linearised(params, state)
        poles, multipliers = loop.poles(params.setting), loop.multipliers(params.setting)
        return {
            "poles_re": poles.real,
            "poles_im": poles.imag,
            "map_re": multipliers.real,
            "map_im": multipliers.imag,
        }

    def draw(self, scene: Scene, params: JointParams, state: JointState) -> None:
        """The arm, a ghost at the reference, where both end-effectors were, and the force."""
        arm = load(params.robot)
        tip = (
            state.trail[-1] if state.steps % TRAIL_EVERY == 0 else plant(params.robot).tip(state.q)
        )
        scene.camera(*arm.camera)
        scene.arm("robot", arm, state.q, effort=np.abs(state.torque) / arm.torque_limit)
        scene.arm("reference", arm, state.q_ref, ghost=True)
        points = min(state.steps // TRAIL_EVERY + 1, TRAIL)
        if points > 1:
            scene.trail("trail", state.trail[-points:])
            scene.trail("reference trail", state.ghost_trail[-points:], "reference")
        if state.force.any():
            scene.arrow("force", tip, tip + ARROW * state.force)
        scene.handle("pull", tip)

    def _reference(
        self, params: JointParams, phase: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        home = load(params.robot).home
        return motion(params.reference, home, params.amplitude, params.rate, phase)

    def _loop(
        self, params: JointParams, world: Plant, force: Force | None, held: np.ndarray
    ) -> Loop:
        return Loop(
            law=_law(params.controller, params.robot, params.gains),
            limit=_limit(params.robot, params.torque_limits),
            acceleration=world.acceleration(held, params.friction, force),
            held=held,
            integrate=INTEGRATORS[params.integrator].step,
            h=params.step,
            integral_gain=params.setting.period if params.integrates else 0.0,
        )

    def _noise(
        self, params: JointParams, state: JointState, due: tuple[int, ...]
    ) -> np.ndarray | None:
        """(m, 2, nv) for the ticks due, from numbers numbered by time: one row for each
        millisecond, whatever the step of integration."""
        if params.noise == 0.0:
            return None
        counter = state.steps << 64  # each step has 2^64 numbers of its own
        generator = np.random.Generator(np.random.Philox(key=state.key, counter=counter))
        rows: np.ndarray = generator.standard_normal(
            (units(self.period) // units(0.001), 2, len(state.q))
        )
        rows *= np.array([[params.noise], [VELOCITY_NOISE * params.noise]])
        step = units(params.step)
        chosen: np.ndarray = rows[[k * step // units(0.001) for k in due]]
        return chosen

    def _response(
        self, params: JointParams, state: JointState, q_ref: np.ndarray
    ) -> StepResponse | None:
        """The step response under way; a set point that has moved begins another."""
        if params.reference != "set-point":
            return None
        if q_ref[0] == state.q_ref[0]:
            return state.response
        return StepResponse.to(state.t, q_ref - state.q)

    def _diverged(self, params: JointParams, world: Plant, state: JointState) -> JointState:
        why = explain(
            _linearised(params, state),
            params.setting,
            Menu(tuple(PERIODS), tuple(STEPS), HIGHEST_KD),
        )
        stopped = copy.deepcopy(state)
        stopped.trouble = (
            f"Diverged at t = {state.t:.2f} s: a joint passed {FASTEST:g} rad/s. {why}"
        )
        return stopped


@lru_cache(maxsize=16)
def _law(controller: str, robot: str, gains: Gains) -> Law:
    known = plant(robot)
    return LAWS[controller](known.model, known.data, gains)


@lru_cache(maxsize=256)
def _offsets(due: tuple[int, ...], steps: int, h: int) -> np.ndarray:
    """Times [s] after a world step's start: its start, its control ticks and its end."""
    return np.array((0, *due, steps)) * (h * UNIT)


def _diverging(v: np.ndarray) -> bool:
    """Whether a joint is faster than `FASTEST` or no number; the sum of squares, quick to
    compute, says for most that none is."""
    if float(v @ v) <= FASTEST**2:
        return False
    return not float(np.abs(v).max()) <= FASTEST


@cache
def _limit(robot: str, limited: bool) -> np.ndarray:
    """(nv,) [N m], infinite when the motors are not limited."""
    limit = load(robot).torque_limit
    return limit if limited else np.full_like(limit, np.inf)


def _force(
    params: JointParams, push_left: int, handle: tuple[float, float, float] | None
) -> Force | None:
    """The force on the end-effector: a push while it lasts, and a spring towards the handle
    while it is held, no stronger than `STRONGEST_PULL`. None when there is neither."""
    push = np.zeros(3)
    if push_left > 0:
        sign = -1.0 if params.push_direction.startswith("-") else 1.0
        push["xyz".index(params.push_direction[-1])] = sign * params.push_force
    if handle is None:
        return (lambda tip: push) if push.any() else None
    target = np.array(handle)

    def force(tip: np.ndarray) -> np.ndarray:
        pull: np.ndarray = SPRING * (target - tip)
        size = float(pull @ pull) ** 0.5
        applied: np.ndarray = push + pull * (STRONGEST_PULL / max(size, STRONGEST_PULL))
        return applied

    return force


def _linearised(params: JointParams, state: JointState) -> LinearLoop:
    """The loop at rest at the reference, the robot with its payload, the controller without."""
    world, known = plant(params.robot, params.payload), plant(params.robot)
    robot = Robot.near(world.model, world.data, state.q_ref, params.friction)
    return LinearLoop(robot, known.model, known.data, state.q_ref)


def _pushed(rows: np.ndarray, newest: np.ndarray) -> np.ndarray:
    """The rows (k, n) moved up by one, the newest last."""
    moved = np.empty_like(rows)
    moved[:-1] = rows[1:]
    moved[-1] = newest
    return moved
