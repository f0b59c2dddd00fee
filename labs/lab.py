"""The contract every lab fulfils.

A lab is one idea of the course as a small world: parameters the user turns, a state that
evolves, numbers to plot and things to draw. The same object runs live behind a page and
headless under `labs.engine.run`, bit for bit the same.
"""

import abc
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from labs.errors import ParameterError
from labs.params import Params, Value
from labs.plots import Plot
from labs.scene import Scene

Measurement = Mapping[str, "float | np.ndarray"]


@dataclass(frozen=True)
class Action:
    """A button that does something once, in the panel and on the page ("push")."""

    name: str
    label: str
    help: str
    group: str = ""
    """The group of parameters its button stands with; empty: below all."""


@dataclass(frozen=True)
class Handle:
    """What the user drags in the scene (`Scene.handle`) or clicks (`Scene.cells`), by the name it
    is drawn under."""

    name: str
    help: str
    count: int = 0
    """Of several of a kind how many there may be, drawn as "NAME 1" to "NAME count"; 0: just
    NAME."""

    @property
    def names(self) -> tuple[str, ...]:
        """All names it is drawn under."""
        numbers = range(1, self.count + 1)
        return tuple(f"{self.name} {k}" for k in numbers) or (self.name,)

    def __str__(self) -> str:
        """As a sentence lists it."""
        return self.name if not self.count else f"{self.name} 1 to {self.name} {self.count}"


@dataclass(frozen=True)
class Inputs:
    """What the user does to the world besides turning parameters, as one step sees it."""

    actions: tuple[str, ...] = ()
    """Names of the actions pressed since the last step."""
    handles: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    """Where each held handle is dragged to [m]; a released handle is absent."""


@dataclass
class State:
    """What evolves: arrays and numbers only, so that it can be saved, rewound and branched.

    `trouble` is empty while all is well. A step that cannot go on sets it to a sentence that
    says when and why it stopped and what to change; the world then waits for a reset."""

    t: float = 0.0
    """Simulated time [s]."""
    trouble: str = ""
    seconds: Mapping[str, float | np.ndarray] = field(default_factory=dict)
    """Wall-clock durations [s] a solver measured, by name, for `fields` to show. Nothing is
    computed with them: they are the one part of a state that two equal runs do not share."""


@dataclass(frozen=True)
class Snapshot:
    """One iteration of a solver: what `Lab.accept` takes into the state."""

    iteration: int
    """From 1."""
    data: Mapping[str, Any] = field(default_factory=dict)
    """Plain data that is never written into again. It is complete: accepted once more, after later
    ones or in a run begun anew, it shows this iteration. What is finite is saved with a solution;
    durations [s] are not, and stand under "seconds", where `accept` may find nothing."""
    done: str = ""
    """Why the solver stopped, in a sentence; empty while it goes on."""
    progress: float | None = None
    """The part done, in [0, 1], where it is known."""


P = TypeVar("P", bound=Params)
S = TypeVar("S", bound=State)


ChoiceSettings = Mapping[str, Mapping[Value, Mapping[str, Value]]]
"""By the name of a choice and one of its values."""


