"""The same discretised problems as `labs.algorithms.collocation` and `multiple_shooting` solve, by
Ipopt with its own dynamics and its own transcription of the rules, in CasADi."""

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from labs.models.mechanisms import Mechanism
from labs.problems.continuous_control import ContinuousProblem
from labs.tasks.motion.continuous_cost import ContinuousMotionCost
from labs.tasks.motion.tip_constraints import ObstacleConstraint, TipTargetConstraint
from tests.labs.algorithms.ipopt_oracle import BARRIER, inverse_dynamics, tip_position


@dataclass(frozen=True)
class IpoptResult:
    """What Ipopt found, and what that took."""

    cost: float
    X: np.ndarray
    U: np.ndarray
    T: float
    iterations: int
    seconds: float
    success: bool


def forward_dynamics(m: Mechanism) -> ca.Function:
    """(x, u) to x', M(q) v' = S u - b v - h(q, v) solved symbolically."""
    n, tau = m.nq, inverse_dynamics(m.model)
    x, u = ca.SX.sym("x", 2 * n), ca.SX.sym("u", m.nu)
    q, v, zero = x[:n], x[n:], ca.DM.zeros(n)
    h = tau(q, v, zero)
    M = ca.horzcat(*(tau(q, v, ca.DM(e)) - h for e in np.eye(n)))
    a = ca.solve(M, ca.mtimes(ca.DM(m.S), u) - m.friction * v - h)
    return ca.Function("f", [x, u], [ca.vertcat(v, a)])


def ipopt(
    problem: ContinuousProblem,
    N: int,
    scheme: str,
    X: np.ndarray,
    U: np.ndarray,
    warm: bool = False,
) -> IpoptResult:
    """From the first guess X (N + 1, nx), U (N or more, nu): well within the bounds, or if `warm`
    right there, with a small barrier."""
    m, cost = problem.dynamics, problem.cost
    assert isinstance(m, Mechanism)
    assert isinstance(cost, ContinuousMotionCost)
    n, f = m.nq, forward_dynamics(m)
    w: list[Any] = []
    c: list[Any] = []
    lower: list[np.ndarray] = []
    upper: list[np.ndarray] = []
    start: list[np.ndarray] = []

    def variable(size: int, low: Any, high: Any, guess: Any) -> Any:
        w.append(ca.MX.sym("w", size))
        for into, what in ((lower, low), (upper, high), (start, guess)):
            into.append(np.broadcast_to(np.asarray(what, float), (size,)))
        return w[-1]

    def state(guess: np.ndarray, fixed: np.ndarray | None = None) -> Any:
        low, high = problem.x_lower.copy(), problem.x_upper.copy()
        if fixed is not None:
            free = np.isnan(fixed)
            low, high = np.where(free, low, fixed), np.where(free, high, fixed)
        return variable(2 * n, low, high, guess)

    def control(guess: np.ndarray) -> Any:
        return variable(m.nu, problem.u_lower, problem.u_upper, guess)

    def running(x: Any, u: Any) -> Any:
        dx, du = x - cost.x_ref, u - cost.u_ref
        return cost.w_T + dx.T @ ca.DM(cost.Q) @ dx + du.T @ ca.DM(cost.R) @ du

    T: Any = problem.T
    if problem.T_limits:
        T = variable(1, *problem.T_limits, problem.T)
    h, J = T / N, 0.0
    stride = max(1, len(U) // N)
    s = state(X[0], problem.x0)
    nodes = [s]
    y = control(U[0])
    controls = [y]
    for i in range(N):
        end = problem.x_final if i == N - 1 else None
        after = state(X[i + 1], end)
        follows = U[min((i + 1) * stride, len(U) - 1)]
        if scheme == "midpoint":
            middle = 0.5 * (s + after)
            c.append(after - s - h * f(middle, y))
            J += h * running(middle, y)
            y_after = control(follows) if i < N - 1 else None
        elif scheme == "rk4":  # shooting's: the control is held, cost and state integrated alike
            k_1 = f(s, y)
            k_2 = f(s + 0.5 * h * k_1, y)
            k_3 = f(s + 0.5 * h * k_2, y)
            k_4 = f(s + h * k_3, y)
            c.append(after - s - h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4))
            between = running(s + 0.5 * h * k_1, y) + running(s + 0.5 * h * k_2, y)
            J += h / 6 * (running(s, y) + 2 * between + running(s + h * k_3, y))
            y_after = control(follows) if i < N - 1 else None
        elif scheme == "trapezoidal":
            y_after = control(follows)
            c.append(after - s - 0.5 * h * (f(s, y) + f(after, y_after)))
            J += 0.5 * h * (running(s, y) + running(after, y_after))
        else:
            x_m = state(0.5 * (X[i] + X[i + 1]))
            u_m, y_after = control(U[min(i * stride + 1, len(U) - 1)]), control(follows)
            f_0, f_m, f_1 = f(s, y), f(x_m, u_m), f(after, y_after)
            c.append(x_m - 0.5 * (s + after) - h / 8 * (f_0 - f_1))
            c.append(after - s - h / 6 * (f_0 + 4 * f_m + f_1))
            J += h / 6 * (running(s, y) + 4 * running(x_m, u_m) + running(after, y_after))
        s = after
        nodes.append(s)
        if y_after is not None:
            y = y_after
            controls.append(y)
    dx = s - cost.x_ref
    J += dx.T @ ca.DM(cost.Q_f) @ dx - ca.DM(cost.c).T @ s
    tip = tip_position(m)
    if cost.tip_cost:
        off = tip(s[:n]) - cost.tip_cost.target
        J += cost.tip_cost.rho * ca.dot(off, off)
    if problem.end:
        assert isinstance(problem.end, TipTargetConstraint)
        c.append(tip(s[:n]) - problem.end.target)
    g = []
    if problem.path:
        assert isinstance(problem.path, ObstacleConstraint)
        for x in nodes:
            for ball in problem.path.balls:
                off = tip(x[:n]) - ball.center
                g.append((ball.radius**2 - ca.dot(off, off)) / (2 * ball.radius))
    equal = sum(part.shape[0] for part in c)
    nlp = {"x": ca.vertcat(*w), "f": J, "g": ca.vertcat(*c, *g)}
    quiet: Any = {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 1000}
    if warm:
        pushes = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac")
        quiet |= {"warm_start_init_point": "yes", "mu_init": BARRIER}
        quiet |= {f"warm_start_{name}": BARRIER for name in pushes}
    solver = ca.nlpsol("ipopt", "ipopt", nlp, {"print_time": False, "ipopt": quiet})
    begun = perf_counter()
    found = solver(
        x0=np.concatenate(start),
        lbx=np.concatenate(lower),
        ubx=np.concatenate(upper),
        lbg=np.r_[np.zeros(equal), np.full(len(g), -np.inf)],
        ubg=np.zeros(equal + len(g)),
    )
    seconds = perf_counter() - begun
    stats = solver.stats()
    read = ca.Function("read", [nlp["x"]], [ca.horzcat(*nodes), ca.horzcat(*controls), ca.MX(T)])
    states, used, time = (np.asarray(part) for part in read(found["x"]))
    return IpoptResult(
        float(found["f"]),
        states.T,
        used.T,
        float(time.item()),
        int(stats["iter_count"]),
        seconds,
        bool(stats["success"]),
    )
