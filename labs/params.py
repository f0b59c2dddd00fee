"""Parameters: declared once, they become sliders, validated fields, CLI options and a link.

A lab's parameters are a frozen pydantic model whose fields are made by a `Group`: `knob` (a number
on a slider), `choice` (one of a few named values), `toggle` (on or off) or `text`.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError, field_validator
from pydantic_core import ErrorDetails
from pydantic_core.core_schema import ValidationInfo

from labs.errors import LabError, ParameterError
from labs.number_texts import MAX_NUMBER_LENGTH
from labs.tunables import Choice, Condition, Effect, Group, Knob, Text, Toggle, Tunable, Value

__all__ = [
    "Choice",
    "Condition",
    "Effect",
    "Group",
    "Knob",
    "Params",
    "Text",
    "Toggle",
    "Tunable",
    "Value",
    "validated_by",
]  # fmt: skip


def validated_by(read: Callable[[str], object]) -> AfterValidator:
    """For the type of a text field, Annotated[str, validated_by(read)]: what `read` refuses with a
    LabError is refused in the same words."""

    def check(text: str) -> str:
        try:
            read(text)
        except LabError as error:
            raise ValueError(str(error)) from None
        return text

    return AfterValidator(check)


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
        for name, tunable in cls.tunables.items():
            for choices in tunable.when:
                for governor, values in choices.items():
                    cls._check_governor(f"{name} acts", governor, values)
            for governor, units in getattr(tunable, "units", {}).items():
                cls._check_governor(f"{name} has another unit", governor, tuple(units))

    @classmethod
    def _check_governor(cls, what: str, governor: str, values: tuple[Value, ...]) -> None:
        if not values or set(values) - _choice_values(cls.tunables.get(governor)):
            raise TypeError(
                f"{cls.__name__}: {what} when {governor} is one of {values}, but these are no "
                "options of a choice or a toggle"
            )

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

    def acts(self, name: str) -> bool:
        """Whether this parameter changes anything under the present choices."""
        when = self.tunables[name].when
        return not when or any(
            all(getattr(self, governor) in values for governor, values in choices.items())
            for choices in when
        )

    @classmethod
    def nearest(cls, name: str, value: float) -> float:
        """What a handle dragged to `value` makes of a knob: in its range, on its slider's grain."""
        knob = cls.tunables[name]
        assert isinstance(knob, Knob)
        return knob.nearest(value)

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


def _choice_values(tunable: Tunable | None) -> set[Any]:
    """What others may depend on."""
    if isinstance(tunable, Choice):
        return set(tunable.options)
    return {True, False} if isinstance(tunable, Toggle) else set()


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
        return float(text) if len(text) <= MAX_NUMBER_LENGTH else text
    except ValueError:
        return text
