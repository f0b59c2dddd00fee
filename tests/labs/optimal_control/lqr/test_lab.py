"""The lab lqr: what its article claims, in numbers, and what its plots show."""

from collections.abc import Mapping

import numpy as np
import pytest

from labs.engine.catalog import find
from labs.engine.run import World
from labs.lab import Inputs
from labs.optimal_control.lqr.comparison import COUNT
from labs.optimal_control.lqr.lab import PUSH_STEPS, Lqr, LqrParams, LqrState
from labs.optimal_control.lqr.recovery import CODES, POINTS
from labs.params import Value
from labs.plots import measured, pictured
from labs.scene import NullScene
from labs.tasks.regulation.linear_systems import linear_system
from tests.labs.experiments import Experiments

LAB = Lqr()
EXPERIMENTS = Experiments("labs.optimal_control", "lqr")


def with_(setting: Mapping[str, Value], **changes: Value) -> LqrParams:
    return LqrParams().change({**setting, **changes})


def states(
    params: LqrParams, seconds: float, inputs: Mapping[int, Inputs] | None = None
) -> list[LqrState]:
    """The states from t = 0 on, until trouble."""
    found = [LAB.init(params, np.random.default_rng(0))]
    for k in range(round(seconds / LAB.period)):
        found.append(LAB.step(params, (inputs or {}).get(k, Inputs()), found[-1]))
        if found[-1].trouble:
            break
    return found


def solved(params: LqrParams) -> LqrState:
    """At t = 0, when the study is over."""
    state = LAB.init(params, np.random.default_rng(0))
    for snapshot in LAB.solve(params, state):
        state = LAB.accept(params, state, snapshot)
    return state


def deviations(params: LqrParams, found: list[LqrState]) -> np.ndarray:
    """(k, nx)."""
    return np.asarray(np.array([s.x for s in found]) - params.linear_system.x_eq)


def strongest(params: LqrParams, found: list[LqrState]) -> float:
    """[N; N m] the largest control."""
    return float(np.abs([s.u for s in found[1:]]).max())


def settling(x: np.ndarray, band: float) -> float:
    """[s] from when on |x| (k,) stays within the band."""
    return float(np.flatnonzero(np.abs(x) > band)[-1] + 1) * LAB.period


def closed_loop(params: LqrParams) -> np.ndarray:
    """|eigenvalues| of A + B K_0, ascending."""
    p = params.regulator.problem
    return np.asarray(np.sort(np.abs(np.linalg.eigvals(p.a + p.b @ params.regulator.gains[0]))))


def bill(params: LqrParams, seconds: float) -> tuple[float, float]:
    """What x_0' P_0 x_0 promises and what is paid."""
    last = states(params, seconds)[-1]
    return last.predicted, last.paid + last.stage


# The article's experiments --------------------------------------------------------------------


@EXPERIMENTS.verify("What control costs")
def test_what_control_costs(setting: Mapping[str, Value]) -> None:
    dear, cheap = with_(setting), with_(setting, r=0.1)
    weak, strong = states(dear, 12.0), states(cheap, 12.0)
    assert strongest(dear, weak) == pytest.approx(0.986, abs=0.01)
    assert strongest(cheap, strong) == pytest.approx(9.47, abs=0.05)
    assert settling(deviations(dear, weak)[:, 0], 0.02) == pytest.approx(5.9, abs=0.05)
    assert settling(deviations(cheap, strong)[:, 0], 0.02) == pytest.approx(1.4, abs=0.05)
    assert closed_loop(cheap)[-1] == pytest.approx(0.947, abs=0.001)
    assert closed_loop(dear)[-1] == pytest.approx(0.986, abs=0.001)


