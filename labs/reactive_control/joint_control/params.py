"""The tunables of joint control: arm, reference, control law, world and simulation."""

from labs.algorithms.integrators import INTEGRATORS
from labs.algorithms.joint_control import Gains
from labs.params import Group, Params
from labs.reactive_control.joint_control.references import cycles_per_second
from labs.reactive_control.joint_control.remedies import AvailableSettings
from labs.reactive_control.joint_control.sampled_stability import LoopParameters
from labs.tasks.arm.params import robot_choice
from labs.tasks.arm.postures import POSED_ARMS

CONTROLLERS = {
    "open-loop": "Open loop",
    "pid": "PID",
    "pd-gravity": "PD + gravity compensation",
    "computed-torque": "Computed torque (beyond the notes)",
}
CLOSED_LOOP = {"controller": ["pid", "pd-gravity", "computed-torque"]}
REFERENCES = {"set-point": "Set point", "sinusoid": "Sinusoid", "minimum-jerk": "Minimum jerk"}
HIGHEST_KP, HIGHEST_KD = 2000.0, 200.0
CONTROL_PERIODS = {
    0.001: "1 ms",
    0.002: "2 ms",
    0.005: "5 ms",
    0.01: "10 ms",
    0.02: "20 ms",
    0.05: "50 ms",
}
INTEGRATION_STEPS = {
    0.0001: "0.1 ms",
    0.0002: "0.2 ms",
    0.0005: "0.5 ms",
    0.001: "1 ms",
    0.002: "2 ms",
    0.005: "5 ms",
    0.01: "10 ms",
}
AVAILABLE_SETTINGS = AvailableSettings(
    tuple(CONTROL_PERIODS), tuple(INTEGRATION_STEPS), HIGHEST_KP, HIGHEST_KD
)
DIRECTIONS = {"x": "+x", "y": "+y", "z": "+z", "-x": "-x", "-y": "-y", "-z": "-z"}

ROBOT = Group("Robot", effect="restart")
REFERENCE = Group("Reference")
CONTROLLER = Group("Controller")
WORLD = Group("World")
SIMULATION = Group("Simulation")
PUSH = Group("Push")


class JointParams(Params):
    """What the user can turn."""

    robot: str = robot_choice(ROBOT, POSED_ARMS, key=True)
    """The arm to control."""
    reference: str = REFERENCE.choice("sinusoid", REFERENCES, "Reference", key=True)
    """The motion every joint should make, around the robot's home posture."""
    amplitude: float = REFERENCE.knob(0.3, 0.0, 0.8, "A", "rad", "Amplitude", step=0.01, key=True)
    """How far every joint moves from home. Moving this slider moves q_ref at once."""
    frequency: float = REFERENCE.knob(
        0.3, 0.05, 2.0, "f", "Hz", "Frequency", step=0.01, key=True, when={"reference": "sinusoid"}
    )
    """Of the sinusoid. A change keeps the phase, so the reference does not jump."""
    duration: float = REFERENCE.knob(
        1.5, 0.3, 5.0, "D", "s", "Duration", step=0.05, key=True, when={"reference": "minimum-jerk"}
    )
    """Of one minimum-jerk move; a rest of half of it follows."""
    initial_error: float = REFERENCE.knob(
        0.0, -0.5, 0.5, "q(0) - q^{ref}(0)", "rad", "Initial error", effect="restart"
    )
    """How far every joint starts from where the reference starts."""
    controller: str = CONTROLLER.choice("pd-gravity", CONTROLLERS, "Controller", key=True)
    """The law that turns the state and the reference into torques."""
    kp: float = CONTROLLER.knob(
        200.0,
        0.0,
        HIGHEST_KP,
        "k_p",
        "N·m/rad",
        scale="log",
        key=True,
        when=CLOSED_LOOP,
        units={"controller": {"computed-torque": "1/s²"}},
    )
    """Torque per error; in computed torque an acceleration per error."""
    ki: float = CONTROLLER.knob(
        0.0, 0.0, 2000.0, "k_i", "N·m/(rad·s)", scale="log", key=True, when={"controller": "pid"}
    )
    """Torque per integrated error, PID only. At zero the integral is emptied."""
    kd: float = CONTROLLER.knob(
        30.0,
        0.0,
        HIGHEST_KD,
        "k_d",
        "N·m·s/rad",
        scale="log",
        key=True,
        when=CLOSED_LOOP,
        units={"controller": {"computed-torque": "1/s"}},
    )
    """Torque per error of velocity; in computed torque an acceleration."""
    payload: float = WORLD.knob(0.0, 0.0, 10.0, "m_{load}", "kg", "Payload", step=0.1)
    """A point mass at the end-effector that the controller does not know of."""
    friction: float = WORLD.knob(0.0, 0.0, 20.0, "b", "N·m·s/rad", "Friction", step=0.1)
    """Viscous friction at every joint that the controller does not know of."""
    torque_limits: bool = WORLD.toggle(True, "Torque limits")
    """Cut every torque to what the motor can give. The plot shows the limits either way."""
    noise: float = WORLD.knob(
        0.0, 0.0, 0.02, "\\sigma", "rad", "Sensor noise", scale="log", when=CLOSED_LOOP
    )
    """Standard deviation of the measured angles; of the velocities it is 10/s times this."""
    control_period: float = SIMULATION.choice(0.001, CONTROL_PERIODS, "Control period", "T", "s")
    """Time between two looks of the controller; rounded up to whole integration steps."""
    integrator: str = SIMULATION.choice(
        "semi-implicit-euler",
        {name: method.title for name, method in INTEGRATORS.items()},
        "Integrator",
    )
    """The method that integrates the robot's motion."""
    step: float = SIMULATION.choice(0.001, INTEGRATION_STEPS, "Integration step", "h", "s")
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
    def loop_settings(self) -> LoopParameters:
        """The loop, for the analysis of its stability."""
        return LoopParameters(
            self.controller, self.gains, self.control_period, self.integrator, self.step
        )
