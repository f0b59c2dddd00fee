"""The tunables of the reference, the policy and the world it meets."""

from labs.optimal_control.lqr_tracking.laps import CONTROL_PERIOD, FEED_FORWARDS, ReferencePath
from labs.optimal_control.lqr_tracking.tracking import (
    LimitedPreview,
    TrackingSettings,
    limited_preview,
)
from labs.params import Group, Params

LONGEST_LAP = 6.0
"""[s]"""

ARM, CART = {"robot": "ur5"}, {"robot": "cart-pole"}

REFERENCE = Group("Reference")
POLICY = Group("Policy")
LINEAR_COSTS = Group("Linear costs")
WORLD = Group("World")


class TrackingParams(Params):
    """What the user can turn."""

    robot: str = REFERENCE.choice(
        "ur5", {"ur5": "UR5", "cart-pole": "Cart-pole"}, "Robot", effect="restart", key=True
    )
    """An arm with six motors, or a pole kept upright on a cart with one."""
    path: str = REFERENCE.choice(
        "circle", {"circle": "Circle", "square": "Square"}, "Path", key=True
    )
    """Of the end-effector. The cart follows the circle's shadow, or jumps to and fro."""
    radius: float = REFERENCE.knob(
        0.15, 0.0, 0.2, "A", "m", "Radius", step=0.005, key=True, when=ARM
    )
    """Of the circle, or of the one round the square. Drag the ball on it, too."""
    stroke: float = REFERENCE.knob(
        0.4, 0.0, 0.7, "A_p", "m", "Stroke", step=0.01, key=True, when=CART
    )
    """How far the cart's reference goes to either side. Drag the ball, too."""
    plane: str = REFERENCE.choice(
        "frontal",
        {"frontal": "Frontal", "horizontal": "Horizontal", "side": "Side"},
        "Plane",
        when=ARM,
    )
    """Of the UR5's path."""
    lap_time: float = REFERENCE.knob(3.0, 1.0, LONGEST_LAP, "T", "s", "Period", step=0.1, key=True)
    """Of one lap. A change keeps the phase."""
    feed_forward: str = REFERENCE.choice("none", FEED_FORWARDS, "Feed-forward", "u^{ref}")
    """What the reference control holds. What it lacks is left to the feedback and to k."""
    preview: float = POLICY.knob(60.0, 0.0, 100.0, "N", "steps", "Preview", step=1.0, key=True)
    """Steps of 20 ms that the policy sees ahead. With none it is the ghost's."""
    position_weight: float = POLICY.knob(
        100.0,
        1.0,
        1e4,
        "Q_q",
        "1/rad²",
        "Position weight",
        scale="log",
        units={"robot": {"cart-pole": "1/rad², 1/m²"}},
    )
    """Cost of a squared error of position, the same for all joints."""
    velocity_weight: float = POLICY.knob(
        1.0,
        0.01,
        100.0,
        "Q_v",
        "s²/rad²",
        "Velocity weight",
        scale="log",
        units={"robot": {"cart-pole": "s²/rad², s²/m²"}},
    )
    """Cost of a squared error of velocity, the same for all joints."""
    effort_weight: float = POLICY.knob(
        20.0, 0.1, 1e4, "R", "", "Effort weight", scale="log", key=True
    )
    """Cost of a control that differs from the reference control by the motor's limit."""
    lean: float = LINEAR_COSTS.knob(
        0.0, -20.0, 20.0, "q", "1/rad", "Lean", step=0.1, units={"robot": {"cart-pole": "1/m"}}
    )
    """Linear cost of the place of the shoulder, or of the cart: positive pushes it back."""
    price: float = LINEAR_COSTS.knob(0.0, -20.0, 20.0, "s", "", "Price", step=0.1)
    """Linear cost of the effort at the shoulder, or the cart: positive favours negative."""
    wind: float = WORLD.knob(0.0, -20.0, 20.0, "f_y", "N", "Wind", step=0.5, key=True)
    """A steady force on the end-effector, or on the cart, along the world's y axis."""
    wind_known: bool = WORLD.toggle(True, "Wind known")
    """Whether the policy's model has the wind, as part of the defect c."""
    payload: float = WORLD.knob(0.0, 0.0, 2.0, "m_{load}", "kg", "Payload", step=0.05)
    """A point mass at the tip that no policy knows of."""
    push_force: float = WORLD.knob(20.0, -60.0, 60.0, "f_{push}", "N", "Push force", step=1.0)
    """Of a push: along the y axis like the wind, for 0.2 s, known to nobody."""

    @property
    def samples(self) -> int:
        """Steps of a lap."""
        return round(self.lap_time / CONTROL_PERIOD)

    @property
    def reference_path(self) -> ReferencePath:
        if self.robot == "cart-pole":
            return ReferencePath(self.robot, self.path, self.stroke, self.samples)
        return ReferencePath(self.robot, self.path, self.radius, self.samples, self.plane)

    @property
    def settings(self) -> TrackingSettings:
        return TrackingSettings(
            self.reference_path,
            self.feed_forward,
            self.wind if self.wind_known else 0.0,
            (self.position_weight, self.velocity_weight, self.effort_weight),
            (self.lean, self.price),
        )

    def policy_at(self, phase: float) -> LimitedPreview:
        """The policy at a phase of the lap [cycles], with as many steps ahead as it may see."""
        index = round(phase * self.samples) % self.samples
        return limited_preview(self.settings, index, int(self.preview))