@EXPERIMENTS.verify("The bill is known in advance")
def test_the_bill_is_known_in_advance(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    run = states(params, 8.0)
    promised, paid = bill(params, 8.0)
    assert promised == pytest.approx(278.95, abs=0.01)
    assert paid == pytest.approx(promised, rel=1e-9)
    totals = [s.paid + s.to_go for s in run[1:]]
    np.testing.assert_allclose(totals, promised, rtol=1e-9)
    assert min(np.diff([s.paid for s in run])) >= 0.0
    pole = bill(LqrParams(), 8.0)
    assert pole == pytest.approx((164.7, 178.7), abs=0.05)
    near = bill(LqrParams(deviation=0.05), 8.0)
    assert near[1] / near[0] == pytest.approx(1.0022, abs=0.0003)


@EXPERIMENTS.verify("Constant, then not")
def test_constant_then_not(setting: Mapping[str, Value]) -> None:
    hundred, twice = with_(setting), with_(setting, horizon=200.0)
    assert hundred.regulator.constant == 61
    assert twice.regulator.constant == 161
    assert LAB.fields(twice, solved_quickly(twice))["k_mark"] == pytest.approx([160.0, 160.0])
    np.testing.assert_allclose(
        hundred.regulator.gains[61:], twice.regulator.gains[161:], rtol=1e-10
    )
    heavy = with_(setting, alpha=100.0).regulator
    assert heavy.constant == 61
    steady = heavy.steady
    assert steady is not None
    ends, rests = heavy.gains[-1, 0, 1], steady.gain[0, 1]
    assert ends / rests == pytest.approx(2.4, abs=0.05)
    assert (np.abs(hundred.regulator.gains[-1]) < np.abs(steady.gain)).all()


def solved_quickly(params: LqrParams) -> LqrState:
    """At t = 0, without the study."""
    return LAB.init(params, np.random.default_rng(0))


@EXPERIMENTS.verify("A short horizon does not see the fall")
def test_a_short_horizon_does_not_see_the_fall(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    run = states(params, 5.0)
    assert "ran off its rail" in run[-1].trouble
    dx = deviations(params, run)
    assert np.abs(dx[-1, 1]) < 0.3, "the pole stands up"
    assert np.abs(dx[:, 0]).max() > 1.4
    assert closed_loop(params)[-1] == pytest.approx(1.019, abs=0.001)
    assert closed_loop(with_(setting, horizon=30.0))[-1] < 1.0
    assert not states(with_(setting, horizon=30.0), 10.0)[-1].trouble
    one = with_(setting, horizon=1.0, final="p", alpha=1.0)
    assert one.regulator.steady is not None
    np.testing.assert_allclose(one.regulator.gains[0], one.regulator.steady.gain, rtol=1e-8)
    assert not states(one, 5.0)[-1].trouble


@EXPERIMENTS.verify("A place that costs nothing")
def test_a_place_that_costs_nothing(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    dx = deviations(params, states(params, 10.0))
    assert np.abs(dx[-1, 0]) == pytest.approx(0.80, abs=0.005)
    assert np.abs(dx[-1, 1:]).max() < 1e-3
    assert closed_loop(params)[-1] == pytest.approx(1.0, abs=1e-9)
    refused = states(with_(setting, policy="steady"), 1.0)
    assert len(refused) == 2
    assert "Q does not see the mode with eigenvalue 1," in refused[-1].trouble
    back = with_(setting, policy="steady", q_slide=0.1)
    assert np.abs(deviations(back, states(back, 60.0))[-1, 0]) < 0.01


@EXPERIMENTS.verify("A weaker motor")
def test_a_weaker_motor(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    for limit, lean in ((20.0, 0.76), (10.0, 0.54), (5.0, 0.299)):
        found = with_(setting, limit=limit).loop.largest_lean()
        assert found == pytest.approx(lean, abs=0.005 if limit > 5.0 else 0.001)
    run = states(params, 8.0)
    assert "ran off its rail" in run[-1].trouble
    assert strongest(params, run) == 5.0
    saved = with_(setting, deviation=0.29)
    assert np.abs(deviations(saved, states(saved, 8.0))[-1]).max() < 0.01
    assert (closed_loop(params) == closed_loop(with_(setting, limit=20.0))).all()
    assert with_(setting, r=1.0).loop.largest_lean() == pytest.approx(0.34, abs=0.005)


@EXPERIMENTS.verify("Back from the bottom, not from half way")
def test_back_from_the_bottom_not_from_half_way(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    heaviest = linear_system("pendulum").mechanism.f(np.array([np.pi / 2, 0.0]), np.zeros(1))[1]
    level = linear_system("pendulum").mechanism.f(np.array([np.pi / 2, 0.0]), np.array([4.905]))
    assert heaviest < -10.0
    assert level[1] == pytest.approx(0.0, abs=1e-9), "4.9 N m hold it level"
    assert params.loop.largest_lean() == pytest.approx(0.95, abs=0.005)
    assert np.abs(deviations(params, states(params, 5.0))[-1]).max() < 1e-3
    half = with_(setting, deviation=2.0)
    swings = deviations(half, states(half, 20.0))[:, 0]
    assert swings.min() > 1.9
    assert swings.max() < 2.4
    balance = np.pi - np.arcsin(4.0 / 4.905)
    assert swings.min() < balance < swings.max()


@EXPERIMENTS.verify("One answer, two prices")
def test_one_answer_two_prices(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    pole, mass = solved(params), solved(with_(setting, system="mass"))
    assert (pole.differences[:3] < 1e-13).all()
    assert 1e-6 < pole.differences[-1] < 1e-3
    assert (mass.differences < 1e-12).all()
    a = params.regulator.problem.a
    assert 1e12 < np.linalg.norm(np.linalg.matrix_power(a, 260)) < 1e13
    for name in ("riccati", "at_once"):
        assert (np.asarray(pole.seconds[name]) > 0.0).all()


def test_every_experiment_of_the_article_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()


# The world ------------------------------------------------------------------------------------


@pytest.mark.parametrize("period", [0.01, 0.05, 0.2])
def test_the_policy_looks_once_in_a_step_and_holds(period: float) -> None:
    run = states(LqrParams(period=period), 1.0)
    controls = np.array([s.u[0] for s in run[1:]])
    looks = round(period / LAB.period)
    held = controls[: len(controls) // looks * looks].reshape(-1, looks)
    assert (held == held[:, :1]).all()
    assert (np.diff(held[:, 0]) != 0.0).all()


def test_a_window_uses_its_gains_in_turn_and_starts_over() -> None:
    params = LqrParams(policy="window", horizon=7.0, limits=False)
    run = states(params, 0.4)
    law, system = params.regulator, params.linear_system
    for look in range(20):
        before, after = run[2 * look], run[2 * look + 1]
        assert after.index == look % 7
        expected = law.gains[look % 7] @ (before.x - system.x_eq)
        np.testing.assert_allclose(after.u - system.u_eq, expected, rtol=1e-12)
        to_end = LAB.measure(params, after)["to_end"]
        assert to_end == pytest.approx((7 - look % 7) * 0.02)


def test_weights_are_dragged_while_it_runs() -> None:
    """The control of the very next look is that of the new weights; a new account is opened."""
    old, new = LqrParams(), LqrParams(r=1.0)
    state = states(old, 0.4)[-1]
    after = LAB.step(new, Inputs(), state)
    expected = new.regulator.gains[0] @ (state.x - new.linear_system.x_eq)
    np.testing.assert_allclose(after.u, expected, rtol=1e-12)
    assert after.paid == 0.0
    assert after.predicted == pytest.approx(after.to_go)


@pytest.mark.parametrize("system", ["cart-pole", "pendulum", "mass", "ur5"])
def test_a_push_is_answered(system: str) -> None:
    """From rest, pushed for 0.2 s: it moves, the force is drawn, and it comes back."""
    force = {"cart-pole": 2.0, "pendulum": 5.0, "mass": 5.0, "ur5": 60.0}[system]
    params = LqrParams(system=system, deviation=0.0, q_turn=100.0, r=0.01, push_force=force)
    run = states(params, 6.0, {10: Inputs(actions=("push",))})
    assert not run[-1].trouble
    dx = deviations(params, run)
    assert np.abs(dx[:10]).max() < 1e-9
    assert np.abs(dx).max() > 0.01
    assert np.abs(dx[-1]).max() < 0.1 * np.abs(dx).max()
    pushed = [k for k, s in enumerate(run) if s.force.any()]
    assert pushed == list(range(11, 11 + PUSH_STEPS))
    scene = NullScene()
    LAB.draw(scene, params, run[12])
    assert "force" in scene.names


def test_the_hand_pulls_the_tip_towards_the_ball() -> None:
    params = LqrParams(system="mass", deviation=0.0)
    pulled = Inputs(handles={"pull": (0.0, 0.3, 0.6)})
    run = states(params, 3.0, dict.fromkeys(range(300), pulled))
    stiffness = params.linear_system.spring
    assert run[1].force == pytest.approx([0.0, 0.3 * stiffness, 0.0], rel=0.01)
    dx = deviations(params, run)[-1]
    gain = params.regulator.gains[0][0]
    assert -gain[0] * dx[0] == pytest.approx(stiffness * (0.3 - dx[0]), rel=1e-3), "in balance"


def test_limits_cut_the_control_and_can_be_taken_away() -> None:
    cut, free = LqrParams(limit=3.0), LqrParams(limit=3.0, limits=False)
    assert strongest(cut, states(cut, 0.5)) == 3.0
    assert strongest(free, states(free, 0.5)) > 10.0
    ur5 = LqrParams(system="ur5", q_turn=10_000.0, r=1e-4)
    limit = linear_system("ur5").mechanism.control_limit
    run = states(ur5, 0.1)
    assert (np.abs(run[1].u) <= limit).all()
    assert (np.abs(run[1].u) == limit).any()


def test_off_its_rail_the_world_stops_and_says_so() -> None:
    run = states(LqrParams(deviation=1.5), 10.0)
    assert run[-1].trouble.startswith("At t = ")
    assert np.isfinite(run[-1].x).all()
    assert run[-1].steps == run[-2].steps, "the last sane state stays"


# What the plots show --------------------------------------------------------------------------


def test_every_channel_is_plotted_or_read_out() -> None:
    params = LqrParams()
    state = solved(params)
    shown = {name for plot in Lqr.plots for name in (*measured(plot), *pictured(plot))}
    told = {**LAB.measure(params, state), **LAB.fields(params, state)}
    assert shown - {"to_end"} == set(told)
    assert "to_end" in LAB.measure(params.change({"policy": "window"}), state)


@pytest.mark.parametrize("system", CODES)
def test_the_region_holds_the_rest_and_is_found_row_by_row(system: str) -> None:
    params = LqrParams(system=system)
    state = LAB.init(params, np.random.default_rng(0))
    snapshots = list(LAB.solve(params, state))
    assert [s.progress for s in snapshots] == sorted(s.progress or 0.0 for s in snapshots)
    assert snapshots[-1].progress == 1.0
    assert snapshots[-1].done.startswith("Studied. Recursion and SciPy differ by ")
    for snapshot in snapshots[:POINTS]:
        state = LAB.accept(params, state, snapshot)
    assert set(np.unique(state.region)) <= {0, 1}
    middle = POINTS // 2
    assert state.region[middle, middle] == 1
    mirrored = state.region[::-1, ::-1]
    assert (state.region == mirrored).mean() > 0.99, "left is as right"
    found = LAB.fields(params, state)
    assert len(found["safe_x"]) == (state.region == 1).sum()


def test_the_present_place_is_a_point_of_the_plane() -> None:
    params = LqrParams(deviation=0.2)
    run = states(params, 0.5)
    found = LAB.fields(params, run[-1])
    dx = deviations(params, run)
    np.testing.assert_allclose(found["path_x"], dx[:, 1])
    np.testing.assert_allclose(found["path_y"], dx[:, 3])
    assert found["now_x"] == pytest.approx([dx[-1, 1]])


def test_durations_are_kept_apart_and_the_shortest_counts() -> None:
    params = LqrParams()
    state = solved(params)
    assert set(state.seconds) == {"riccati", "at_once"}
    assert not {"riccati", "at_once"} & set(LAB.measure(params, state))
    every = [s.data for s in LAB.solve(params, state)]
    for name in ("riccati", "at_once"):
        known = np.array([data[name] for data in every])
        assert (known[-1] > 0.0).all()
        later = known[-2 * COUNT - 1 :]
        assert (np.diff(later, axis=0) <= 0.0).all(), "later rounds only shorten"


def test_the_study_is_the_same_every_time() -> None:
    for system in ("cart-pole", "ur5"):
        one, other = (World(find("lqr"), {"system": system}) for _ in range(2))
        for world in (one, other):
            while world.solving:
                world.iterate()
        np.testing.assert_array_equal(one.state.differences, other.state.differences)
        np.testing.assert_array_equal(one.state.region, other.state.region)


def test_without_a_policy_the_page_still_draws() -> None:
    params = LqrParams(q_slide=0.0)
    state = LAB.init(params, np.random.default_rng(0))
    assert state.trouble
    (only,) = LAB.solve(params, state)
    assert only.done == state.trouble
    state = LAB.accept(params, state, only)
    assert np.isfinite(LAB.fields(params, state)["gain"]).all()
    scene = NullScene()
    LAB.draw(scene, params, state)
    assert "system" in scene.names


def test_a_pendulum_pushed_past_a_full_turn_is_wound_back() -> None:
    """As the article says: a linear policy knows q, not q modulo 2 pi."""
    params = with_({}, system="pendulum", deviation=0.0, limit=4.0, push_force=200.0)
    state = LAB.init(params, np.random.default_rng(0))
    turned = []
    for k in range(800):
        pushed = Inputs(("push",)) if k == 0 else Inputs()
        state = LAB.step(params, pushed, state)
        turned.append(float((state.x - params.linear_system.x_eq)[0]))
    assert not state.trouble
    assert 1.8 * 2 * np.pi < max(turned) < 2 * 2 * np.pi
    assert abs(turned[-1]) < 1e-3
