"""The sliders: Viser's panel, generated from a lab's parameters.

A logarithmic knob is two rows: a number with its true value, and a slider over its logarithm."""

import math
from collections.abc import Callable
from itertools import groupby
from typing import Any

import viser

from labs.engine.run import World
from labs.lab import Action
from labs.params import Choice, Knob, Params, Text, Tunable, Value
from server.mailbox import Mailbox

Show = Callable[[Value], None]
TICKS = 1000


class Panel:
    """Shows parameters and puts the user's changes into the mailbox; never changes the world."""

    def __init__(self, server: viser.ViserServer, mailbox: Mailbox, world: World) -> None:
        self._gui, self._mailbox = server.gui, mailbox
        self._show: dict[str, Show] = {}
        self._shown: dict[str, Value] = {}
        server.gui.set_panel_label(world.lab.title)
        values = world.params.model_dump()
        groups = groupby(world.params.tunables.items(), key=lambda item: item[1].group)
        for group, members in groups:
            with self._gui.add_folder(group or "Parameters", expand_by_default=True):
                for name, tunable in members:
                    self._show[name] = self._add(name, tunable, values[name])
                for action in world.lab.actions:
                    if group and action.group == group:
                        self._button(action)
        for action in world.lab.actions:
            if not action.group:
                self._button(action)
        self._shown = values

    def show(self, params: Params) -> None:
        """Moves every control whose parameter differs from what is shown."""
        values = params.model_dump()
        for name, value in values.items():
            if self._shown.get(name) != value:
                self._show[name](value)
        self._shown = values

    def _add(self, name: str, tunable: Tunable, value: Value) -> Show:
        match tunable:
            case Knob(scale="log"):
                return self._logarithmic(name, tunable, float(value))
            case Knob():
                return self._linear(name, tunable, float(value))
            case Choice():
                return self._choice(name, tunable, value)
            case Text():
                field = self._gui.add_text(
                    tunable.label, str(value), multiline=tunable.rows > 1, hint=tunable.help
                )
                return self._wire(field, name)
            case _:
                box = self._gui.add_checkbox(tunable.label, bool(value), hint=tunable.help)
                return self._wire(box, name)

    def _linear(self, name: str, knob: Knob, value: float) -> Show:
        grain = knob.step or 10.0 ** math.floor(math.log10((knob.high - knob.low) / 200))
        slider = self._gui.add_slider(
            _label(knob), knob.low, knob.high, grain, value, hint=_hint(knob)
        )
        return self._wire(slider, name)

    def _logarithmic(self, name: str, knob: Knob, value: float) -> Show:
        number: Any = self._gui.add_number(
            knob.label, value, min=knob.low, max=knob.high, step=None, hint=_hint(knob)
        )
        slider: Any = self._gui.add_slider(
            knob.unit or "log",
            0.0,
            1.0,
            1 / TICKS,
            _tick(knob, value),
            marks=tuple((_tick(knob, mark), f"{mark:g}") for mark in _decades(knob)),
            hint=_hint(knob),
        )

        @number.on_update  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            if event.client_id is not None:
                self._shown.pop(name, None)
                self._send(name, float(number.value))

        @slider.on_update  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            if event.client_id is not None:
                self._shown.pop(name, None)
                self._send(name, knob.at(slider.value))

        def show(value: Value) -> None:
            number.value = float(value)
            # A slider already within a tick is left alone: the hand may still be on it.
            if abs(slider.value - knob.position(float(value))) > 1.5 / TICKS:
                slider.value = _tick(knob, float(value))

        return show

    def _choice(self, name: str, choice: Choice, value: Value) -> Show:
        labels = [str(text) for text in choice.options.values()]
        values = list(choice.options)
        box = self._gui.add_dropdown(
            _label(choice), labels, initial_value=labels[values.index(value)], hint=choice.help
        )
        return self._wire(
            box,
            name,
            read=lambda label: values[labels.index(label)],
            write=lambda v: labels[values.index(v)],
        )

    def _wire(
        self,
        control: Any,
        name: str,
        read: Callable[[Any], Value] = lambda value: value,
        write: Callable[[Any], Any] = lambda value: value,
    ) -> Show:
        # Asynchronous callbacks run in order on Viser's event loop; plain ones do not.
        @control.on_update  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            if event.client_id is not None:
                self._shown[name] = read(control.value)
                self._send(name, read(control.value))

        def show(value: Value) -> None:
            control.value = write(value)

        return show

    def _button(self, action: Action) -> None:
        button = self._gui.add_button(action.label, hint=action.help)

        @button.on_click
        async def _(_: Any) -> None:
            self._mailbox.put("press", action=action.name)

    def _send(self, name: str, value: Value) -> None:
        self._mailbox.put("params", changes={name: value})


def _label(tunable: Knob | Choice) -> str:
    return f"{tunable.label} [{tunable.unit}]" if tunable.unit else tunable.label


def _hint(knob: Knob) -> str:
    unit = f" {knob.unit}" if knob.unit else ""
    return f"{knob.help} From {knob.low:g} to {knob.high:g}{unit}."


def _tick(knob: Knob, value: float) -> float:
    return round(knob.position(value) * TICKS) / TICKS


def _decades(knob: Knob) -> list[float]:
    """The ends, and the powers of ten between them that leave room for their digits; where there
    are none, the middle."""
    top = math.floor(math.log10(knob.high) - 0.3)
    marks = [10.0**k for k in range(top, top - 12, -1)]
    inner = [m for m in marks if m > knob.low and 0.15 < knob.position(m) < 0.85]
    return [knob.low, *(inner or [knob.at(0.5)]), knob.high]
