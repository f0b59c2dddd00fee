"""One's own A, B, Q, R and x0: how they may be written, and what is made of them."""

import itertools
import json

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from labs.errors import LabError, ParameterError
from labs.optimal_control.lqr.lab import Lqr
from labs.optimal_control.lqr.own_system import EXAMPLE_SYSTEM, parse_own_system
from tests.labs.optimal_control.lqr.simulation import lqr_params, states

A, B, Q = [[1.0, 0.1], [0.0, 1.0]], [[0.005], [0.1]], [[10.0, 0.0], [0.0, 1.0]]


@pytest.mark.parametrize(
    "text",
    [
        EXAMPLE_SYSTEM,
        "\ufeff" + EXAMPLE_SYSTEM.replace("\n", "\r\n"),
        "A = [1, 0.1; 0, 1]; B = [0.005; 0.1]; Q = [10 0; 0 1]; R = 0.1; x0 = [1; 0];",
        "A = np.array([[1, 0.1],\n [0, 1]])\nB = np.array([[0.005], [0.1]])\n"
        "Q = np.diag([10, 1])\nR = [[1/10]]\nx_0: 1, 0",
        "A:\n1 0.1\n0 1\nB:\n0.005\n0.1\nQ: 10 1\nR: 10 %\nx0:\n1\n0",
        "% plant\nA = [1 0.1; 0 1]; % 2 states\n# input\nB = [0.005; 0.1] # one\n"
        "Q = diag(10, 1) % weights\nR = 10 %\nx0 = 1 0",
        "A = np.array([[1, 0.1], [0, 1]], dtype=float)\nB = np.array([[0.005], [0.1]])\n"
        "Q = np.diag([10, 1])\nR = 0.1\nx0 = 1, 0",
        json.dumps({"A": A, "B": [0.005, 0.1], "Q": Q, "R": 0.1, "x0": [1, 0]}),
    ],
    ids=["example", "windows", "matlab", "numpy", "lines", "comments", "dtype", "json"],
)
def test_ways_to_write_it(text: str) -> None:
    system = parse_own_system(text)
    np.testing.assert_array_equal(system.a, A)
    np.testing.assert_array_equal(system.b, B)
    np.testing.assert_array_equal(system.q, Q)
    np.testing.assert_array_equal(system.r, [[0.1]])
    np.testing.assert_array_equal(system.x0, [1.0, 0.0])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "each matrix begins with its name"),
        ("1 2\nA = 1", "'1 2': each matrix begins with its name"),
        ("A = 1\nB = 1", "Q, R, x0 missing"),
        (EXAMPLE_SYSTEM.replace("0 1\nB", "0\nB"), "A: its rows have 2, 1 numbers"),
        (EXAMPLE_SYSTEM.replace("1 0.1; 0 1", "1 0.1"), "A is 1 x 2: it is square"),
        (EXAMPLE_SYSTEM.replace("0.005; 0.1", "1; 2; 3"), "B is 3 x 1: it has 2 rows"),
        (EXAMPLE_SYSTEM.replace("diag(10, 1)", "diag(1, 2, 3)"), "Q is 3 x 3: it is 2 x 2, for A"),
        (EXAMPLE_SYSTEM.replace("diag(10, 1)", "1 2; 0 1"), "Q"),
        (EXAMPLE_SYSTEM.replace("diag(10, 1)", "1 0; 0 -1"), "Q has an eigenvalue -1: it takes a"),
        (EXAMPLE_SYSTEM.replace("diag(10, 1)", "1 2; 0 1"), "Q is not symmetric"),
        (
            EXAMPLE_SYSTEM.replace("diag(10, 1)", "np.eye(2)"),
            "Q: eye(...) is not worked out: write the",
        ),
        (EXAMPLE_SYSTEM.replace("R = 0.1", "R = 0.1*ones(1, 1)"), "R: ones(...) is not worked out"),
        (EXAMPLE_SYSTEM.replace("R = 0.1", "R = 0"), "R"),
        (EXAMPLE_SYSTEM.replace("x0 = 1 0", "x0 = 1"), "x0 has 1 numbers: A wants 2"),
        (EXAMPLE_SYSTEM.replace("R = 0.1", "R = much"), "R: 'much' is no number"),
        (EXAMPLE_SYSTEM + "\nC = 1", "C? There are A, B, Q, R, x0"),
        (EXAMPLE_SYSTEM.replace("R = 0.1", "R = 1e9"), "R holds 1e+09"),
        ('{"A": 1', "not sound JSON"),
        ('{"A": [1, [2]]}', "A: a list of rows goes"),
    ],
)
def test_what_is_wrong_is_named(text: str, said: str) -> None:
    with pytest.raises(LabError) as refused:
        parse_own_system(text)
    assert said in str(refused.value)


