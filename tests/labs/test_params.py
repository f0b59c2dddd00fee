"""Tunables and parameter sets (labs/params.py)."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from labs.errors import ParameterError
from labs.params import Condition, Group, Knob, Params
from labs.tunables import LOG_SPAN, MAX_TEXT_LENGTH, Scale

KNOBS = Group()


class Sample(Params):
    kp: float = KNOBS.knob(100.0, 0.0, 2000.0, "k_p", "N·m/rad", scale="log")
    """Gain."""
    decay: float = KNOBS.knob(0.1, 0.001, 10.0, "a", scale="log")
    """Rate."""
    angle: float = KNOBS.knob(0.0, -3.0, 3.0, "q", "rad", "angle")
    """Angle."""
    law: str = KNOBS.choice("pid", {"pid": "PID", "pd": "PD"}, "Law", effect="restart")
    """Law."""
    period: float = KNOBS.choice(0.001, {0.001: "1 ms", 0.01: "10 ms"}, "T", "", "s")
    """T."""
    limits: bool = KNOBS.toggle(True, "Limits", effect="solve")
    """Cut."""


def a_knob(low: float, high: float, scale: Scale) -> Knob:
    made = KNOBS.knob(low, low, high, "k", scale=scale, help="Help.")
    (knob,) = (entry for entry in made.metadata if isinstance(entry, Knob))
    return knob


@st.composite
def knobs(draw: st.DrawFn) -> Knob:
    scale = draw(st.sampled_from(["linear", "log", "log from zero"]))
    high = draw(st.floats(1e-3, 1e6))
    if scale == "linear":
        return a_knob(high * (1.0 - draw(st.floats(1e-3, 1e3))), high, "linear")
    return a_knob(high / draw(st.floats(1.5, 1e6)) if scale == "log" else 0.0, high, "log")


# The slider -----------------------------------------------------------------------------------


@given(knobs())
def test_both_ends_of_a_slider_are_exact(k: Knob) -> None:
    assert k.at(0.0) == k.low
    assert k.at(1.0) == k.high
    assert k.position(k.low) == pytest.approx(0.0, abs=1e-12)
    assert k.position(k.high) == pytest.approx(1.0, rel=1e-12)


@given(knobs(), st.floats(-1.0, 2.0), st.floats(-1.0, 2.0))
def test_a_slider_is_monotone_and_stays_in_range(k: Knob, one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert k.low <= k.at(low) <= k.at(high) <= k.high


@given(knobs(), st.floats(0.0, 1.0))
def test_position_inverts_at(k: Knob, position: float) -> None:
    """As far as the slider's grain allows: half of it, or half a unit of the third digit."""
    value = k.at(position)
    if k.low < value < k.high:
        grain = 10.0 ** math.floor(math.log10((k.high - k.low) / 200))
        shift = 0.501 * grain if k.scale == "linear" else 0.00501 * abs(value)
        slack = 1e-9 * (k.high - k.low)
        exact = track_value(k, position)
        assert abs(value - exact) <= shift + slack
        assert k.position(exact) == pytest.approx(position, abs=1e-9)


def track_value(k: Knob, position: float) -> float:
    """The scales as their docstring defines them, without rounding."""
    if k.scale == "linear":
        return k.low + position * (k.high - k.low)
    if k.low > 0:
        return k.low * math.exp(position * math.log(k.high / k.low))
    return float(k.high * (LOG_SPAN**position - 1.0) / (LOG_SPAN - 1.0))


def test_a_logarithmic_slider_gives_each_decade_the_same_room() -> None:
    k = a_knob(0.01, 100.0, "log")
    assert [k.at(p) for p in (0.25, 0.5, 0.75)] == [0.1, 1.0, 10.0]


def test_a_logarithmic_slider_from_zero_starts_linear_and_ends_logarithmic() -> None:
    k = a_knob(0.0, 999.0, "log")
    # value = r^s - 1 with r = 1000
    assert k.at(1 / 3) == 9.0
    assert k.at(2 / 3) == 99.0
    assert k.position(0.0) == 0.0


@pytest.mark.parametrize(
    ("name", "dragged", "value"),
    [
        ("angle", 0.123456, 0.12),
        ("angle", -0.004, 0.0),
        ("angle", 99.0, 3.0),
        ("angle", -3.001, -3.0),
        ("kp", 123.456, 123.0),
        ("kp", -1.0, 0.0),
        ("decay", 0.0123456, 0.0123),
        ("decay", 1e-9, 0.001),
        ("mass", 0.37, 0.35),
    ],
)
def test_a_dragged_value_is_one_that_the_slider_takes(
    name: str, dragged: float, value: float
) -> None:
    assert ConditionalParams.nearest(name, dragged) == value
    assert ConditionalParams().change({name: ConditionalParams.nearest(name, dragged)})


# What acts ------------------------------------------------------------------------------------


LOAD = Group("Load", when={"limits": True})


