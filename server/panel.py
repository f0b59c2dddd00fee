"""The scene's own panel, made by Viser: the knobs that matter first, and the actions.

It has sliders and menus only: what a person types into a field of Viser's is cut to the decimals
of its first value, or sent key by key. A slider goes over its knob's track, from 0 to 1; the value
is said in its label."""

import math
from collections.abc import Callable
from typing import Any

import viser

from labs.engine.run import World
from labs.lab import Action
from labs.params import Choice, Knob, Params, Text, Tunable, Value
from server.mailbox import Mailbox

ShowValue = Callable[[Value, str], None]
"""A value, and its unit."""
SLIDER_STEPS = 1000


class Panel:
    """Shows parameters and puts the user's changes into the mailbox; never changes the world."""

    def __init__(self, server: viser.ViserServer, mailbox: Mailbox, world: World) -> None:
        self._gui, self._mailbox = server.gui, mailbox
        self._controls: dict[str, tuple[Any, ShowValue]] = {}
        self._shown: dict[str, tuple[Value, str]] = {}
        server.gui.set_panel_label(world.lab.title)
        for name, tunable in world.params.tunables.items():
            if tunable.key and not isinstance(tunable, Text):
                self._controls[name] = self._add(name, tunable, getattr(world.params, name))
        for action in world.lab.actions:
            self._button(action)
        self.show(world.params)

    def show(self, params: Params) -> None:
        """Moves every control whose parameter differs from what is shown; hides those that do not
        act."""
        for name, (control, show) in self._controls.items():
            control.visible = params.acts(name)
            tunable, values = params.tunables[name], vars(params)
            unit = tunable.unit_under(values) if isinstance(tunable, Knob) else ""
            if self._shown.get(name) != (values[name], unit):
                show(values[name], unit)
                self._shown[name] = values[name], unit

    def _add(self, name: str, tunable: Tunable, value: Value) -> tuple[Any, ShowValue]:
        match tunable:
            case Knob():
                return self._slider(name, tunable, float(value))
            case Choice():
                return self._menu(name, tunable, value)
            case _:
                box = self._gui.add_checkbox(tunable.label, bool(value), hint=tunable.help)
                return self._connect(box, name)

    def _slider(self, name: str, knob: Knob, value: float) -> tuple[Any, ShowValue]:
        slider: Any = self._gui.add_slider(
            knob.label,
            0.0,
            1.0,
            1 / SLIDER_STEPS,
            _slider_position(knob, value),
            marks=tuple(
                (_slider_position(knob, mark), f"{mark:g}") for mark in _slider_marks(knob)
            ),
            hint=knob.help,
        )
        self._connect(slider, name, read=knob.at)

        def show(value: Value, unit: str) -> None:
            slider.label = f"{knob.label} = {float(value):.6g} {unit}".rstrip()
            # One that is where it leads already is left alone: the hand may still be on it.
            if knob.at(slider.value) != value:
                slider.value = _slider_position(knob, float(value))

        return slider, show

    def _menu(self, name: str, choice: Choice, value: Value) -> tuple[Any, ShowValue]:
        labels = [str(text) for text in choice.options.values()]
        values = list(choice.options)
        menu = self._gui.add_dropdown(
            f"{choice.label} [{choice.unit}]" if choice.unit else choice.label,
            labels,
            initial_value=labels[values.index(value)],
            hint=choice.help,
        )
        return self._connect(
            menu,
            name,
            read=lambda label: values[labels.index(label)],
            write=lambda v: labels[values.index(v)],
        )

    def _connect(
        self,
        control: Any,
        name: str,
        read: Callable[[Any], Value] = lambda value: value,
        write: Callable[[Any], Any] = lambda value: value,
    ) -> tuple[Any, ShowValue]:
        # Asynchronous callbacks run in order on Viser's event loop; plain ones do not.
        @control.on_update  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            if event.client_id is not None:
                self._shown.pop(name, None)
                self._mailbox.put("params", changes={name: read(control.value)})

        def show(value: Value, unit: str) -> None:
            control.value = write(value)

        return control, show

    def _button(self, action: Action) -> None:
        button = self._gui.add_button(action.label, hint=action.help)

        @button.on_click
        async def _(_: Any) -> None:
            self._mailbox.put("press", action=action.name)


def _slider_position(knob: Knob, value: float) -> float:
    return round(knob.position(value) * SLIDER_STEPS) / SLIDER_STEPS


def _slider_marks(knob: Knob) -> list[float]:
    """The ends; on a logarithmic track also the powers of ten between them that leave room for
    their digits."""
    if knob.scale == "linear":
        return [knob.low, knob.high]
    top = math.floor(math.log10(knob.high) - 0.3)
    inner = [m for m in (10.0**k for k in range(top, top - 12, -1)) if m > knob.low]
    return [knob.low, *(m for m in inner if 0.15 < knob.position(m) < 0.85), knob.high]
