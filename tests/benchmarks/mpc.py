"""What nonlinear model predictive control costs: a UR5's period against the calls it cannot do
without, a hundred a second with a viewer, and the same problem in do-mpc."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import contextlib
import warnings
from dataclasses import replace
from importlib import import_module
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
import pinocchio as pin

from labs.algorithms.nonlinear_mpc import NonlinearMpc
from labs.algorithms.nonlinear_mpc_problem import NonlinearMpcProblem
from labs.algorithms.sensitivities import Sensitivities
from labs.algorithms.stage_qp import StageQp
from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import mechanism
from labs.problems.receding_horizon import Plan
from labs.resumable import run_to_completion
from tests.benchmarks.mpc_linear import over_the_horizon
from tests.benchmarks.mpc_sets import wall_to_sets
from tests.server_process import ServerProcess
from tests.viser_client import SceneClient

N, PERIOD, PERIODS = 30, 0.01, 80
UR5 = mechanism("ur5")
TORQUE_LIMIT = UR5.control_limit
TURN = np.array([0.8, -0.5, 0.4, 0.3, 0.2, 0.5])
LIVE = 10.0
"""[s] of the live run."""


class DoubleIntegrators:
    """Six joints whose controls are their accelerations, in units of the UR5's strength."""

    nx, nu, h = 12, 6, PERIOD

    def __init__(self) -> None:
        self.A = np.eye(12) + self.h * np.eye(12, k=6)
        self.B = np.vstack([np.zeros((6, 6)), self.h * np.diag(20.0 / TORQUE_LIMIT)])

    def step(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.asarray(self.A @ x + self.B @ u)

    def linearize(self, X: np.ndarray, U: np.ndarray) -> Sensitivities:
        many = len(U)
        Y = X[:many] @ self.A.T + U @ self.B.T
        return Y, np.tile(self.A, (many, 1, 1)), np.tile(self.B, (many, 1, 1))


def reach(dynamics: Any, hold: np.ndarray) -> NonlinearMpcProblem:
    """Joints turn by TURN, at their limits of position, velocity and control on the way."""
    home, turn = UR5.arm.home, np.array([0.6, *np.full(5, 3.0)])
    return NonlinearMpcProblem(
        dynamics,
        N,
        Q=PERIOD * np.diag(np.repeat([10.0, 0.1], 6)),
        R=PERIOD * np.diag(0.1 / TORQUE_LIMIT**2),
        Q_f=np.diag(np.repeat([30.0, 0.3], 6)),
        x_ref=np.concatenate([home + TURN, np.zeros(6)]),
        u_ref=hold,
        x_lower=np.concatenate([home - turn, np.full(6, -1.0)]),
        x_upper=np.concatenate([home + turn, np.full(6, 1.0)]),
        u_lower=-0.5 * TORQUE_LIMIT,
        u_upper=0.5 * TORQUE_LIMIT,
    )


def shift_guess(plan: Plan) -> Plan:
    """The guess of the next period."""
    X, U = np.vstack([plan.X[1:], plan.X[-1:]]), np.vstack([plan.U[1:], plan.U[-1:]])
    return replace(plan, X=X, U=U)


def drive_motion(
    problem: NonlinearMpcProblem, iterations: int | None
) -> tuple[list[float], list[Plan]]:
    """[s] of every period of a motion, and its plans."""
    planner, x, guess = NonlinearMpc(problem, iterations), np.zeros(12), None
    x[:6] = UR5.arm.home
    times, plans = [], []
    for _ in range(PERIODS):
        begun = perf_counter()
        plan = run_to_completion(planner.plan(x, guess))
        times.append(perf_counter() - begun)
        plans.append(plan)
        x, guess = problem.dynamics.step(x, plan.U[0]), shift_guess(plan)
    return times, plans


def bare_seconds(problem: NonlinearMpcProblem, plans: list[Plan]) -> tuple[float, float]:
    """[s] medians of the derivative calls, and of the solver's update and solve, along a motion."""
    qp, planner = StageQp(problem, N), NonlinearMpc(problem)
    model, data, calls, solves = UR5.model, UR5.data, [], []
    for plan in plans[:-1]:
        at = shift_guess(plan)
        points = [(x[:6].copy(), x[6:].copy(), u) for x, u in zip(at.X, at.U, strict=False)]
        begun = perf_counter()
        for q, v, u in points:
            pin.computeABADerivatives(model, data, q, v, u)
        calls.append(perf_counter() - begun)
        qp.write(planner.linearize(at.X, at.U))
        begun = perf_counter()
        qp.call_solver()
        solves.append(perf_counter() - begun)
    return median(calls), median(solves)


def on_the_ur5() -> None:
    """UR5, joint space, N = 30, limits active, 10 ms: at most 1.6 times its bare parts."""
    problem = reach(DiscreteMechanism(UR5, PERIOD), UR5.equilibrium_control(UR5.arm.home + TURN))
    drive_motion(problem, 1)
    times, plans = drive_motion(problem, 1)
    calls, solves = bare_seconds(problem, plans)
    active = [sum(int(rows.sum()) for rows in plan.active.values()) for plan in plans]
    phases = {name: median(plan.seconds[name] for plan in plans) for name in plans[0].seconds}
    step = median(times)
    print(f"{N} computeABADerivatives               {calls * 1e3:7.2f} ms")
    print(f"update and solve of the QP             {solves * 1e3:7.2f} ms")
    print(f"a period                               {step * 1e3:7.2f} ms", end="")
    print(f"   {step / (calls + solves):.2f} of these (at most 1.6)")
    for name, spent in phases.items():
        print(f"    {name:34} {spent * 1e3:7.2f} ms")
    print(f"    {100 * step / PERIOD:.0f} % of the period; up to {max(active)} limits active")


def live_session() -> None:
    """The lab's UR5 with a viewer, its target going round: time held, deadlines missed."""
    with (
        ServerProcess() as server,
        server.session("mpc") as session,
        SceneClient(session) as scene,
        session.stream() as stream,
    ):
        begun, turns, note, samples = perf_counter(), 0, "", []
        while (now := perf_counter() - begun) < LIVE:
            if now > 0.1 * turns:
                y, z = 0.1 * np.sin(0.15 * turns), 0.1 * np.cos(0.15 * turns)
                session.set(target_y=y - 0.3, target_z=z + 0.35)
                turns += 1
            sample = stream.next("telemetry")
            if sample["rows"]:
                samples.append((sample["rows"][-1][0], perf_counter()))
            note = (sample["fields"] or {}).get("said", note)
            with contextlib.suppress(TimeoutError):
                scene.socket.recv(0.0)
    (t0, wall0), (t1, wall1) = samples[0], samples[-1]
    print(
        f"live with a viewer, {turns} targets in {LIVE:.0f} s: {(t1 - t0) / PERIOD:.0f} periods, "
    )
    print(f"simulated time {(t1 - t0) / (wall1 - wall0):.3f} of the wall clock's")
    print("\n".join(note.splitlines()[1:]))


def beside_do_mpc() -> None:
    """Six double integrators, the UR5's number of states and limits: do-mpc through CasADi and
    Ipopt, both to their defaults, and ours iterated to convergence."""
    try:
        warnings.simplefilter("ignore")
        do_mpc: Any = import_module("do_mpc")
    except ImportError:
        print("do-mpc is not installed: pip install 'orclab[peers]'")
        return
    problem = reach(DoubleIntegrators(), np.zeros(6))
    peer, costs = _do_mpc(do_mpc, problem)
    print("six double integrators, N = 30               median       max    cost of the motion")
    print(f"{'do-mpc':38} {_spread(peer)} {costs:9.4f}")
    for title, iterations in (("a real-time iteration", 1), ("ours, to convergence", None)):
        drive_motion(problem, iterations)
        times, plans = drive_motion(problem, iterations)
        X, U = np.array([plan.X[0] for plan in plans]), np.array([plan.U[0] for plan in plans])
        cost = problem.cost(X, U[:-1])
        print(
            f"{title:38} {_spread(times)} {cost:9.4f}"
            f"   {median(peer) / median(times):.1f} times as fast"
        )
    times, _ = drive_motion(
        reach(DiscreteMechanism(UR5, PERIOD), UR5.equilibrium_control(UR5.arm.home + TURN)), 1
    )
    print(f"{'(a real-time iteration of the UR5)':38} {_spread(times)}")


def _spread(times: list[float]) -> str:
    """Median and maximum."""
    return f"{median(times) * 1e3:9.2f} {max(times) * 1e3:9.2f} ms"


def _do_mpc(do_mpc: Any, problem: NonlinearMpcProblem) -> tuple[list[float], float]:
    """[s] of every period of the same motion, and its cost."""
    dynamics = problem.dynamics
    assert isinstance(dynamics, DoubleIntegrators)
    model = do_mpc.model.Model("discrete")
    x, u = model.set_variable("_x", "x", (12, 1)), model.set_variable("_u", "u", (6, 1))
    model.set_rhs("x", dynamics.A @ x + dynamics.B @ u)
    model.setup()
    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step = N, PERIOD
    mpc.settings.store_full_solution = False
    mpc.settings.supress_ipopt_output()
    dx, du = x - problem.x_ref, u - problem.u_ref
    mpc.set_objective(
        lterm=0.5 * (dx.T @ problem.Q @ dx + du.T @ problem.R @ du),
        mterm=0.5 * dx.T @ problem.Q_f @ dx,
    )
    for kind, name in (("_x", "x"), ("_u", "u")):
        for side in ("lower", "upper"):
            mpc.bounds[side, kind, name] = getattr(problem, f"{name}_{side}")
    mpc.setup()
    at, times, X, U = np.concatenate([UR5.arm.home, np.zeros(6)]), [], [], []
    mpc.x0 = at
    mpc.set_initial_guess()
    for _ in range(PERIODS):
        begun = perf_counter()
        control = mpc.make_step(at[:, None])[:, 0]
        times.append(perf_counter() - begun)
        X.append(at)
        U.append(control)
        at = dynamics.step(at, control)
    return times, problem.cost(np.array(X), np.array(U)[:-1])


def mpc_benchmarks() -> None:
    """All of them, linear MPC over its horizon, and the sets of the plane."""
    for measure in (on_the_ur5, live_session, beside_do_mpc, over_the_horizon, wall_to_sets):
        measure()
        print()