class ConditionalParams(Sample):
    mass: float = LOAD.knob(0.2, 0.1, 2.0, "m", "kg", step=0.05)
    """Mass."""
    ki: float = LOAD.knob(0.0, 0.0, 1.0, "k_i", key=True, when={"law": "pid"})
    """Integral gain."""
    either: float = KNOBS.knob(
        0.0, 0.0, 1.0, "e", when=({"law": ["pd"]}, {"period": (0.01,), "limits": False})
    )
    """Acts in two cases."""


@pytest.mark.parametrize(
    ("changes", "acting"),
    [
        ({}, {"mass", "ki"}),
        ({"law": "pd"}, {"mass", "either"}),
        ({"limits": False}, set()),
        ({"limits": False, "period": 0.01}, {"either"}),
        ({"limits": False, "law": "pd"}, {"either"}),
    ],
)
def test_a_tunable_acts_under_the_choices_it_names(
    changes: dict[str, object], acting: set[str]
) -> None:
    params = ConditionalParams().change(changes)
    assert {name for name in params.tunables if params.acts(name)} == {*Sample.tunables} | acting


def test_a_description_says_what_matters_and_when_it_acts() -> None:
    described = {d["name"]: d for d in json.loads(json.dumps(ConditionalParams.describe()))}
    assert [name for name, d in described.items() if d["key"]] == ["ki"]
    assert described["kp"]["when"] == []
    assert described["ki"]["when"] == [{"limits": [True], "law": ["pid"]}]
    assert described["either"]["when"] == [{"law": ["pd"]}, {"period": [0.01], "limits": [False]}]


@pytest.mark.parametrize(
    "when", [{"law": "pdi"}, {"law": []}, {"kp": 1.0}, {"nothing": True}, {"limits": "pid"}]
)
def test_a_condition_names_options_of_a_choice(when: Condition) -> None:
    with pytest.raises(TypeError, match=r"Astray: more acts when \w+ is one of"):

        class Astray(Sample):
            more: float = KNOBS.knob(0.0, 0.0, 1.0, "m", when=when)
            """More."""


# Refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [-0.001, 2000.5, math.nan, math.inf, -math.inf, "100", None, []])
def test_a_knob_refuses_with_its_range_and_unit(value: object) -> None:
    with pytest.raises(ParameterError) as refused:
        Sample().change({"kp": value})
    assert str(refused.value) == f"kp = {value}: kp takes a number from 0 to 2000 N·m/rad"


@pytest.mark.parametrize("value", [True, False])
@pytest.mark.parametrize("name", ["kp", "period"])
def test_a_bool_is_no_number(name: str, value: bool) -> None:
    with pytest.raises(ParameterError, match=rf"{name} = {value}: {name} takes"):
        Sample().change({name: value})


@pytest.mark.parametrize("value", ["PID", "", 1.0, None, [], {}])
def test_a_choice_refuses_with_its_options(value: object) -> None:
    with pytest.raises(ParameterError) as refused:
        Sample().change({"law": value})
    assert str(refused.value) == f"law = {value}: law takes one of pid, pd"


@pytest.mark.parametrize("value", [0.002, math.nan, math.inf, "0.001", None])
def test_a_choice_of_numbers_refuses_what_lies_between(value: object) -> None:
    with pytest.raises(ParameterError, match=r"period takes one of 0\.001, 0\.01"):
        Sample().change({"period": value})


@pytest.mark.parametrize("value", [0, 1, "true", 1.0, None])
def test_a_toggle_takes_only_true_and_false(value: object) -> None:
    with pytest.raises(ParameterError) as refused:
        Sample().change({"limits": value})
    assert str(refused.value) == f"limits = {value}: limits takes true or false"


def test_an_unknown_name_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ParameterError) as refused:
        Sample().change({"kq": 1.0, "ka": 2.0})
    assert str(refused.value) == (
        "no parameter is named 'ka', 'kq'; there are kp, decay, angle, law, period, limits"
    )


def test_every_wrong_value_is_named_at_once() -> None:
    with pytest.raises(ParameterError, match=r"kp takes a number .*; law takes|law = x: law takes"):
        Sample().change({"kp": -1.0, "law": "x"})


def test_a_huge_wrong_value_is_cut_short() -> None:
    with pytest.raises(ParameterError) as refused:
        Sample().change({"law": "x" * 100_000})
    assert len(str(refused.value)) < 200


# Sets -----------------------------------------------------------------------------------------


def test_a_whole_number_is_a_number() -> None:
    assert Sample().change({"kp": 500}).kp == 500.0


def test_parameters_are_frozen() -> None:
    with pytest.raises(ValidationError):
        Sample().kp = 1.0


def test_a_change_makes_a_new_set_and_leaves_the_old() -> None:
    old = Sample()
    new = old.change({"kp": 1.0})
    assert (old.kp, new.kp) == (100.0, 1.0)


def test_a_change_changes_all_or_nothing() -> None:
    params = Sample()
    with pytest.raises(ParameterError):
        params.change({"kp": 1.0, "law": "none"})
    assert params == Sample()