def test_it_is_regulated_as_scipy_says_and_steps_by_its_matrices() -> None:
    params = lqr_params({"system": "own", "period": 0.1})
    P = solve_discrete_are(A, B, Q, [[0.1]])
    np.testing.assert_allclose(params.regulator.values[0], P, rtol=1e-8)
    run = states(params, 1.0)
    found = np.array([state.x for state in run[::10]])
    K = params.regulator.gains[0]
    for before, after in itertools.pairwise(found):
        np.testing.assert_allclose(after, (np.array(A) + B @ K) @ before, atol=1e-12)
    np.testing.assert_array_equal(run[9].x, run[0].x)
    assert run[-1].past_cost < run[0].x @ P @ run[0].x


@pytest.mark.parametrize("controls", [1, 2, 3, 4])
def test_any_number_of_controls_goes(controls: int) -> None:
    """Of three states; and where nothing but control costs, what is stable is left alone."""
    b = "; ".join(" ".join(str(i + j + i * j) for j in range(controls)) for i in range(3))
    text = f"A = 0.9 0.1 0; 0 0.8 0.1; 0 0 0.7\nB = {b}\nQ = 0\nR = 1\nx0 = 1 1 1"
    params = lqr_params({"system": "own", "matrices": text, "period": 0.01})
    law, state = params.regulator, states(params, 0.05)[-1]
    assert Lqr().measure(params, state)["growth"] == pytest.approx(0.9)
    assert law.riccati_error <= 0.0
    costly = lqr_params(params.model_dump() | {"matrices": text.replace("Q = 0", "Q = 1")})
    p, k = costly.regulator.relative_to_steady()
    np.testing.assert_allclose(p[0], 1.0, rtol=1e-6)
    np.testing.assert_allclose(k[0], 1.0, rtol=1e-6)


def test_continuous_time_is_held() -> None:
    text = EXAMPLE_SYSTEM.replace("1 0.1; 0 1", "0 1; 0 0").replace("0.005; 0.1", "0; 1")
    a, b = parse_own_system(text, continuous=True).linear(0.1)
    np.testing.assert_allclose(a, A, atol=1e-15)
    np.testing.assert_allclose(b, B, atol=1e-15)


def test_what_outgrows_all_numbers_in_continuous_time_is_refused() -> None:
    fast = EXAMPLE_SYSTEM.replace("1 0.1; 0 1", "1000 0; 0 1").replace("0.005; 0.1", "0.1; 1e6")
    params = lqr_params({"system": "own", "matrices": fast, "time": "continuous", "period": 0.2})
    assert "no steady state" in states(params, 0.1)[-1].trouble
    with pytest.raises(ParameterError, match=r"matrices: A grows as exp\(3500 t\)"):
        params.change({"matrices": fast.replace("1000", "3500")})
    assert parse_own_system(fast.replace("1000", "3500")).nx == 2


def test_what_cannot_be_held_is_trouble_and_no_error() -> None:
    lost = EXAMPLE_SYSTEM.replace("1 0.1; 0 1", "2 0; 0 1")
    lost = lost.replace("0.005; 0.1", "0; 1")
    run = states(lqr_params({"system": "own", "matrices": lost}), 0.1)
    assert "no steady state" in run[-1].trouble
    grows = lqr_params({"system": "own", "matrices": lost, "policy": "window", "period": 0.01})
    assert "its state passed 1e+06" in states(grows, 1.0)[-1].trouble
