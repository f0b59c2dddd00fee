"""Tunables: declared once, they become a slider, a validated field, a CLI option and a link.

A lab's parameters are a frozen pydantic model whose fields are made by a `Group`: `knob` (a number
on a slider), `choice` (one of a few named values), `toggle` (on or off) or `text`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails
from pydantic_core.core_schema import ValidationInfo

from labs.errors import ParameterError

Effect = Literal["live", "solve", "restart"]
Scale = Literal["linear", "log"]
Value = float | str | bool

# A logarithmic slider that reaches zero bends to linear below high / LOG_SPAN.
LOG_SPAN = 1000.0
TEXT_LENGTH = 400
LONGEST_TEXT = 4000
"""A link holds it: three bytes for a letter in most alphabets, three characters for a byte."""


@dataclass(frozen=True)
class Tunable:
    """What every tunable has. `effect`: "live" acts from the next step on, "solve" starts the
    solver again, "restart" runs `Lab.init` again."""

    help: str
    label: str
    symbol: str
    group: str
    effect: Effect

    @property
    def kind(self) -> str:
        return type(self).__name__.lower()

    def describe(self, name: str, default: Value) -> dict[str, Any]:
        """Everything a page needs to show this tunable, as plain JSON data."""
        return {"name": name, "kind": self.kind, "default": default, **vars(self)}


@dataclass(frozen=True)
class Knob(Tunable):
    """A number in [low, high] on a slider. `symbol` is TeX as in the notes."""

    unit: str
    low: float
    high: float
    step: float
    scale: Scale

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
        """The value at a slider position in [0, 1]. On a logarithmic scale it has three
        significant digits; the ends are exact."""
        if position <= 0.0:
            return self.low
        if position >= 1.0:
            return self.high
        if self.scale == "linear":
            return self.low + position * (self.high - self.low)
        if self.low > 0:
            value = self.low * (self.high / self.low) ** position
        else:
            value = self.high * math.expm1(position * math.log(LOG_SPAN)) / (LOG_SPAN - 1)
        return min(max(float(f"{value:.3g}"), self.low), self.high)


@dataclass(frozen=True)
class Choice(Tunable):
    """One of a few values. `options` maps each value to the words shown for it."""

    options: Mapping[Any, str]
    unit: str

    def describe(self, name: str, default: Value) -> dict[str, Any]:
        options = [{"value": value, "label": text} for value, text in self.options.items()]
        return super().describe(name, default) | {"options": options}


@dataclass(frozen=True)
class Toggle(Tunable):
    """On or off."""


@dataclass(frozen=True)
class Text(Tunable):
    """A short text, such as the rows of a table. What it must say, the lab's model validates:
    with a `field_validator` that raises ValueError, its message a sentence that helps."""

    rows: int
    max_length: int
    """Characters."""


@dataclass(frozen=True)
class Group:
    """Tunables that stand together under a heading; each is a field and its docstring, its help:

        WEIGHTS = Group("Weights", effect="solve")

        class LqrParams(Params):
            r: float = WEIGHTS.knob(0.1, 1e-4, 1e4, "r", "1/N²", "Control", scale="log")
            \"\"\"R = r I: what force or torque costs.\"\"\"

    A tunable may have another `effect` than its group, and its `help` may be an argument where a
    docstring cannot say it. Without a label a tunable shows its symbol."""

    name: str = ""
    effect: Effect = "live"

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
        effect: Effect | None = None,
        help: str = "",
    ) -> Any:
        """A number in [low, high] with a slider. `step` is the slider's grain (0: a thousandth)."""
        shared = (help, label or symbol, symbol, self.name, effect or self.effect)
        tunable = Knob(*shared, unit, low, high, step, scale)
        return _field(default, tunable, ge=low, le=high, allow_inf_nan=False)

    def choice(
        self,
        default: Value,
        options: Mapping[Any, str],
        label: str,
        symbol: str = "",
        unit: str = "",
        *,
        effect: Effect | None = None,
        help: str = "",
    ) -> Any:
        """One of a few values; `options` maps each value to the words shown for it."""
        tunable = Choice(help, label, symbol, self.name, effect or self.effect, options, unit)
        return _field(default, tunable, json_schema_extra={"enum": list(options)})

    def toggle(
        self, default: bool, label: str, *, effect: Effect | None = None, help: str = ""
    ) -> Any:
        """On or off."""
        return _field(default, Toggle(help, label, "", self.name, effect or self.effect))

    def text(
        self,
        default: str,
        label: str,
        symbol: str = "",
        *,
        rows: int = 1,
        max_length: int = TEXT_LENGTH,
        effect: Effect | None = None,
        help: str = "",
    ) -> Any:
        """A text of at most `max_length` characters (up to LONGEST_TEXT), shown in `rows` lines."""
        if not 1 <= max_length <= LONGEST_TEXT:
            raise ValueError(
                f"max_length = {max_length}: a text holds from 1 to {LONGEST_TEXT} characters"
            )
        shared = (help, label, symbol, self.name, effect or self.effect)
        return _field(default, Text(*shared, rows, max_length), max_length=max_length)


