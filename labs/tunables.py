"""What a tunable is: a number on a slider, one of a few values, on or off, or a text.

A `Group` makes them; `labs.params` gathers them into the parameters of a lab.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypedDict, Unpack

from pydantic import Field
from pydantic.fields import FieldInfo

Effect = Literal["live", "solve", "restart"]
Scale = Literal["linear", "log"]
Value = float | str | bool

ChoiceCondition = Mapping[str, Value | Sequence[Value]]
"""By the name of a choice or a toggle the value, or the values, it must have: all of them."""
Condition = ChoiceCondition | Sequence[ChoiceCondition]
"""Under which choices a tunable acts: such choices, or several that each suffice."""

# A logarithmic slider that reaches zero bends to linear below high / LOG_SPAN.
LOG_SPAN = 1000.0
DEFAULT_TEXT_LENGTH = 400
MAX_TEXT_LENGTH = 32_000
"""Half of what a request may hold, for line ends and quotes are two characters there; a link leaves
out what is too long for it."""
ALWAYS: Condition = ()
NO_UNITS: Mapping[str, Mapping[Value, str]] = {}


@dataclass(frozen=True, kw_only=True)
class Tunable:
    """What every tunable has. `effect`: "live" acts from the next step on, "solve" starts the
    solver again, "restart" runs `Lab.init` again."""

    help: str
    label: str
    symbol: str
    group: str
    effect: Effect
    key: bool
    """Whether it is one of the few that matter first."""
    when: Sequence[Mapping[str, tuple[Value, ...]]]
    """It acts where each choice of one of these has one of its values; always if there is none."""

    @property
    def kind(self) -> str:
        return type(self).__name__.lower()

    def describe(self, name: str, default: Value) -> dict[str, Any]:
        """Everything a page needs to show this tunable, as plain JSON data."""
        return {"name": name, "kind": self.kind, "default": default, **vars(self)}


@dataclass(frozen=True, kw_only=True)
class Knob(Tunable):
    """A number in [low, high] on a slider. `symbol` is TeX as in the notes."""

    unit: str
    units: Mapping[str, Mapping[Value, str]]
    """By the name of a choice and its value the unit it has there instead."""
    low: float
    high: float
    step: float
    scale: Scale

    def unit_under(self, values: Mapping[str, Value]) -> str:
        """The unit under these values of the choices."""
        found = [units.get(values[name]) for name, units in self.units.items()]
        return next((unit for unit in found if unit is not None), self.unit)

    def position(self, value: float) -> float:
        """Where on the slider, in [0, 1], this value sits.

        Logarithmic with low > 0: value = low (high/low)^s. With low = 0 the scale is
        value = high (r^s - 1) / (r - 1) with r = LOG_SPAN, which passes through zero."""
        if self.scale == "linear":
            return (value - self.low) / (self.high - self.low)
        if self.low > 0:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return math.log1p(value / self.high * (LOG_SPAN - 1)) / math.log(LOG_SPAN)

    def at(self, position: float) -> float:
        """The value a hand sets at a slider position in [0, 1]; the ends are exact."""
        if position <= 0.0:
            return self.low
        if position >= 1.0:
            return self.high
        if self.scale == "linear":
            return self.nearest(self.low + position * (self.high - self.low))
        if self.low > 0:
            return self.nearest(self.low * (self.high / self.low) ** position)
        return self.nearest(self.high * math.expm1(position * math.log(LOG_SPAN)) / (LOG_SPAN - 1))

    def nearest(self, value: float) -> float:
        """The nearest value in range that a hand sets: whole steps of `step` from the low end
        (about a thousandth of the range if it is 0), or three significant digits on a logarithmic
        scale."""
        if self.scale == "linear":
            grain = self.step or 10.0 ** math.floor(math.log10((self.high - self.low) / 200))
            steps = math.floor((value - self.low) / grain + 0.5)
            value = round(self.low + steps * grain, 10) + 0.0
        else:
            value = float(f"{value:.3g}")
        return min(max(value, self.low), self.high)


@dataclass(frozen=True, kw_only=True)
class Choice(Tunable):
    """One of a few values. `options` maps each value to the words shown for it."""

    options: Mapping[Any, str]
    unit: str

    def describe(self, name: str, default: Value) -> dict[str, Any]:
        options = [{"value": value, "label": text} for value, text in self.options.items()]
        return super().describe(name, default) | {"options": options}


@dataclass(frozen=True, kw_only=True)
class Toggle(Tunable):
    """On or off."""


@dataclass(frozen=True, kw_only=True)
class Text(Tunable):
    """A short text, such as the rows of a table. What it must say, the lab's model validates:
    by its type (`labs.params.validated_by`), or with a `field_validator` that raises ValueError,
    its message a sentence that helps."""

    rows: int
    max_length: int
    """Characters."""


class TunableOptions(TypedDict, total=False):
    """What may be said of any tunable."""

    effect: Effect
    key: bool
    when: Condition
    help: str


@dataclass(frozen=True)
class Group:
    """Tunables that stand together under a heading; each is a field and its docstring, its help:

        WEIGHTS = Group("Weights", effect="solve")

        class LqrParams(Params):
            r: float = WEIGHTS.knob(0.1, 1e-4, 1e4, "r", "1/N²", "Control", scale="log")
            \"\"\"R = r I: what force or torque costs.\"\"\"

    A tunable may have another `effect` than its group, and its `help` may be an argument where a
    docstring cannot say it. Without a label a tunable shows its symbol.

    With `key=True` a tunable matters first: it stands on top, and in the scene's own panel. With
    `when` it acts under some choices only, and is shown only there:

        ki: float = CONTROLLER.knob(0.0, 0.0, 2000.0, "k_i", key=True, when={"law": "pid"})

    as also a whole group may; several such conditions, of which one suffices, are a tuple."""

    name: str = ""
    effect: Effect = "live"
    when: Condition = ALWAYS

    def knob(
        self,
        default: float,
        low: float,
        high: float,
        symbol: str,
        unit: str = "",
        label: str = "",
        *,
        step: float = 0.0,
        scale: Scale = "linear",
        units: Mapping[str, Mapping[Value, str]] = NO_UNITS,
        **shared: Unpack[TunableOptions],
    ) -> Any:
        """A number in [low, high] with a slider. `step` is the slider's grain (0: a thousandth).
        What is measured may depend on a choice: `units={"system": {"mass": "m"}}`."""
        own = self._tunable(label or symbol, symbol, **shared)
        knob = Knob(**own, unit=unit, units=units, low=low, high=high, step=step, scale=scale)
        return _field(default, knob, ge=low, le=high, allow_inf_nan=False)

    def choice(
        self,
        default: Value,
        options: Mapping[Any, str],
        label: str,
        symbol: str = "",
        unit: str = "",
        **shared: Unpack[TunableOptions],
    ) -> Any:
        """One of a few values; `options` maps each value to the words shown for it."""
        choice = Choice(**self._tunable(label, symbol, **shared), options=options, unit=unit)
        return _field(default, choice, json_schema_extra={"enum": list(options)})

    def toggle(self, default: bool, label: str, **shared: Unpack[TunableOptions]) -> Any:
        """On or off."""
        return _field(default, Toggle(**self._tunable(label, "", **shared)))

    def text(
        self,
        default: str,
        label: str,
        symbol: str = "",
        *,
        rows: int = 1,
        max_length: int = DEFAULT_TEXT_LENGTH,
        **shared: Unpack[TunableOptions],
    ) -> Any:
        """A text of at most `max_length` characters (up to MAX_TEXT_LENGTH), shown in `rows`
        lines."""
        if not 1 <= max_length <= MAX_TEXT_LENGTH:
            raise ValueError(
                f"max_length = {max_length}: a text holds from 1 to {MAX_TEXT_LENGTH} characters"
            )
        text = Text(**self._tunable(label, symbol, **shared), rows=rows, max_length=max_length)
        return _field(default, text, max_length=max_length)

    def _tunable(
        self,
        label: str,
        symbol: str,
        *,
        effect: Effect | None = None,
        key: bool = False,
        when: Condition = ALWAYS,
        help: str = "",
    ) -> dict[str, Any]:
        """What all kinds of tunables share."""
        group, own = list(_alternatives(self.when)), list(_alternatives(when))
        both = [a | b for a in group for b in own] if group and own else group or own
        return {
            "help": help,
            "label": label,
            "symbol": symbol,
            "group": self.name,
            "effect": effect or self.effect,
            "key": key,
            "when": both,
        }


def _alternatives(when: Condition) -> Iterator[dict[str, tuple[Value, ...]]]:
    for choices in [when] if isinstance(when, Mapping) else when:
        yield {
            name: (values,) if isinstance(values, str | float | int) else tuple(values)
            for name, values in choices.items()
        }


def _field(default: Value, tunable: Tunable, **constraints: Any) -> Any:
    # Without a description here, pydantic takes the field's docstring.
    field: FieldInfo = Field(default, description=tunable.help or None, **constraints)
    field.metadata.append(tunable)
    return field
