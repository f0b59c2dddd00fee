"""The lab lyapunov: its loops and candidates against others, and what is dragged."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from labs.appendix.lyapunov.candidates import CANDIDATES
from labs.appendix.lyapunov.closed_loop import LOOPS
from labs.appendix.lyapunov.lab import Lyapunov
from labs.appendix.lyapunov.params import LyapunovParams
from labs.appendix.lyapunov.picture import change_colors
from labs.resumable import run_to_completion
from tests.labs.appendix.lyapunov.test_article import state_after, study

RNG = np.random.default_rng(8)


@pytest.mark.parametrize("system", LOOPS)
def test_a_loop_is_what_its_law_makes_of_its_system(system: str) -> None:
    loop = LyapunovParams(system=system, u_max=20.0).loop
    A, B, _ = loop.system.linear(0.1)
    K = np.zeros((1, 2)) if system == "vanderpol" else loop.gain
    np.testing.assert_allclose(loop.A, A + B @ K, atol=1e-6)
    X = 0.1 * RNG.uniform(-1.0, 1.0, (5, 2)) * loop.window
    expected = [loop.system.step(x, K @ x, 0.1) for x in X]
    np.testing.assert_allclose(run_to_completion(loop.next_state(X)), expected, atol=1e-9)


@pytest.mark.parametrize("system", LOOPS)
@pytest.mark.parametrize("name", CANDIDATES)
def test_near_the_origin_v_is_quadratic(system: str, name: str) -> None:
    V = LyapunovParams(system=system, candidate=name).V
    X = 1e-3 * RNG.uniform(-1.0, 1.0, (20, 2))
    values = run_to_completion(V.values(X))
    np.testing.assert_allclose(values, np.einsum("ki,ij,kj->k", X, V.P, X), rtol=1e-4, atol=1e-12)
    assert run_to_completion(V.values(np.zeros((1, 2))))[0] == pytest.approx(0.0, abs=1e-12)


def test_the_cost_of_mpc_is_riccatis_while_no_limit_is_met() -> None:
    params = LyapunovParams(system="mpc", candidate="value", u_max=20.0, q_1=2.0, q_2=0.3, r=0.7)
    A, B, _ = params.loop.system.linear(0.1)
    P = solve_discrete_are(A, B, np.diag([2.0, 0.3]), [[0.7]])
    np.testing.assert_allclose(params.V.P, 0.5 * P, rtol=1e-6)
    found = study({"system": "mpc", "candidate": "value", "u_max": 20.0})
    assert found.decreasing == 1.0
    other = study({"system": "mpc", "candidate": "riccati", "u_max": 20.0})
    np.testing.assert_allclose(found.V, other.V, rtol=1e-6, atol=1e-9)


def test_the_ellipse_is_where_its_handles_are() -> None:
    params = LyapunovParams(angle=30.0, axis_1=0.8, axis_2=0.2)
    values = run_to_completion(params.V.values(params.V_axes))
    np.testing.assert_allclose(values, 1.0)
    lab, plane = Lyapunov(), params.plane
    for i, end in enumerate(params.V_axes, 1):
        x, y, z = plane.place(end)
        assert params.change(lab.edit(params, f"axis {i}", (x, y, z))) == params
    x, y, z = plane.place(-params.V_axes[0])
    assert params.change(lab.edit(params, "axis 1", (x, y, z))) == params, "its other end"
    x, y, z = plane.place(np.array([-0.3, 0.7]) * plane.upper)
    assert lab.edit(params, "corner", (x, y, z)) == {"box_1": 0.3, "box_2": 0.7}


@pytest.mark.parametrize("view", ["plane", "surface"])
def test_states_start_on_the_edge_of_the_set(view: str) -> None:
    params = LyapunovParams(set="box", view=view)
    starts = study(params.model_dump()).starts
    share = np.abs(starts) / (np.array([0.5, 0.5]) * params.loop.window)
    np.testing.assert_allclose(share.max(axis=1), 1.0)
    assert len(np.unique(starts.round(9), axis=0)) == len(starts)


def test_runs_start_again_when_they_are_over() -> None:
    early, late = (state_after(t, {"candidate": "lyapunov"}).runs for t in (1.0, 13.01))
    assert early is not None
    assert late is not None
    assert early.k == late.k
    np.testing.assert_allclose(early.X, late.X)


def test_colours_tell_a_fall_from_a_rise() -> None:
    fall, still, rise, none = change_colors(np.array([-0.5, 0.0, 0.5, np.nan]))
    assert fall[0] < fall[2], "teal"
    assert rise[0] > rise[2], "amber"
    assert still[0] > still[2]
    assert len({tuple(color) for color in (fall, still, rise, none)}) == 4
