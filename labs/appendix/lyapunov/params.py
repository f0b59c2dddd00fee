"""The tunables of the closed loop, of the candidate V and of the set that is asked about."""

from functools import cache

import numpy as np

from labs.appendix.lyapunov.candidates import CANDIDATES, Candidate, Ellipse, candidate
from labs.appendix.lyapunov.closed_loop import (
    LOOPS,
    STATE_WINDOWS,
    ClosedLoop,
    ClosedLoopSettings,
    closed_loop,
    loop_system,
)
from labs.params import Group, Params
from labs.problems.polyhedron import Polyhedron, box
from labs.tasks.phase_plane.picture import PhasePlane

PERIODS = {0.05: "50 ms", 0.1: "100 ms", 0.2: "200 ms"}
TERMINAL = {"none": "None", "riccati": "Riccati's P"}

SYSTEM = Group("System", effect="solve")
WEIGHTS = Group("Weights", effect="solve", when=(
    {"system": ["lqr", "mpc"]}, {"candidate": ["riccati", "lyapunov", "value"]},
))  # fmt: skip
CANDIDATE = Group("Candidate V", effect="solve")
SET = Group("Set", effect="solve")
VIEW = Group("View")
DRAWN, BOX = {"candidate": "drawn"}, {"set": "box"}


class LyapunovParams(Params):
    """What the user can turn."""

    system: str = SYSTEM.choice("pd", LOOPS, "System", effect="restart", key=True)
    """What moves, and by which law."""
    period: float = SYSTEM.choice(0.1, PERIODS, "Time step", "T", "s")
    """From k to k + 1: the law looks once in a step and holds its control."""
    kp: float = SYSTEM.knob(1.0, 0.0, 20.0, "k_p", "N·m/rad", key=True, when={"system": "pd"})
    """Torque against a deviation."""
    kd: float = SYSTEM.knob(0.4, 0.0, 3.0, "k_d", "N·m·s/rad", key=True, when={"system": "pd"})
    """Torque against a velocity."""
    u_max: float = SYSTEM.knob(
        2.0,
        0.1,
        20.0,
        "u_{max}",
        "N·m",
        "Strongest control",
        scale="log",
        key=True,
        when={"system": ["lqr", "mpc"]},
        units={"system": {"mpc": "N"}},
    )
    """LQR's control is cut to it; MPC plans within it."""
    N: float = SYSTEM.knob(
        10.0, 1.0, 40.0, "N", "", "Horizon", step=1.0, key=True, when={"system": "mpc"}
    )
    """Steps that MPC plans ahead."""
    terminal: str = SYSTEM.choice("riccati", TERMINAL, "Terminal cost", when={"system": "mpc"})
    """Half of x'Px at the end of MPC's plan, or nothing."""
    q_1: float = WEIGHTS.knob(1.0, 0.0, 1000.0, "q_1", "1/rad²", "Position", scale="log",
        units={"system": {"mpc": "1/m²", "vanderpol": "1/m²"}})  # fmt: skip
    """Q = diag(q_1, q_2): of LQR, MPC, and of the equations of Riccati and Lyapunov."""
    q_2: float = WEIGHTS.knob(0.1, 0.001, 1000.0, "q_2", "s²/rad²", "Velocity", scale="log",
        units={"system": {"mpc": "s²/m²", "vanderpol": "s²/m²"}})  # fmt: skip
    """Q's weight of the velocity."""
    r: float = WEIGHTS.knob(0.1, 1e-3, 1e3, "r", "1/(N·m)²", "Control", scale="log",
        units={"system": {"mpc": "1/N²", "vanderpol": "1/N²"}})  # fmt: skip
    """R: of LQR, MPC and Riccati's equation."""
    candidate: str = CANDIDATE.choice("drawn", CANDIDATES, "V", key=True)
    """Is it a Lyapunov function? Of what is not MPC, V*_N is Riccati's."""
    angle: float = CANDIDATE.knob(
        0.0, -90.0, 90.0, r"\varphi", "°", "Ellipse's angle", step=1.0, when=DRAWN
    )
    """Between its first axis and the axis of positions; or drag the end of its axis."""
    axis_1: float = CANDIDATE.knob(
        0.5, 0.05, 1.0, r"\rho_1", "", "First axis", step=0.01, key=True, when=DRAWN
    )
    """Half of it, in parts of the window: V = 1 on the ellipse."""
    axis_2: float = CANDIDATE.knob(
        0.5, 0.05, 1.0, r"\rho_2", "", "Second axis", step=0.01, key=True, when=DRAWN
    )
    """Half of it, in parts of the window."""
    set: str = SET.choice("level", {"level": "Level set of V", "box": "Box"}, "Set", key=True)
    """Sixty states are let loose on its edge, to see if it is positively invariant."""
    share: float = SET.knob(
        0.9, 0.05, 4.0, r"\ell/\ell_{max}", "", "Level", step=0.05, key=True, when={"set": "level"}
    )
    """In parts of the largest level below which V decreases everywhere."""
    box_1: float = SET.knob(0.5, 0.05, 0.95, "b_1", "", "Half its width", step=0.01, when=BOX)
    """In parts of the window; or drag its corner."""
    box_2: float = SET.knob(0.5, 0.05, 0.95, "b_2", "", "Half its height", step=0.01, when=BOX)
    """In parts of the window; or drag its corner."""
    view: str = VIEW.choice(
        "plane", {"plane": "Plane", "surface": "V as a surface"}, "View", key=True
    )
    """V over the plane is a bowl: the runs go down in it."""

    @property
    def loop(self) -> ClosedLoop:
        return closed_loop(
            ClosedLoopSettings(
                self.system, self.period, self.kp, self.kd, self.u_max,
                (self.q_1, self.q_2), self.r, round(self.N), self.terminal == "riccati",
            )
        )  # fmt: skip

    @property
    def V(self) -> Candidate:
        """Raises LabError where there is none, as the Lyapunov equation of an unstable loop."""
        return candidate(self.candidate, self.loop, Ellipse(self.angle, self.axis_1, self.axis_2))

    @property
    def V_axes(self) -> np.ndarray:
        """(2, 2): where the axes of the ellipse end."""
        turn = np.radians(self.angle)
        ways = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        return np.asarray(ways * [[self.axis_1], [self.axis_2]] * self.loop.window)

    @property
    def plane(self) -> PhasePlane:
        return plane_of(self.system, self.view == "surface")

    @property
    def box(self) -> Polyhedron:
        corner = np.array([self.box_1, self.box_2]) * self.loop.window
        return box(-corner, corner)


@cache
def plane_of(system: str, lying: bool) -> PhasePlane:
    """The plane of a loop, with its window."""
    window = np.array(STATE_WINDOWS[system])
    return PhasePlane.of(loop_system(system), -window, window, lying=lying)
