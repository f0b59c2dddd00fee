"""What must hold of every lab at any time, and the settings the tests of the contract try."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import ArrayLike

from labs import plots
from labs.engine.catalog import CatalogEntry, catalog
from labs.engine.run import World
from labs.lab import State
from labs.params import Choice, Knob, Text, Value
from labs.scene import Color, cell_centers
from labs.shapes import Body, Vector3
from server.articles import render

Point = tuple[float, float, float]

# Options that go wrong on purpose, in the test suite's own labs.
FAULTS = {("troublesome", "raise"), ("troublesome", "hang"), ("troublesome", "slow")}

ENTRIES = list(catalog().values())

CHECKED_ITERATIONS = 12
"""Iterations of a solver that are looked at."""


def extreme_values(entry: CatalogEntry) -> Iterator[tuple[str, Value]]:
    """Both ends of every knob, every option of every choice, both sides of every toggle, and of a
    text what it says by default."""
    for name, tunable in entry.lab.Params.tunables.items():
        match tunable:
            case Knob():
                values: list[Any] = [tunable.low, tunable.high]
            case Choice():
                values = list(tunable.options)
            case Text():
                values = [getattr(entry.lab.Params(), name)]
            case _:
                values = [False, True]
        for value in values:
            if (entry.slug, value) not in FAULTS:
                yield name, value


def settings(entry: CatalogEntry) -> Iterator[tuple[str, Mapping[str, Value]]]:
    """Every preset and every experiment."""
    for name, preset in entry.lab.presets.items():
        yield f"preset {name}", preset
    for experiment in render(entry).experiments:
        yield f"experiment {experiment.title}", experiment.settings


def variants(entry: CatalogEntry) -> Iterator[Mapping[str, Value]]:
    """The defaults, every preset, every experiment, and every other option of every choice that
    acts."""
    yield {}
    for _, changes in settings(entry):
        yield changes
    defaults = entry.lab.Params()
    for name, value in extreme_values(entry):
        is_choice = isinstance(defaults.tunables[name], Choice)
        if is_choice and defaults.acts(name) and value != getattr(defaults, name):
            yield {name: value}


@contextmanager
def annotate_failure(what: object) -> Iterator[None]:
    """What fails within says where: many settings are tried in one test."""
    try:
        yield
    except Exception as error:
        error.add_note(f"with {what}")
        raise


class CheckingScene:
    """Fulfils `labs.scene.Scene`; refuses what a viewer could not show."""

    def __init__(self) -> None:
        self.drawn: set[str] = set()

    def camera(self, position: ArrayLike, look_at: ArrayLike, core: ArrayLike = ()) -> None:
        assert np.linalg.norm(_check_point(position) - _check_point(look_at)) > 0.0

    def arm(
        self,
        name: str,
        arm: Body,
        q: np.ndarray,
        *,
        ghost: bool = False,
        effort: np.ndarray | None = None,
    ) -> None:
        self._new(name)
        assert q.shape == (arm.model.nq,)
        assert np.isfinite(q).all()
        if effort is not None:
            assert effort.shape == (arm.model.nv,)
            assert np.isfinite(effort).all()
            assert (effort >= 0.0).all()

    def trail(
        self, name: str, points: np.ndarray, color: Color = "actual", strength: float = 1.0
    ) -> None:
        self._new(name, color)
        assert 0.0 < strength <= 1.0
        assert points.ndim in (2, 3)
        assert points.shape[-2] >= 2, "a line has two ends"
        assert points.shape[-1] == 3
        assert np.isfinite(points).all()

    def arrow(self, name: str, start: ArrayLike, end: ArrayLike, color: Color = "force") -> None:
        self._new(name, color)
        _check_point(start), _check_point(end)

    def sphere(self, name: str, center: ArrayLike, radius: float, color: Color = "actual") -> None:
        self._new(name, color)
        _check_point(center)
        assert 0.0 < radius < np.inf

    def frame(self, name: str, placement: pin.SE3, length: float = 0.15) -> None:
        self._new(name)
        assert np.isfinite(placement.homogeneous).all()
        np.testing.assert_allclose(placement.rotation @ placement.rotation.T, np.eye(3), atol=1e-6)
        assert 0.0 < length < np.inf

    def arc(
        self,
        name: str,
        center: ArrayLike,
        axis: ArrayLike,
        angle: float,
        radius: float,
        color: Color = "force",
    ) -> None:
        self._new(name, color)
        _check_point(center)
        assert np.linalg.norm(_check_point(axis)) > 0.0, "an arc has an axis"
        assert -2 * np.pi < angle < 2 * np.pi
        assert 0.0 < radius < np.inf

    def ellipsoid(
        self, name: str, center: ArrayLike, axes: np.ndarray, color: Color = "actual"
    ) -> None:
        self._new(name, color)
        _check_point(center)
        assert axes.shape == (3, 3)
        assert np.isfinite(axes).all()

    def handle(self, name: str, position: ArrayLike, radius: float = 0.05) -> None:
        self._new(name)
        _check_point(position)
        assert 0.0 < radius < np.inf

    def label(self, name: str, text: str, position: ArrayLike) -> None:
        self._new(name)
        _check_point(position)
        assert text.strip()

    def cells(
        self,
        name: str,
        origin: ArrayLike,
        size: float,
        colors: np.ndarray,
        *,
        clickable: bool = True,
    ) -> None:
        self._new(name)
        _check_point(origin)
        assert 0.0 < size < np.inf
        assert colors.ndim == 3
        assert min(colors.shape) >= 1, "a board has cells"
        _check_colors(colors)

    def surface(self, name: str, points: np.ndarray, colors: np.ndarray) -> None:
        self._new(name)
        assert points.ndim == 3
        assert min(points.shape[:2]) >= 2, "a surface extends in two directions"
        assert points.shape[2] == 3
        assert points.shape == colors.shape
        assert np.isfinite(points).all()
        _check_colors(colors)

    def arrows(
        self, name: str, starts: np.ndarray, ends: np.ndarray, color: Color = "force"
    ) -> None:
        self._new(name, color)
        assert starts.ndim == 2
        assert starts.shape[1] == 3
        assert starts.shape == ends.shape
        assert np.isfinite(starts).all()
        assert np.isfinite(ends).all()

    def polygon(
        self,
        name: str,
        corners: np.ndarray,
        color: Color | Vector3 = "actual",
        opacity: float = 1.0,
    ) -> None:
        self._new(name, color if isinstance(color, str) else "actual")
        if not isinstance(color, str):
            _check_colors(np.array(color))
        assert 0.0 < opacity <= 1.0
        assert corners.ndim == 2
        assert corners.shape[0] >= 3, "a polygon has three corners"
        assert corners.shape[1] == 3
        assert np.isfinite(corners).all()

    def dots(
        self, name: str, centers: np.ndarray, diameter: float, color: Color = "actual"
    ) -> None:
        self._new(name, color)
        assert 0.0 < diameter < np.inf
        assert centers.ndim == 2
        assert centers.shape[1] == 3
        assert np.isfinite(centers).all()

    def _new(self, name: str, color: Color = "actual") -> None:
        assert name.strip()
        assert "/" not in name, "a name is one step in the scene's tree"
        assert name not in self.drawn, f"{name} is drawn twice in one frame"
        assert color in Color.__args__  # type: ignore[attr-defined]
        self.drawn.add(name)


class InteractionScene(CheckingScene):
    """Remembers what can be dragged and what can be clicked."""

    def __init__(self, world: World) -> None:
        """What the world draws now."""
        super().__init__()
        self.handles: dict[str, Point] = {}
        """Where each ball is."""
        self.boards: dict[str, list[Point]] = {}
        """The middle of each cell of each board."""
        world.lab.draw(self, world.params, world.state)

    def handle(self, name: str, position: ArrayLike, radius: float = 0.05) -> None:
        super().handle(name, position, radius)
        self.handles[name] = _point_tuple(_check_point(position))

    def cells(
        self,
        name: str,
        origin: ArrayLike,
        size: float,
        colors: np.ndarray,
        *,
        clickable: bool = True,
    ) -> None:
        super().cells(name, origin, size, colors, clickable=clickable)
        if clickable:
            centers = cell_centers(origin, size, *colors.shape[:2]).reshape(-1, 3)
            self.boards[name] = [_point_tuple(center) for center in centers]

    @property
    def interactive_names(self) -> set[str]:
        """The names of all of them."""
        return {*self.handles, *self.boards}


def _point_tuple(point: np.ndarray) -> Point:
    x, y, z = map(float, point)
    return (x, y, z)


def _check_point(value: ArrayLike) -> np.ndarray:
    point = np.asarray(value, dtype=float)
    assert point.shape == (3,)
    assert np.isfinite(point).all()
    return point


def _check_colors(colors: np.ndarray) -> None:
    assert colors.shape[-1] == 3
    assert ((colors >= 0.0) & (colors <= 1.0)).all(), "a colour lies in [0, 1]"


def check_world(world: World) -> None:
    """All that must hold of a world at any time."""
    lab, params, state = world.lab, world.params, world.state
    assert isinstance(state, State)
    assert all(np.isfinite(a).all() for a in arrays_of(state)), "the state is finite"
    for name, value in lab.measure(params, state).items():
        assert np.isfinite(value).all(), f"{name} is finite"
    gaps = {name for plot in lab.plots for name in plots.fields_with_gaps(plot)}
    for name, value in lab.fields(params, state).items():
        assert (np.isfinite(value) | (name in gaps) & np.isnan(value)).all(), f"{name} is finite"
    for name, text in lab.notes(params, state).items():
        assert text.strip() == text != "", f"{name} says something"
    scene = CheckingScene()
    lab.draw(scene, params, state)
    if state.trouble:
        check_sentence(state.trouble)


def check_sentence(sentence: str) -> None:
    """It says something to a person."""
    assert sentence[0].isupper(), sentence
    assert sentence.rstrip().endswith((".", "!", "?")), sentence
    assert len(sentence.split()) >= 4, sentence
    assert "nan" not in sentence.lower().split(), sentence


def arrays_of(value: Any) -> Iterator[np.ndarray]:
    """Every number in plain data; anything else than plain data fails."""
    if value is None or isinstance(value, str | bool):
        return
    if isinstance(value, int | float | complex | np.number | np.ndarray):
        array = np.asarray(value)
        assert array.dtype != object, "an array of objects is not plain data"
        if array.dtype.kind in "fc":
            yield array
    elif is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            yield from arrays_of(getattr(value, field.name))
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from arrays_of(part)
    elif isinstance(value, list | tuple):
        for part in value:
            yield from arrays_of(part)
    else:
        pytest.fail(f"{type(value).__name__} is not plain data: {value!r}")


def bitwise_equal(a: Any, b: Any) -> bool:
    """Whether two states hold bit for bit the same."""
    return bool(comparable(a) == comparable(b))


def comparable(value: Any) -> Any:
    """Plain data as something to compare bit for bit."""
    if isinstance(value, np.ndarray):
        return (str(value.dtype), value.shape, value.tobytes())
    if isinstance(value, np.number):
        return (str(value.dtype), value.tobytes())
    if is_dataclass(value) and not isinstance(value, type):
        # Durations by the wall clock are nobody's promise.
        hidden = {"seconds"} if isinstance(value, State) else set()
        names = [f.name for f in fields(value) if f.name not in hidden]
        named = [(name, comparable(getattr(value, name))) for name in names]
        return (type(value).__name__, tuple(named))
    if isinstance(value, Mapping):
        return tuple((key, comparable(part)) for key, part in value.items())
    if isinstance(value, list | tuple):
        return tuple(comparable(part) for part in value)
    return repr(value)


def started_world(
    entry: CatalogEntry,
    changes: Mapping[str, Value] | None = None,
    steps: int = 3,
    iterations: int = CHECKED_ITERATIONS,
) -> World:
    """A world after a few iterations of its solver and a few steps."""
    world = World(entry, changes, seed=1)
    iterate(world, iterations)
    advance(world, steps)
    return world


def iterate(world: World, most: int) -> None:
    """Up to so many iterations of the solver, where there is one."""
    while world.solving and most > 0:
        world.iterate()
        most -= 1


def advance(world: World, steps: int) -> None:
    """So many steps, where there is a world."""
    for _ in range(steps if world.lab.has_world() else 0):
        world.advance()


def plotted_values(world: World) -> Any:
    """What a user can read off the plots, as something to compare."""
    lab, params, state = world.lab, world.params, world.state
    return comparable({"measured": lab.measure(params, state), "fields": lab.fields(params, state)})


def record_drawing(world: World) -> Any:
    """All that is drawn, as something to compare."""
    calls: list[Any] = []

    class Listing:
        def __getattr__(self, name: str) -> Any:
            return lambda *given, **named: calls.append((name, given, named))

    world.lab.draw(Listing(), world.params, world.state)
    return comparable(calls)


def advanced_world(
    entry: CatalogEntry, changes: Mapping[str, Value] | None = None, steps: int = 30
) -> World:
    """A world after its solver and some steps."""
    world = World(entry, changes, seed=1)
    while world.solving:
        world.iterate()
    advance(world, steps)
    return world
