"""Joint motion control (notes, 1.2): an arm follows a reference motion of its joints."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import ClassVar

import numpy as np

from labs.algorithms.integrators import INTEGRATORS
from labs.algorithms.joint_control import CONTROL_LAWS, ControlLaw, Gains
from labs.lab import Action, Handle, Inputs, Lab, Measurement, State
from labs.models.arms import load_arm
from labs.models.plant import Force, Plant, plant
from labs.params import Value
from labs.reactive_control.joint_control.disturbances import end_effector_force, measurement_noise
from labs.reactive_control.joint_control.divergence import divergence_message
from labs.reactive_control.joint_control.linearisation import linear_loop, loops_along_reference
from labs.reactive_control.joint_control.params import (
    AVAILABLE_SETTINGS,
    CONTROL_PERIODS,
    JointParams,
)
from labs.reactive_control.joint_control.plots import PLOTS, eigenvalue_fields
from labs.reactive_control.joint_control.references import reference_motion
from labs.reactive_control.joint_control.sampled_control import (
    TIME_UNIT,
    SampledLoop,
    control_ticks,
    simulate_sampled,
    to_time_units,
)
from labs.reactive_control.joint_control.step_response import StepResponse
from labs.scene import Scene
from labs.tasks.arm.trail import TRAIL_POINTS, TRAIL_STRIDE, append_row, draw_trail

PUSH_STEPS = 20
"""World steps a push lasts: 0.2 s."""
SPEED_LIMIT = 100.0
"""[rad/s] a joint faster than this has diverged; real arms reach about 3."""
ERROR_WINDOW = 100
"""World steps over which the steady-state error is a mean: 1 s."""
FORCE_ARROW = 1.0 / 250.0
"""[m/N] length of the force's arrow."""


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
    since_tick: int = 0
    """Time since the last control tick, in units of 0.1 ms."""
    phase: float = 0.0
    """Of the reference [cycles]."""
    noise_key: int = 0
    """Of the noise's random numbers; their counter is `steps`."""
    push_left: int = 0
    """World steps the push still lasts."""
    sum_of_squares: float = 0.0
    """Sum over the steps of the mean squared error [rad^2]."""
    peak_torque: float = 0.0
    errors: np.ndarray
    """(ERROR_WINDOW, nv) [rad] the newest last."""
    trail: np.ndarray
    """(TRAIL_POINTS, 3) [m] where the end-effector was, the newest last."""
    reference_trail: np.ndarray
    """(TRAIL_POINTS, 3) [m] where the reference would have had it."""
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
    plots = PLOTS
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
            since_tick=to_time_units(max(CONTROL_PERIODS)),
            noise_key=int(rng.integers(2**63)),
            sum_of_squares=float(error @ error) / len(error),
            errors=np.tile(error, (ERROR_WINDOW, 1)),
            trail=np.tile(tip, (TRAIL_POINTS, 1)),
            reference_trail=np.tile(ghost, (TRAIL_POINTS, 1)),
            response=StepResponse.begin(0.0, error) if params.reference == "set-point" else None,
        )

    def step(self, params: JointParams, inputs: Inputs, state: JointState) -> JointState:
        """10 ms: control ticks and the integration steps between them. Beyond `SPEED_LIMIT` the
        state keeps its last sane values and says what happened."""
        if state.trouble:
            return state
        world = plant(params.robot, params.payload)
        push_left = PUSH_STEPS if "push" in inputs.actions else state.push_left
        force = end_effector_force(params, push_left > 0, inputs.handles.get("pull"))
        h = to_time_units(params.step)
        steps = to_time_units(self.period) // h
        due, since = control_ticks(state.since_tick, to_time_units(params.control_period), h, steps)

        phase = state.phase + params.rate * _tick_times(due, steps, h)
        q_ref, v_ref, a_ref = self._reference(params, phase)
        loop = self._loop(params, world, force, state.torque.copy())
        with np.errstate(all="ignore"):
            q, v, z, torques = simulate_sampled(
                loop,
                due,
                steps,
                (q_ref[1:], v_ref[1:], a_ref[1:]),
                measurement_noise(
                    params, state.noise_key, state.steps, self.period, due, len(state.q)
                ),
                state.q,
                state.v,
                state.integral if params.integrates else np.zeros_like(state.q),
            )
            diverged = _has_diverged(v)
        if diverged:
            return _stop_diverged(params, state)

        count = state.steps + 1
        t = count * self.period
        response = self._update_response(params, state, q_ref[0])
        error = q_ref[-1] - q
        tip = world.tip(q)
        trail, reference_trail = state.trail.copy(), state.reference_trail.copy()
        if count % TRAIL_STRIDE == 0:
            trail = append_row(trail, tip)
            reference_trail = append_row(reference_trail, world.tip(q_ref[-1]))
        return JointState(
            t=t,
            q=q,
            v=v,
            q_ref=q_ref[-1].copy(),
            integral=z,
            torque=loop.held,
            force=force(tip) if force else np.zeros(3),
            steps=count,
            since_tick=since,
            phase=float(phase[-1]) % 1.0,
            noise_key=state.noise_key,
            push_left=max(push_left - 1, 0),
            sum_of_squares=state.sum_of_squares + float(error @ error) / len(error),
            peak_torque=max(state.peak_torque, float(np.abs(torques).max(initial=0.0))),
            errors=append_row(state.errors, error),
            trail=trail,
            reference_trail=reference_trail,
            response=response.update(t, error) if response else None,
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
            "rms_error": (state.sum_of_squares / (state.steps + 1)) ** 0.5,
            "peak_torque": state.peak_torque,
            "force": float(state.force @ state.force) ** 0.5,
        }
        if state.steps >= ERROR_WINDOW:
            mean = np.add.reduce(state.errors) / ERROR_WINDOW
            measured["steady_state_error"] = float(np.abs(mean).max())
        if response := state.response:
            measured["overshoot"] = 100.0 * response.overshoot
            if response.settled >= 0.0:
                measured["settling_time"] = response.settled
        return measured

    def fields(self, params: JointParams, state: JointState) -> Mapping[str, np.ndarray]:
        """Eigenvalues of the loop linearised at rest at the reference: under continuous
        control, and of one control period as simulated."""
        return eigenvalue_fields(linear_loop(params, state.q_ref), params.loop_settings)

    def draw(self, scene: Scene, params: JointParams, state: JointState) -> None:
        """The arm, a ghost at the reference, where both end-effectors were, and the force."""
        arm = load_arm(params.robot)
        tip = (
            state.trail[-1] if state.steps % TRAIL_STRIDE == 0 else plant(params.robot).tip(state.q)
        )
        scene.camera(*arm.camera)
        scene.arm("robot", arm, state.q, effort=np.abs(state.torque) / arm.torque_limit)
        scene.arm("reference", arm, state.q_ref, ghost=True)
        draw_trail(scene, "trail", state.trail, state.steps)
        draw_trail(scene, "reference trail", state.reference_trail, state.steps, "reference")
        if state.force.any():
            scene.arrow("force", tip, tip + FORCE_ARROW * state.force)
        scene.handle("pull", tip)

    def _reference(
        self, params: JointParams, phase: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        home = load_arm(params.robot).home
        return reference_motion(params.reference, home, params.amplitude, params.rate, phase)

    def _loop(
        self, params: JointParams, world: Plant, force: Force | None, held: np.ndarray
    ) -> SampledLoop:
        return SampledLoop(
            law=_law(params.controller, params.robot, params.gains),
            limit=_torque_limit(params.robot, params.torque_limits),
            acceleration=world.acceleration(held, params.friction, force),
            held=held,
            integrate=INTEGRATORS[params.integrator].step,
            h=params.step,
            integral_gain=params.loop_settings.period if params.integrates else 0.0,
        )

    def _update_response(
        self, params: JointParams, state: JointState, q_ref: np.ndarray
    ) -> StepResponse | None:
        """The step response under way; a set point that has moved begins another."""
        if params.reference != "set-point":
            return None
        if q_ref[0] == state.q_ref[0]:
            return state.response
        return StepResponse.begin(state.t, q_ref - state.q)


@lru_cache(maxsize=16)
def _law(controller: str, robot: str, gains: Gains) -> ControlLaw:
    known = plant(robot)
    return CONTROL_LAWS[controller](known.model, known.data, gains)


@lru_cache(maxsize=256)
def _tick_times(due: tuple[int, ...], steps: int, h: int) -> np.ndarray:
    """Times [s] after a world step's start: its start, its control ticks and its end."""
    return np.array((0, *due, steps)) * (h * TIME_UNIT)


def _has_diverged(v: np.ndarray) -> bool:
    """Whether a joint is faster than `SPEED_LIMIT` or no number; the sum of squares, quick to
    compute, says for most that none is."""
    if float(v @ v) <= SPEED_LIMIT**2:
        return False
    return not float(np.abs(v).max()) <= SPEED_LIMIT


@cache
def _torque_limit(robot: str, limited: bool) -> np.ndarray:
    """(nv,) [N m], infinite when the motors are not limited."""
    limit = load_arm(robot).torque_limit
    return limit if limited else np.full_like(limit, np.inf)


def _stop_diverged(params: JointParams, state: JointState) -> JointState:
    """The last sane state, and why it went no further."""
    why = divergence_message(
        loops_along_reference(params, state.q_ref), params.loop_settings, AVAILABLE_SETTINGS
    )
    stopped = copy.deepcopy(state)
    stopped.trouble = (
        f"Diverged at t = {state.t:.2f} s: a joint passed {SPEED_LIMIT:g} rad/s. {why}"
    )
    return stopped
