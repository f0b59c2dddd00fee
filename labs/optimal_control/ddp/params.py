"""The tunables of the solver and of the world its plan meets."""

from labs.algorithms.ddp import DdpOptions
from labs.optimal_control.ddp.motion_params import MotionParams
from labs.params import Group

TOLERANCE = 1e-8
"""Of the cost: what a step must promise to be worth taking."""

SOLVER = Group("Solver", effect="solve")
WORLD = Group("World")


class DdpParams(MotionParams):
    """What the user can turn."""

    method: str = SOLVER.choice(
        "ilqr",
        {"ilqr": "iLQR (Gauss-Newton)", "ddp": "DDP (second derivatives)"},
        "Method",
        key=True,
    )
    """Whether the second derivatives of the dynamics enter."""
    start: str = SOLVER.choice(
        "warm", {"warm": "Warm: the present solution", "cold": "Cold: the first guess"}, "Start"
    )
    """What a change of the problem is solved from."""
    guess: float = SOLVER.knob(0.0, -1.0, 1.0, "A", "u₀", "First guess", step=0.01)
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
    payload: float = WORLD.knob(0.0, 0.0, 3.0, "m_{load}", "kg", "Payload", step=0.01, key=True)
    """A point mass at the tip that the plan does not know of."""
    friction: float = WORLD.knob(0.0, 0.0, 10.0, "b", "N·m·s/rad", "Friction", scale="log")
    """Viscous friction at every joint that the plan does not know of."""
    noise: float = WORLD.knob(0.0, 0.0, 0.05, r"\sigma_x", "rad", "Sensor noise", scale="log")
    """Standard deviation of the measured angles; of the velocities it is 10/s times this."""
    noise_torque: float = WORLD.knob(0.0, 0.0, 1.0, r"\sigma_u", "u₀", "Torque noise", scale="log")
    """Standard deviation of what the motors add to the control, the same in both runs."""
    push: float = WORLD.knob(0.5, -5.0, 5.0, "p_{push}", "N·s", "Push", step=0.05)
    """Impulse a push gives the tip of both robots, along y."""

    @property
    def options(self) -> DdpOptions:
        return DdpOptions(
            second_order=self.method == "ddp",
            c1=self.c1,
            c2=max(self.c1, self.c2),
            mu=self.mu,
            mu_factor=self.mu_factor,
            tolerance=TOLERANCE,
            iterations=round(self.iterations),
        )