class Lab(abc.ABC, Generic[P, S]):
    """One lab. It has a world's clock (`step`), a solver's clock (`solve`), both or neither.

    Instances keep no state between calls; caches of models and workspaces are allowed."""

    title: ClassVar[str]
    section: ClassVar[str]
    """Section of the notes, "1.2"."""
    summary: ClassVar[str]
    """One sentence for the card on the home page."""
    Params: ClassVar[type[Params]]
    plots: ClassVar[tuple[Plot, ...]] = ()
    period: ClassVar[float] = 0.01
    """[s] simulated by one step of the world's clock; every step is recorded."""
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {}
    """Named settings; a preset starts from the defaults."""
    choice_settings: ClassVar[ChoiceSettings] = {}
    """What else is set when a hand chooses one of a choice's values, such as the horizon that a
    robot takes; choosing another brings the defaults back. Of choices that restart."""
    actions: ClassVar[tuple[Action, ...]] = ()
    handles: ClassVar[tuple[Handle, ...]] = ()
    """All that `draw` may offer to be dragged or clicked."""

    @classmethod
    def changed_params(cls, before: P, changes: Mapping[str, object]) -> P:
        """With the changes, and the settings that go with choices among them (`choice_settings`);
        what is given holds. Raises ParameterError."""
        after, defaults, more = before.change(changes), cls.Params(), dict[str, object]()
        for name, settings in cls.choice_settings.items():
            left, taken = getattr(before, name), getattr(after, name)
            if left != taken:
                more |= {other: getattr(defaults, other) for other in settings.get(left, {})}
                more |= settings.get(taken, {})
        return after.change(more | dict(changes))

    @abc.abstractmethod
    def init(self, params: P, rng: np.random.Generator) -> S:
        """The state at t = 0. All randomness of a run descends from `rng`."""

    def step(self, params: P, inputs: Inputs, state: S) -> S:
        """The state one `period` later."""
        raise NotImplementedError

    def solve(self, params: P, state: S) -> Iterator[Snapshot | None]:
        """Yields after every iteration of the solver, the last with `done` set; None in the midst
        of an iteration that takes more than some milliseconds, so that the scene keeps moving."""
        raise NotImplementedError

    def accept(self, params: P, state: S, snapshot: Snapshot) -> S:
        """The state that has taken in what the solver found."""
        raise NotImplementedError

    def edit(
        self, params: P, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The parameters that change when the handle of this name is dragged to `point` [m], such
        as a target's coordinates. Where there are any, `step` does not see the handle."""
        return {}

    def measure(self, params: P, state: S) -> Measurement:
        """Channels over time: scalars and (n,) vectors, finite, the same shapes all through a
        run. A scalar that is not defined (yet) is left out."""
        return {}

    def fields(self, params: P, state: S) -> Mapping[str, np.ndarray]:
        """Arrays for curves, heat maps, matrices and bars; asked for a few times a second. Finite
        but for plots that may have gaps, where NaN is what has no value."""
        return {}

    def notes(self, params: P, state: S) -> Mapping[str, str]:
        """Sentences for `Note` plots, asked for with the fields. No name is a field's, too."""
        return {}

    def labels(self, params: P) -> Mapping[str, str | tuple[str, ...]]:
        """Words of the plots (labs/plots.py) that depend on the parameters, such as a unit or the
        names of states; a tuple has one for each component, curve, bar or row. No name is a
        field's or a note's, too."""
        return {}

    def results(self, params: P, state: S) -> Mapping[str, np.ndarray]:
        """What a saved solution says to other programs, beside the fields: matrices, gains, values,
        policies, by the names of the notes. It is never read back."""
        return {}

    @abc.abstractmethod
    def draw(self, scene: Scene, params: P, state: S) -> None:
        """Draws one frame."""

    @classmethod
    def prepare(cls) -> None:
        """Compiles and loads what the first step would wait for. Called once, before any session,
        in the process that sessions are forked from; nothing may depend on it."""

    @classmethod
    def check_action(cls, name: str) -> None:
        """Raises ParameterError unless an action has this name."""
        names = [action.name for action in cls.actions]
        if name not in names:
            raise ParameterError(
                f"no action is named {name!r}; there are {', '.join(names) or 'none'}"
            )

    @classmethod
    def check_handle(cls, name: str) -> None:
        """Raises ParameterError unless a handle may have this name."""
        if not any(name in handle.names for handle in cls.handles):
            raise ParameterError(
                f"no handle is named {name!r}; there are "
                f"{', '.join(map(str, cls.handles)) or 'none'}"
            )

    @classmethod
    def has_world(cls) -> bool:
        return cls.step is not Lab.step

    @classmethod
    def has_solver(cls) -> bool:
        return cls.solve is not Lab.solve
