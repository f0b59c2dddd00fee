"""The tunables of the cart, of what disturbs it, and of the three controllers."""

import numpy as np

from labs.params import Group, Params

RUN = Group("Runs", effect="solve")
NOISE = Group("Disturbance", effect="solve")
CHANCE_CONSTRAINTS = Group("Chance constraints", effect="solve")
TASK = Group("Task and limits", effect="solve")
MPC = Group("Controllers", effect="solve")
VIEW = Group("View")

DISTURBANCE_KINDS = {
    "uniform": "Uniform in W",
    "corners": "Corners of W, at random",
    "gaussian": "Gaussian",
    "worst": "The worst of W",
}
SHOWN = {
    "all": "All three",
    "nominal": "Nominal MPC",
    "stochastic": "Stochastic MPC",
    "robust": "Robust MPC",
}


class UncertaintyParams(Params):
    """What the user can turn."""

    kind: str = NOISE.choice("uniform", DISTURBANCE_KINDS, "Disturbance", key=True)
    """What is added to the state at each step, the same for all three controllers. The worst
    knows each run's gain K and pushes so that, without other control, it hits the wall hardest."""
    w_p: float = NOISE.knob(0.03, 0.002, 0.1, r"\bar w_p", "m", "Of the position", step=0.002)
    """W: the position's disturbance is at most this in each step."""
    w_v: float = NOISE.knob(
        0.1, 0.01, 0.3, r"\bar w_v", "m/s", "Of the velocity", step=0.01, key=True
    )
    """W: likewise the velocity's."""
    width: float = NOISE.knob(
        3.0, 1.0, 4.0, r"\bar w/\sigma", "", "W in deviations", step=0.1,
        key=True, when={"kind": "gaussian"},
    )  # fmt: skip
    """The standard deviation of a Gaussian disturbance is W's half width over this: robust MPC
    believes that nothing beyond so many deviations ever happens."""
    probability: float = CHANCE_CONSTRAINTS.knob(
        90.0, 50.0, 99.9, "p", "%", "Probability", step=0.1, key=True
    )
    """With which stochastic MPC must keep each limit at each step."""
    source: str = CHANCE_CONSTRAINTS.choice(
        "predicted",
        {"predicted": "The predicted state", "measured": "The measured state"},
        "Plan from",
        key=True,
    )
    """Where stochastic MPC plans from: where its nominal state came to, with K against the noise
    and margins of the stationary error; or each measured state anew, with margins that grow."""
    wall: float = TASK.knob(0.9, 0.2, 1.2, r"p_{max}", "m", "Wall", step=0.01, key=True)
    """Most that the position may be."""
    target: float = TASK.knob(0.9, -1.0, 1.5, "p^*", "m", "Target", step=0.01)
    """Where the cart should stand; behind the wall it presses on."""
    p_0: float = TASK.knob(-1.2, -1.3, 1.2, "p_0", "m", "Start", step=0.01)
    """Position at the start, or drag the ball in the plane."""
    v_0: float = TASK.knob(0.0, -1.0, 1.0, "v_0", "m/s", "Start, velocity", step=0.01)
    """Velocity at the start."""
    v_max: float = TASK.knob(1.0, 0.2, 1.2, r"v_{max}", "m/s", "Velocity limit", step=0.02)
    """Most that the speed may be."""
    u_max: float = TASK.knob(2.0, 0.2, 4.0, r"u_{max}", "N", "Force limit", step=0.05)
    """Most that the force may be."""
    N: float = MPC.knob(15.0, 3.0, 30.0, "N", "", "Horizon", step=1.0, key=True)
    """Steps of 0.2 s; at its end every plan is at rest."""
    q_p: float = MPC.knob(10.0, 0.1, 1000.0, "q_p", "1/m²", "Position", scale="log")
    """Weight of the distance from the target."""
    q_v: float = MPC.knob(1.0, 0.01, 100.0, "q_v", "s²/m²", "Velocity", scale="log")
    """Weight of the velocity."""
    r: float = MPC.knob(1.0, 0.01, 100.0, "r", "1/N²", "Force", scale="log")
    """Weight of the force."""
    r_K: float = MPC.knob(0.3, 0.003, 10.0, "r_K", "1/N²", "Force, of K", scale="log", key=True)
    """The ancillary gain K is the LQR's for this weight of the force, with 10 and 1 for errors of
    position and velocity: a small one makes K stiff, the tube narrow, and leaves the plan less of
    the force."""
    count: float = RUN.knob(100.0, 20.0, 400.0, r"n_{runs}", "", "Runs", step=10.0)
    """Of each controller, with the same disturbances."""
    seed: float = RUN.knob(0.0, 0.0, 99.0, "s", "", "Seed", step=1.0)
    """Of the disturbances."""
    shown: str = VIEW.choice("all", SHOWN, "Show", key=True)
    """Whose runs the plane shows."""
    zoom: bool = VIEW.toggle(False, "Zoom in on the wall", key=True)
    """Whether the plane shows the states near the wall alone."""

    @property
    def w_max(self) -> np.ndarray:
        """(2,) half widths of W."""
        return np.array([self.w_p, self.w_v])

    @property
    def deviation(self) -> np.ndarray:
        """(2,) standard deviations of the disturbance, as stochastic MPC knows them."""
        shares = {"uniform": 3.0**-0.5, "gaussian": 1.0 / self.width}
        return np.asarray(shares.get(self.kind, 1.0) * self.w_max)

    @property
    def start(self) -> np.ndarray:
        """(2,)"""
        return np.array([self.p_0, self.v_0])