def _field(default: Value, tunable: Tunable, **constraints: Any) -> Any:
    # Without a description here, pydantic takes the field's docstring.
    field: FieldInfo = Field(default, description=tunable.help or None, **constraints)
    field.metadata.append(tunable)
    return field


class Params(BaseModel):
    """The tunables of one lab: frozen, validated, every field with a default."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        validate_default=True,
        use_attribute_docstrings=True,
    )

    tunables: ClassVar[Mapping[str, Tunable]] = {}

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        cls.tunables = {
            name: replace(entry, help=" ".join((field.description or "").split()))
            for name, field in cls.model_fields.items()
            for entry in field.metadata
            if isinstance(entry, Tunable)
        }
        bare = sorted(set(cls.model_fields) - set(cls.tunables))
        if bare:
            raise TypeError(f"{cls.__name__}: make {', '.join(bare)} with a Group")
        silent = [name for name, tunable in cls.tunables.items() if not tunable.help]
        if silent:
            raise TypeError(f"{cls.__name__}: {', '.join(silent)} lacks a docstring, its help")

    @field_validator("*")
    @classmethod
    def _check_option(cls, value: Value, info: ValidationInfo) -> Value:
        tunable = cls.tunables.get(info.field_name or "")
        if isinstance(tunable, Choice) and value not in tunable.options:
            raise ValueError("is none of its options")
        return value

    def change(self, changes: Mapping[str, object]) -> Self:
        """These parameters with some changed. Raises ParameterError; changes all or nothing."""
        unknown = sorted(set(changes) - set(self.tunables))
        if unknown:
            raise ParameterError(
                f"no parameter is named {', '.join(map(repr, unknown))}; "
                f"there are {', '.join(self.tunables)}"
            )
        try:
            return type(self).model_validate(self.model_dump() | dict(changes))
        except ValidationError as error:
            raise ParameterError("; ".join(map(self._error_message, error.errors()))) from None

    def changed_from(self, other: Self) -> dict[str, Value]:
        """The values of these parameters that `other` does not share."""
        theirs = other.model_dump()
        return {k: v for k, v in self.model_dump().items() if v != theirs[k]}

    @classmethod
    def read(cls, texts: Mapping[str, str]) -> dict[str, object]:
        """Values from command lines and links: "500" to 500.0, "true" to True, words as words."""
        return {name: _from_text(text, cls.tunables.get(name)) for name, text in texts.items()}

    @classmethod
    def describe(cls) -> list[dict[str, Any]]:
        """All tunables in order, as plain JSON data."""
        defaults = cls().model_dump()
        return [tunable.describe(name, defaults[name]) for name, tunable in cls.tunables.items()]

    @classmethod
    def _error_message(cls, error: ErrorDetails) -> str:
        name = str(error["loc"][0])
        tunable = cls.tunables[name]
        shown = f"{name} = {str(error['input'])[:80]!s}"
        if isinstance(tunable, Knob):
            unit = f" {tunable.unit}" if tunable.unit else ""
            return f"{shown}: {name} takes a number from {tunable.low:g} to {tunable.high:g}{unit}"
        if isinstance(tunable, Choice):
            return f"{shown}: {name} takes one of {', '.join(map(str, tunable.options))}"
        if isinstance(tunable, Text):
            why = error["msg"].removeprefix("Value error, ")
            return f"{name}: {why}"
        return f"{shown}: {name} takes true or false"


def _from_text(text: str, tunable: Tunable | None) -> object:
    if isinstance(tunable, Choice):
        return next((value for value in tunable.options if str(value) == text), _number(text))
    if isinstance(tunable, Text):
        return text
    if isinstance(tunable, Toggle):
        return {"true": True, "1": True, "on": True, "false": False, "0": False, "off": False}.get(
            text.lower(), text
        )
    return _number(text)


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