def test_differing_names_what_differs() -> None:
    assert Sample().change({"kp": 5.0, "limits": False}).changed_from(Sample()) == {
        "kp": 5.0,
        "limits": False,
    }
    assert Sample().changed_from(Sample()) == {}


def test_a_unit_may_depend_on_a_choice() -> None:
    class Pushed(Params):
        drive: str = KNOBS.choice("motor", {"motor": "Motor", "cart": "Cart"}, "Drive")
        """What pushes."""
        most: float = KNOBS.knob(1.0, 0.0, 9.0, "u", "N·m", units={"drive": {"cart": "N"}})
        """At most."""

    most = Pushed.tunables["most"]
    assert isinstance(most, Knob)
    assert [most.unit_under({"drive": drive}) for drive in ("motor", "cart")] == ["N·m", "N"]
    with pytest.raises(TypeError, match="Astray: more has another unit when drive is one of"):

        class Astray(Pushed):
            more: float = KNOBS.knob(1.0, 0.0, 9.0, "m", units={"drive": {"car": "N"}})
            """More."""


def test_a_bare_field_is_refused_when_the_class_is_made() -> None:
    with pytest.raises(TypeError, match="Bare: make other with a Group"):

        class Bare(Params):
            kp: float = KNOBS.knob(1.0, 0.0, 2.0, "k")
            """Gain."""
            other: float = 1.0


def test_a_default_out_of_range_is_refused() -> None:
    class Wrong(Params):
        kp: float = KNOBS.knob(3.0, 0.0, 2.0, "k")
        """Gain."""

    with pytest.raises(ValidationError):
        Wrong()


def test_a_subclass_keeps_the_tunables_of_its_base() -> None:
    class More(Sample):
        mass: float = KNOBS.knob(1.0, 0.1, 2.0, "m", "kg")
        """Mass."""

    assert list(More.tunables) == [*Sample.tunables, "mass"]


# Texts ----------------------------------------------------------------------------------------


class Texts(Params):
    short: str = KNOBS.text("a", "S")
    """S."""
    long: str = KNOBS.text("b", "L", max_length=MAX_TEXT_LENGTH)
    """L."""


@pytest.mark.parametrize(("name", "most"), [("short", 400), ("long", 32_000)])
def test_a_text_has_a_length(name: str, most: int) -> None:
    assert getattr(Texts().change({name: "é" * most}), name) == "é" * most
    with pytest.raises(ParameterError, match=f"{name}: .*at most {most} characters"):
        Texts().change({name: "é" * (most + 1)})
    described = {tunable["name"]: tunable["max_length"] for tunable in Texts.describe()}
    assert described[name] == most


@pytest.mark.parametrize("most", [0, MAX_TEXT_LENGTH + 1])
def test_no_text_is_longer_than_a_request(most: int) -> None:
    with pytest.raises(ValueError, match="from 1 to 32000"):
        KNOBS.text("a", "T", max_length=most, help="T.")


# Text and JSON --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("kp", "500", 500.0),
        ("kp", "5e2", 500.0),
        ("law", "pd", "pd"),
        ("period", "0.01", 0.01),
        ("period", "1e-2", 0.01),
        ("limits", "true", True),
        ("limits", "False", False),
        ("limits", "on", True),
        ("limits", "0", False),
    ],
)
def test_text_is_read_as_the_tunable_means_it(name: str, text: str, value: object) -> None:
    read = Sample.read({name: text})
    assert read == {name: value}
    assert type(read[name]) is type(value)
    assert getattr(Sample().change(read), name) == value


@pytest.mark.parametrize(
    ("name", "text"),
    [("kp", "much"), ("kp", "nan"), ("kp", ""), ("law", "7"), ("limits", "maybe"), ("nope", "1")],
)
def test_text_that_means_nothing_is_refused_by_change(name: str, text: str) -> None:
    with pytest.raises(ParameterError, match=name):
        Sample().change(Sample.read({name: text}))


@given(st.floats(0.0, 2000.0))
def test_a_number_survives_as_text(value: float) -> None:
    assert Sample().change(Sample.read({"kp": str(value)})).kp == value


def test_a_description_is_json_in_the_order_of_declaration() -> None:
    described: list[dict[str, Any]] = json.loads(json.dumps(Sample.describe()))
    assert [d["name"] for d in described] == ["kp", "decay", "angle", "law", "period", "limits"]
    assert [d["kind"] for d in described] == ["knob"] * 3 + ["choice"] * 2 + ["toggle"]
    kp, period = described[0], described[4]
    assert (kp["default"], kp["low"], kp["high"], kp["scale"]) == (100.0, 0.0, 2000.0, "log")
    assert (kp["symbol"], kp["label"], kp["unit"]) == ("k_p", "k_p", "N·m/rad")
    assert period["options"] == [
        {"value": 0.001, "label": "1 ms"},
        {"value": 0.01, "label": "10 ms"},
    ]
