"""The same discretised optimal control problems as `labs.algorithms.ddp` solves, solved by Ipopt
with its own dynamics: a Newton-Euler recursion in CasADi, states and accelerations as variables.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import Mechanism
from labs.problems.optimal_control import OptimalControlProblem
from labs.tasks.motion.cost import MotionCost

BARRIER = 1e-8
"""Of a warm start: its weight, and how far from a bound it begins."""
STAGES = {"explicit-euler": 1, "semi-implicit-euler": 1, "rk4": 4}


def rotation(axis: np.ndarray, angle: ca.SX) -> ca.SX:
    """About a unit axis, by Rodrigues' formula."""
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return ca.SX(np.eye(3)) + ca.sin(angle) * ca.SX(K) + (1 - ca.cos(angle)) * ca.SX(K @ K)


def joints(model: pin.Model, q: ca.SX) -> list[tuple[int, np.ndarray, ca.SX, ca.SX]]:
    """Of each: its parent, motion subspace (6,), and placement in the parent: p and R."""
    found = []
    for i in range(1, model.njoints):
        data = model.joints[i].createData()
        model.joints[i].calc(data, np.zeros(model.nq)[:1] if model.nq == 1 else np.zeros(model.nq))
        S = np.asarray(data.S).ravel()
        at, angle = model.jointPlacements[i], q[model.joints[i].idx_q]
        slide, axis = S[:3], S[3:]
        R = ca.SX(at.rotation) @ (rotation(axis, angle) if axis.any() else ca.SX(np.eye(3)))
        p = ca.SX(at.translation) + ca.SX(at.rotation @ slide) * angle
        found.append((model.parents[i], S, p, R))
    return found


def inverse_dynamics(model: pin.Model) -> ca.Function:
    """(q, v, a) to tau, by the recursive Newton-Euler algorithm."""
    n = model.nq
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    zero = ca.SX.zeros(3)
    w, alpha, acc = [zero], [zero], [ca.SX(-model.gravity.linear)]
    chain = joints(model, q)
    for i, (parent, S, p, R) in enumerate(chain):
        slide, axis = ca.SX(S[:3]), ca.SX(S[3:])
        spin = R.T @ w[parent] + axis * v[i]
        w_p, alpha_p = w[parent], alpha[parent]
        at_p = acc[parent] + ca.cross(alpha_p, p) + ca.cross(w_p, ca.cross(w_p, p))
        acc.append(R.T @ at_p + slide * a[i] + 2 * ca.cross(spin, slide * v[i]))
        alpha.append(R.T @ alpha_p + axis * a[i] + ca.cross(spin, axis * v[i]))
        w.append(spin)
    force = [ca.SX.zeros(3) for _ in range(n + 1)]
    moment = [ca.SX.zeros(3) for _ in range(n + 1)]
    tau = ca.SX.zeros(n)
    for i in range(n, 0, -1):
        body, (parent, S, p, R) = model.inertias[i], chain[i - 1]
        c, inertia = ca.SX(body.lever), ca.SX(body.inertia)
        centre = acc[i] + ca.cross(alpha[i], c) + ca.cross(w[i], ca.cross(w[i], c))
        f = force[i] + body.mass * centre
        m = moment[i] + inertia @ alpha[i] + ca.cross(w[i], inertia @ w[i])
        m += ca.cross(c, body.mass * centre)
        tau[i - 1] = ca.dot(ca.SX(S[:3]), f) + ca.dot(ca.SX(S[3:]), m)
        tau[i - 1] += float(model.armature[i - 1]) * a[i - 1]
        force[parent] += R @ f
        moment[parent] += R @ m + ca.cross(p, R @ f)
    return ca.Function("tau", [q, v, a], [tau])


