"""What an iteration of DDP costs, as a multiple of the calls it cannot do without."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pinocchio as pin

from labs.algorithms import ddp
from labs.algorithms.ddp import DdpIterate, DdpOptions
from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import Mechanism, mechanism
from labs.models.plant import Plant
from labs.problems.optimal_control import OptimalControlProblem
from labs.tasks.motion.cost import MotionCost, TipCost
from tests.benchmarks.timing import ROUNDS, bare_calls, least_seconds

PHASES = ("derivatives", "backward", "forward")


def reach(m: Mechanism, N: int, h: float = 0.01) -> tuple[OptimalControlProblem, np.ndarray]:
    """An arm's tip to a point in N steps, and a first guess: gravity compensation."""
    n = m.nq
    q = np.resize(m.arm.home, n)
    holding, nothing = m.equilibrium_control(q), np.zeros(2 * n)
    weights = [np.diag([x] * n + [y] * n) for x, y in ((0.0, 0.01 * h), (0.0, 10.0))]
    goal = TipCost(m, m.tip(q) + np.array([-0.1, 0.3, 0.1]), 1000.0)
    cost = MotionCost(N, weights[0], 1e-4 * h * np.eye(n), weights[1], nothing, holding, goal)
    return OptimalControlProblem(DiscreteMechanism(m, h), cost, np.r_[q, np.zeros(n)], N), np.tile(
        holding, (N, 1)
    )


def chain(joints: int) -> Mechanism:
    """A snake of equal rods on hinges in turn about x, y and z, each with a gear's inertia."""
    model = pin.Model()
    kinds = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)
    parent, place = 0, pin.SE3.Identity()
    for i in range(joints):
        parent = model.addJoint(parent, kinds[i % 3](), place, f"hinge{i}")
        shape = pin.Inertia.FromCylinder(1.0, 0.03, 0.2)
        model.appendBodyToJoint(parent, shape, pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1])))
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.2]))
    model.armature = np.full(joints, 0.1)
    tip = model.addFrame(pin.Frame("tip", parent, place, pin.FrameType.OP_FRAME))
    arm = mechanism("ur5").arm
    like = type(arm)("chain", "Chain", model, np.full(joints, 0.3), np.full(joints, 50.0), tip,
                     arm.visuals, arm.collisions, arm.camera)  # fmt: skip
    return Mechanism("chain", Plant(like, model, model.createData()), tuple(range(joints)), 0.0)


def iteration(problem: OptimalControlProblem, U: np.ndarray) -> tuple[dict[str, float], DdpIterate]:
    """Seconds of each phase, the least of many times the same first iteration, a full step."""
    options = DdpOptions()
    at = ddp.init(problem, U, options)
    found = [ddp.step(problem, options, at) for _ in range(ROUNDS)]
    assert found[0].alpha == 1.0
    return {phase: min(f.seconds[phase] for f in found) for phase in PHASES}, found[0]


def iteration_ratio() -> None:
    """UR5, N = 100, Gauss-Newton: at most 4 times its bare calls."""
    m = mechanism("ur5")
    calls = bare_calls(m, 100)
    phases, _ = iteration(*reach(m, 100))
    total = sum(phases.values())
    print(f"100 aba + 100 computeABADerivatives   {calls * 1e3:7.2f} ms    1.00")
    for phase, spent in phases.items():
        print(f"{phase:37} {spent * 1e3:7.2f} ms {spent / calls:7.2f}")
    print(f"one iteration                         {total * 1e3:7.2f} ms {total / calls:7.2f}")
    options = DdpOptions()
    problem, U = reach(m, 100)
    solved = ddp.solve(problem, U, options)
    whole = least_seconds(lambda: ddp.solve(problem, U, options))
    print(f"a reach solved: {solved.iteration} iterations, {whole * 1e3:.1f} ms")


def growth() -> None:
    """An iteration against the horizon and against the number of joints."""
    print("    N      ms   us a step   of the bare calls     (UR5)")
    for N in (50, 100, 200, 400, 800, 1600):
        phases, _ = iteration(*reach(mechanism("ur5"), N, h=1.0 / N))
        total = sum(phases.values())
        ratio = total / bare_calls(mechanism("ur5"), N)
        print(f"{N:5} {total * 1e3:7.2f} {total / N * 1e6:11.1f} {ratio:19.2f}")
    print("joints      ms   derivatives   backward   forward   (N = 100, chain of rods)")
    for joints in range(1, 13):
        phases, _ = iteration(*reach(chain(joints), 100))
        spent = [phases[phase] * 1e3 for phase in PHASES]
        print(f"{joints:6} {sum(spent):7.2f} {spent[0]:13.2f} {spent[1]:10.2f} {spent[2]:9.2f}")