def tip_position(m: Mechanism) -> ca.Function:
    """q to p (3,)."""
    q = ca.SX.sym("q", m.nq)
    placed = [(ca.SX.zeros(3), ca.SX(np.eye(3)))]
    for parent, _, p, R in joints(m.model, q):
        p_0, R_0 = placed[parent]
        placed.append((p_0 + R_0 @ p, R_0 @ R))
    frame = m.model.frames[m.arm.tip]
    p, R = placed[frame.parentJoint]
    return ca.Function("tip", [q], [p + R @ ca.SX(frame.placement.translation)])


@dataclass(frozen=True)
class Optimum:
    """What Ipopt found."""

    cost: float
    X: np.ndarray
    U: np.ndarray


def optimum(
    problem: OptimalControlProblem, X: np.ndarray, U: np.ndarray, warm: bool = False
) -> Optimum:
    """Of the local minimum near X (N + 1, nx), U (N, nu), where Ipopt starts: well within the
    bounds, or if `warm`, right there, with a small barrier."""
    plant, cost, N = problem.dynamics, problem.cost, problem.N
    assert isinstance(plant, DiscreteMechanism)
    assert isinstance(cost, MotionCost)
    m, h, n = plant.mechanism, plant.h, plant.mechanism.nq
    tau, many = inverse_dynamics(m.model), STAGES[plant.method]
    opti = ca.Opti()
    x, u = opti.variable(2 * n, N + 1), opti.variable(m.nu, N)
    a = opti.variable(n, N * many)
    opti.subject_to(x[:, 0] == problem.x0)
    opti.set_initial(x, X.T)
    opti.set_initial(u, U.T)
    if problem.bound is not None:
        for k in range(m.nu):
            opti.subject_to(opti.bounded(-problem.bound[k], u[k, :], problem.bound[k]))
    J: Any = 0.0
    for t in range(N):
        q, v = x[:n, t], x[n:, t]
        stages: list[Any] = []
        for k in range(many):
            shift = (0.0, 0.5, 0.5, 1.0)[k] * h
            q_k = q + shift * stages[-1][0] if k else q
            v_k = v + shift * stages[-1][1] if k else v
            a_k = a[:, t * many + k]
            opti.subject_to(tau(q_k, v_k, a_k) + m.friction * v_k == ca.mtimes(ca.DM(m.S), u[:, t]))
            stages.append((v_k, a_k))
            guess = m.f(X[t], U[t])[n:]
            opti.set_initial(a_k, guess)
        if many == 4:
            mean_v, mean_a = (
                (s[0] + 2 * s[1] + 2 * s[2] + s[3]) / 6 for s in zip(*stages, strict=True)
            )
            opti.subject_to(x[:n, t + 1] == q + h * mean_v)
            opti.subject_to(x[n:, t + 1] == v + h * mean_a)
        else:
            after = v + h * stages[0][1]
            semi = plant.method == "semi-implicit-euler"
            opti.subject_to(x[n:, t + 1] == after)
            opti.subject_to(x[:n, t + 1] == q + h * (after if semi else v))
        dx, du = x[:, t] - cost.x_ref, u[:, t] - cost.u_ref
        J += dx.T @ cost.Q @ dx + du.T @ cost.R @ du
    dx = x[:, N] - cost.x_ref
    J += dx.T @ cost.Q_f @ dx
    if cost.tip_cost:
        off = tip_position(m)(x[:n, N]) - cost.tip_cost.target
        J += cost.tip_cost.rho * ca.dot(off, off)
    opti.minimize(J)
    quiet: Any = {"print_level": 0, "sb": "yes", "tol": 1e-10, "max_iter": 500}
    if warm:
        pushes = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac")
        quiet |= {"warm_start_init_point": "yes", "mu_init": BARRIER}
        quiet |= {f"warm_start_{name}": BARRIER for name in pushes}
    opti.solver("ipopt", {"print_time": False}, quiet)
    found = opti.solve()
    states, controls = np.asarray(found.value(x)), np.asarray(found.value(u))
    return Optimum(float(found.value(J)), states.T, controls.reshape(m.nu, N).T)
