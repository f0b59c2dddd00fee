"""The contract of a lab (labs/lab.py), asked of every lab in the catalogue."""

import copy
import pickle
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import ArrayLike

from labs import plots
from labs.engine.catalog import Entry, catalog
from labs.engine.events import Event
from labs.engine.headless import run
from labs.engine.run import World
from labs.engine.snapshots import leaves
from labs.engine.solution import Solution
from labs.lab import Inputs, Snapshot, State
from labs.params import Choice, Knob, Params, Text, Toggle, Value
from labs.plots import Bars, Curves, HeatMap, Matrix, Note, Readout, TimeSeries, Trace
from labs.scene import Color
from labs.shapes import Body
from server.articles import render, tex

SECONDS = 1.0
"""Simulated for each end of each knob and each option."""

# Options that go wrong on purpose, in the test suite's own labs.
FAULTS = {("troublesome", "raise"), ("troublesome", "hang"), ("troublesome", "slow")}

ENTRIES = list(catalog().values())


def extremes(entry: Entry) -> Iterator[tuple[str, Value]]:
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


def settings(entry: Entry) -> Iterator[tuple[str, Mapping[str, Value]]]:
    """Every preset and every experiment."""
    for name, preset in entry.lab.presets.items():
        yield f"preset {name}", preset
    for experiment in render(entry).experiments:
        yield f"experiment {experiment.title}", experiment.settings


EXTREMES = [
    pytest.param(entry, name, value, id=f"{entry.slug}-{name}={value}")
    for entry in ENTRIES
    for name, value in extremes(entry)
]
SETTINGS = [
    pytest.param(entry, dict(values), id=f"{entry.slug}-{name}")
    for entry in ENTRIES
    for name, values in settings(entry)
]
every_lab = pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.slug)


class CheckingScene:
    """Fulfils `labs.scene.Scene`; refuses what a viewer could not show."""

    def __init__(self) -> None:
        self.names: set[str] = set()

    def camera(self, position: ArrayLike, look_at: ArrayLike) -> None:
        assert np.linalg.norm(_point(position) - _point(look_at)) > 0.0

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
        assert points.ndim == 2
        assert points.shape[0] >= 2, "a line has two ends"
        assert points.shape[1] == 3
        assert np.isfinite(points).all()

    def arrow(self, name: str, start: ArrayLike, end: ArrayLike, color: Color = "force") -> None:
        self._new(name, color)
        _point(start), _point(end)

    def sphere(self, name: str, center: ArrayLike, radius: float, color: Color = "actual") -> None:
        self._new(name, color)
        _point(center)
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
        _point(center)
        assert np.linalg.norm(_point(axis)) > 0.0, "an arc has an axis"
        assert -2 * np.pi < angle < 2 * np.pi
        assert 0.0 < radius < np.inf

    def ellipsoid(
        self, name: str, center: ArrayLike, axes: np.ndarray, color: Color = "actual"
    ) -> None:
        self._new(name, color)
        _point(center)
        assert axes.shape == (3, 3)
        assert np.isfinite(axes).all()

    def handle(self, name: str, position: ArrayLike, radius: float = 0.05) -> None:
        self._new(name)
        _point(position)
        assert 0.0 < radius < np.inf

    def label(self, name: str, text: str, position: ArrayLike) -> None:
        self._new(name)
        _point(position)
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
        _point(origin)
        assert 0.0 < size < np.inf
        assert colors.ndim == 3
        assert min(colors.shape) >= 1, "a board has cells"
        _colors(colors)

    def surface(self, name: str, points: np.ndarray, colors: np.ndarray) -> None:
        self._new(name)
        assert points.ndim == 3
        assert min(points.shape[:2]) >= 2, "a surface extends in two directions"
        assert points.shape[2] == 3
        assert points.shape == colors.shape
        assert np.isfinite(points).all()
        _colors(colors)

    def arrows(
        self, name: str, starts: np.ndarray, ends: np.ndarray, color: Color = "force"
    ) -> None:
        self._new(name, color)
        assert starts.ndim == 2
        assert starts.shape[1] == 3
        assert starts.shape == ends.shape
        assert np.isfinite(starts).all()
        assert np.isfinite(ends).all()

    def _new(self, name: str, color: Color = "actual") -> None:
        assert name.strip()
        assert "/" not in name, "a name is one step in the scene's tree"
        assert name not in self.names, f"{name} is drawn twice in one frame"
        assert color in Color.__args__  # type: ignore[attr-defined]
        self.names.add(name)


def _point(value: ArrayLike) -> np.ndarray:
    point = np.asarray(value, dtype=float)
    assert point.shape == (3,)
    assert np.isfinite(point).all()
    return point


def _colors(colors: np.ndarray) -> None:
    assert colors.shape[-1] == 3
    assert ((colors >= 0.0) & (colors <= 1.0)).all(), "a colour lies in [0, 1]"


def check(world: World) -> None:
    """All that must hold of a world at any time."""
    lab, params, state = world.lab, world.params, world.state
    assert isinstance(state, State)
    assert all(np.isfinite(a).all() for a in _arrays(state)), "the state is finite"
    for name, value in lab.measure(params, state).items():
        assert np.isfinite(value).all(), f"{name} is finite"
    gaps = {name for plot in lab.plots for name in plots.may_have_gaps(plot)}
    for name, value in lab.fields(params, state).items():
        assert (np.isfinite(value) | (name in gaps) & np.isnan(value)).all(), f"{name} is finite"
    for name, text in lab.notes(params, state).items():
        assert text.strip() == text != "", f"{name} says something"
    scene = CheckingScene()
    lab.draw(scene, params, state)
    if state.trouble:
        sentence = state.trouble
        assert sentence[0].isupper(), sentence
        assert sentence.rstrip().endswith((".", "!", "?")), sentence
        assert len(sentence.split()) >= 4, sentence
        assert "nan" not in sentence.lower().split(), sentence


def _arrays(value: Any) -> Iterator[np.ndarray]:
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
            yield from _arrays(getattr(value, field.name))
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from _arrays(part)
    elif isinstance(value, list | tuple):
        for part in value:
            yield from _arrays(part)
    else:
        pytest.fail(f"{type(value).__name__} is not plain data: {value!r}")


def same(a: Any, b: Any) -> bool:
    """Whether two states hold bit for bit the same."""
    return bool(pickle.dumps(_plain(a)) == pickle.dumps(_plain(b)))


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return (str(value.dtype), value.shape, value.tobytes())
    if isinstance(value, np.number):
        return (str(value.dtype), value.tobytes())
    if is_dataclass(value) and not isinstance(value, type):
        # Durations by the wall clock are nobody's promise.
        hidden = {"seconds"} if isinstance(value, State) else set()
        names = [f.name for f in fields(value) if f.name not in hidden]
        named = [(name, _plain(getattr(value, name))) for name in names]
        return repr((type(value).__name__, named))
    if isinstance(value, Mapping):
        return repr([(key, _plain(part)) for key, part in value.items()])
    if isinstance(value, list | tuple):
        return repr([_plain(part) for part in value])
    return repr(value)


def moved(entry: Entry, changes: Mapping[str, Value] | None = None, steps: int = 30) -> World:
    """A world after its solver and some steps."""
    world = World(entry, changes, seed=1)
    while world.solving:
        world.iterate()
    if entry.lab.has_world():
        for _ in range(steps):
            world.advance()
    return world


# What a lab says of itself --------------------------------------------------------------------


@every_lab
def test_a_lab_introduces_itself(entry: Entry) -> None:
    lab = entry.lab
    assert lab.title.strip() == lab.title != ""
    assert lab.section.split(".")[0] == entry.chapter, "its section lies in its chapter"
    assert lab.summary.endswith(".")
    assert entry.article.strip()
    assert lab.period > 0.0
    assert entry.slug == entry.slug.lower()


@every_lab
def test_every_parameter_is_documented(entry: Entry) -> None:
    assert entry.lab.Params.model_config["frozen"]
    for name, tunable in entry.lab.Params.tunables.items():
        assert tunable.help.endswith("."), f"{name}: help is a sentence"
        assert tunable.label.strip(), f"{name} has a label"
        if tunable.symbol:
            tex(tunable.symbol)
        match tunable:
            case Knob():
                assert tunable.symbol, f"{name}: a knob has a symbol"
                assert tunable.low < tunable.high, name
                assert tunable.step >= 0.0, name
                assert tunable.scale == "linear" or tunable.low >= 0.0, name
            case Choice():
                assert len(tunable.options) >= 2, f"{name} leaves a choice"
                assert all(text.strip() for text in tunable.options.values()), name
            case _:
                assert isinstance(tunable, Text | Toggle)
    labels = [(t.group, t.label) for t in entry.lab.Params.tunables.values()]
    assert len(labels) == len(set(labels)), "no two sliders of a group look alike"


@every_lab
def test_defaults_are_valid(entry: Entry) -> None:
    defaults = entry.lab.Params()
    assert defaults.change(defaults.model_dump()) == defaults


@every_lab
def test_parameters_survive_as_text(entry: Entry) -> None:
    """A link and a command line hold every extreme value exactly."""
    params = entry.lab.Params
    for name, value in extremes(entry):
        text = str(value).lower() if isinstance(value, bool) else str(value)
        read = params.read({name: text})
        assert getattr(params().change(read), name) == value


@pytest.mark.parametrize(("entry", "changes"), SETTINGS)
def test_presets_and_experiments_run(entry: Entry, changes: dict[str, Value]) -> None:
    world = run(entry.slug, changes, seconds=SECONDS)
    assert {name: getattr(world.params, name) for name in changes} == changes
    check(world)


@every_lab
def test_names_do_not_collide(entry: Entry) -> None:
    lab = entry.lab
    assert len({action.name for action in lab.actions}) == len(lab.actions)
    for action in lab.actions:
        assert action.label
        assert action.help.endswith(".")
    groups = {tunable.group for tunable in lab.Params.tunables.values()}
    assert {action.group for action in lab.actions} <= groups | {""}
    titles = [plot.title for plot in lab.plots if not isinstance(plot, Readout)]
    assert len(titles) == len(set(titles))
    # These are keys beside the channels in exports, commands and on the command line.
    reserved = {"t", "lab", "seed", "trouble", "about"}
    assert not reserved & set(moved(entry).recorder.columns[1:])
    assert not {"press", "hold", "iterate", "show"} & set(lab.Params.tunables)


# The solver -----------------------------------------------------------------------------------

solvers = pytest.mark.parametrize(
    "entry", [e for e in ENTRIES if e.lab.has_solver()], ids=lambda entry: entry.slug
)
LOOKED_AT = 12
"""Iterations of a solver that are looked at."""


def iterated(entry: Entry) -> tuple[World, list[State]]:
    """A world after some iterations, and the state after each."""
    world = World(entry)
    states: list[State] = []
    while world.solving and len(states) < LOOKED_AT:
        world.iterate()
        states.append(copy.deepcopy(replace(world.state, seconds={})))
    return world, states


@solvers
def test_looking_back_shows_what_was(entry: Entry) -> None:
    """A snapshot is complete: accepted again, and after later ones, it gives the same state."""
    world, states = iterated(entry)
    for i in (*reversed(range(len(states))), 0, len(states) - 1):
        for _ in range(2):
            world.show(world.kept.iterations[i])
            assert same(replace(world.state, seconds={}), states[i]), f"iteration {i + 1}"


@solvers
def test_a_solver_counts_its_iterations_and_says_why_it_ends(entry: Entry) -> None:
    world, states = iterated(entry)
    assert world.kept.iterations == list(range(1, len(states) + 1))
    last = world.latest
    assert last is not None
    assert bool(last.done) == (not world.solving)
    assert last.progress is None or 0.0 <= last.progress <= 1.0


@solvers
def test_a_snapshot_is_plain_deterministic_and_never_written_into(entry: Entry) -> None:
    """Its durations stand under "seconds" alone; all else is the same each time."""
    world, _ = iterated(entry)
    before = [copy.deepcopy(_lasting(world.kept.at(i))) for i in world.kept.iterations]
    for _ in range(20 if entry.lab.has_world() else 0):
        world.advance()
    again, _ = iterated(entry)
    for i, was in zip(world.kept.iterations, before, strict=True):
        assert all(np.isfinite(a).all() for a in _arrays(was)), "a snapshot is finite"
        assert same(_lasting(world.kept.at(i)), was)
        assert same(_lasting(again.kept.at(i)), was)
        assert not {"about", "file"} & {name for name, _ in leaves(was)}, "names of the files"


@solvers
@pytest.mark.parametrize("form", ["json", "npz"])
def test_a_solution_is_saved_and_taken_up_again(entry: Entry, form: str) -> None:
    world, _ = iterated(entry)
    world = World(entry, solution=Solution.read(world.solution().write(form)))
    found, _ = iterated(entry)
    assert same(replace(world.state, seconds={}), replace(found.state, seconds={}))
    check(world)
    assert world.latest is not None
    assert found.latest is not None
    assert world.latest.iteration == found.latest.iteration
    if world.solving:
        world.iterate()
        check(world)


def _lasting(snapshot: Snapshot | None) -> dict[str, Any]:
    assert snapshot is not None
    return {name: value for name, value in snapshot.data.items() if name != "seconds"}


# Plots ----------------------------------------------------------------------------------------


@every_lab
def test_plots_name_real_channels(entry: Entry) -> None:
    lab = entry.lab
    world = moved(entry)
    measured = lab.measure(world.params, world.state)
    pictured = lab.fields(world.params, world.state)
    noted = lab.notes(world.params, world.state)
    assert not set(noted) & set(pictured)
    for plot in lab.plots:
        known = noted if isinstance(plot, Note) else pictured
        assert set(plots.pictured(plot)) <= set(known), plot
        match plot:
            case TimeSeries(unit=unit, lines=lines, select=select):
                assert lines, plot
                sizes = {np.shape(measured.get(line.channel, 0.0)) for line in lines}
                assert all(len(shape) <= 1 for shape in sizes), plot
                vectors = {shape for shape in sizes if shape}
                assert len(vectors) <= 1, f"{plot}: its vectors have one size"
                assert bool(select) == bool(vectors), f"{plot}: vectors and only they are selected"
                for line in lines:
                    tex(line.symbol)
                assert unit == unit.strip()
            case Curves(traces=traces, log_x=log_x, log_y=log_y, equal=equal):
                for trace in traces:
                    x, y = np.asarray(pictured[trace.x]), np.asarray(pictured[trace.y])
                    assert x.ndim == 1 or x.shape == y.shape, trace
                    assert y.ndim in (1, 2), trace
                    assert len(x) == len(y), trace
                    assert 0 <= trace.series <= 8, trace
                    assert trace.label or not trace.note, f"{trace}: a note stands by a label"
                    if isinstance(trace.label, tuple):
                        assert y.shape[1:] == (len(trace.label),), trace
                    elif y.ndim == 2:
                        assert "{}" in trace.label or not trace.label, trace
                    if trace.note:
                        assert len(pictured[trace.note]) in {0, *(y.shape[1:] or (1,))}, trace
                labels = [name for trace in traces for name in named(trace)]
                assert labels or len(traces) == 1, f"{plot}: a legend names what is drawn"
                assert len(labels) == len(set(labels)), plot
                assert not (equal and (log_x or log_y)), f"{plot}: one scale is linear"
            case HeatMap(x=x, y=y, z=z):
                assert np.shape(pictured[z]) == (len(pictured[y]), len(pictured[x]))
            case Matrix(field=name, symbol=symbol):
                assert np.ndim(pictured[name]) == 2
                tex(symbol)
            case Bars(field=name, symbol=symbol, limit=limit, marks=marks):
                assert np.ndim(pictured[name]) == 1
                if limit:
                    assert np.shape(pictured[limit]) == np.shape(pictured[name])
                if marks:
                    assert np.shape(pictured[marks]) in {np.shape(pictured[name]), (0,)}
                tex(symbol)
            case Readout(channel=channel, label=label):
                assert label
                assert np.ndim(measured.get(channel, 0.0)) == 0, "a read-out is one number"


def named(trace: Trace) -> tuple[str, ...]:
    """The labels of a trace in the legend."""
    labels = trace.label if isinstance(trace.label, tuple) else (trace.label,)
    return tuple(filter(None, labels))


@every_lab
def test_every_channel_is_measured_somewhere(entry: Entry) -> None:
    """A misspelt one would never show a value, whatever is set."""
    wanted = {name for plot in entry.lab.plots for name in plots.measured(plot)}
    found: set[str] = set()
    for changes in ({}, *(values for _, values in settings(entry))):
        if wanted <= found:
            break
        world = run(entry.slug, changes, seconds=5.0)
        channels = world.recording().channels
        found |= {name for name in wanted if np.isfinite(channels[name]).any()}
    assert wanted <= found


@every_lab
def test_channels_keep_their_shape_and_stay_finite(entry: Entry) -> None:
    world = World(entry)
    lab = entry.lab
    optional = {name for plot in lab.plots for name in plots.measured(plot)}
    first = lab.measure(world.params, world.state)
    shapes = {name: np.shape(value) for name, value in first.items()}
    for _ in range(round(3.0 / lab.period) if lab.has_world() else 1):
        world.advance()
        now = lab.measure(world.params, world.state)
        assert set(shapes) - optional <= set(now) <= set(shapes) | optional
        for name, value in now.items():
            assert np.shape(value) == shapes.get(name, ())
            assert np.isfinite(value).all(), name


# Extremes -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("entry", "name", "value"), EXTREMES)
def test_every_end_of_every_slider_runs(entry: Entry, name: str, value: Value) -> None:
    world = run(entry.slug, {name: value}, seconds=SECONDS)
    check(world)
    if not world.trouble and entry.lab.has_world():
        assert world.t == pytest.approx(SECONDS, abs=entry.lab.period / 2)


@every_lab
def test_every_tunable_can_change_in_mid_run(entry: Entry) -> None:
    """Each goes to its extremes and back while the others stand still, and the world lives on."""
    world = moved(entry, steps=5)
    for name, value in extremes(entry):
        world.change({name: value})
        while world.solving:
            world.iterate()
        for _ in range(3 if entry.lab.has_world() else 0):
            world.advance()
        assert getattr(world.params, name) == value
        check(world)
        world.change({name: getattr(entry.lab.Params(), name)})
        if world.trouble:
            world.reset()
        world.advance() if entry.lab.has_world() else None
        check(world)


@every_lab
def test_random_corners_run(entry: Entry) -> None:
    """All tunables at an extreme at once, twenty times at random."""
    options: dict[str, list[Value]] = {}
    for name, value in extremes(entry):
        options.setdefault(name, []).append(value)
    rng = np.random.default_rng(0)
    for _ in range(20):
        changes = {name: values[rng.integers(len(values))] for name, values in options.items()}
        check(run(entry.slug, changes, seconds=0.5))


@every_lab
def test_actions_and_handles_act(entry: Entry) -> None:
    world = moved(entry, steps=3)
    scene = CheckingHandles()
    entry.lab.draw(scene, world.params, world.state)
    for action in entry.lab.actions:
        world.press(action.name)
        world.advance()
        check(world)
    for name, (x, y, z) in scene.handles.items():
        for offset in (0.1, 1000.0):  # a drag, and one that leaves the screen
            while world.solving:  # a solver on its way cannot be copied
                world.iterate()
            untouched = copy.deepcopy(world)
            world.hold(name, (x + offset, y, z))
            for _ in range(5):
                world.advance()
                untouched.advance()
            check(world)
            assert not same(world.state, untouched.state), f"{name} moves something"
            world.hold(name, None)
            world.advance()
            check(world)


class CheckingHandles(CheckingScene):
    """Remembers where the handles are."""

    def __init__(self) -> None:
        super().__init__()
        self.handles: dict[str, tuple[float, float, float]] = {}

    def handle(self, name: str, position: ArrayLike, radius: float = 0.05) -> None:
        super().handle(name, position, radius)
        x, y, z = map(float, _point(position))
        self.handles[name] = (x, y, z)


# Determinism and plain data -------------------------------------------------------------------


def _eventful(entry: Entry) -> list[Event]:
    """Every action pressed, and every live knob moved, one after the other."""
    events = [Event(5 + i, "press", action.name) for i, action in enumerate(entry.lab.actions)]
    for i, (name, tunable) in enumerate(entry.lab.Params.tunables.items()):
        if isinstance(tunable, Knob) and tunable.effect == "live":
            events.append(Event(10 + 2 * i, "set", name, tunable.at(0.4)))
    return events if entry.lab.has_world() else []


def _noisy(entry: Entry) -> dict[str, Value]:
    """Noise on, where a lab has any."""
    changes: dict[str, Value] = {}
    for name, tunable in entry.lab.Params.tunables.items():
        if name.startswith("nois"):
            changes[name] = tunable.high if isinstance(tunable, Knob) else True
    return changes


@every_lab
def test_the_same_seed_and_events_give_the_same_run(entry: Entry) -> None:
    a, b = (
        run(entry.slug, _noisy(entry), seconds=SECONDS, seed=3, events=_eventful(entry))
        for _ in range(2)
    )
    assert a.recording().rows.tobytes() == b.recording().rows.tobytes()
    assert same(a.state, b.state)


@pytest.mark.parametrize("entry", [e for e in ENTRIES if _noisy(e)], ids=lambda entry: entry.slug)
def test_another_seed_gives_another_run_where_there_is_noise(entry: Entry) -> None:
    a, b = (run(entry.slug, _noisy(entry), seconds=SECONDS, seed=seed) for seed in (3, 4))
    assert a.recording().rows.tobytes() != b.recording().rows.tobytes()


@every_lab
def test_runs_do_not_disturb_each_other(entry: Entry) -> None:
    """Two worlds of one lab, stepped in turns, go as each alone: no state hides in the lab."""
    alone = moved(entry, _noisy(entry), steps=40)
    one, other = World(entry, _noisy(entry), seed=1), World(entry, seed=2)
    for world in (one, other):
        while world.solving:
            world.iterate()
    for _ in range(40 if entry.lab.has_world() else 0):
        other.advance()
        one.advance()
        other.lab.fields(other.params, other.state)
    assert same(one.state, alone.state)


@every_lab
def test_a_copied_state_continues_the_same(entry: Entry) -> None:
    world = moved(entry, _noisy(entry))
    copies = [copy.deepcopy(world.state), pickle.loads(pickle.dumps(world.state))]  # noqa: S301
    ends = []
    for state in (world.state, *copies):
        for _ in range(20 if entry.lab.has_world() else 0):
            state = world.lab.step(world.params, Inputs(), state)
        ends.append(state)
    assert all(same(end, ends[0]) for end in ends[1:])


@every_lab
def test_a_step_leaves_the_old_state_alone(entry: Entry) -> None:
    world = moved(entry, _noisy(entry))
    lab, params, old = world.lab, world.params, world.state
    before = copy.deepcopy(old)
    if lab.has_world():
        new = lab.step(params, Inputs(tuple(a.name for a in lab.actions)), old)
        assert new is not old
        assert new.t == pytest.approx(old.t + lab.period)
    lab.measure(params, old)
    lab.fields(params, old)
    lab.draw(CheckingScene(), params, old)
    assert same(old, before)


@pytest.mark.parametrize(
    "entry", [e for e in ENTRIES if e.lab.has_solver()], ids=lambda entry: entry.slug
)
def test_a_solver_ends_with_a_reason_and_accepting_leaves_the_old_state_alone(
    entry: Entry,
) -> None:
    lab, world = entry.lab, World(entry)
    snapshots: list[Snapshot] = []
    for snapshot in filter(None, lab.solve(world.params, world.state)):
        snapshots.append(snapshot)
        before = copy.deepcopy(world.state)
        after = lab.accept(world.params, world.state, snapshot)
        assert same(world.state, before)
        world.state = after
    assert [s.iteration for s in snapshots] == list(range(1, len(snapshots) + 1))
    assert [bool(s.done) for s in snapshots] == [False] * (len(snapshots) - 1) + [True]


@every_lab
def test_a_world_in_trouble_stays_where_it_was(entry: Entry) -> None:
    world = moved(entry)
    world.state = copy.deepcopy(world.state)
    world.state.trouble = "It went wrong: change something."
    before, t = copy.deepcopy(world.state), world.t
    world.advance()
    assert same(world.state, before)
    assert world.t == t


# The checks themselves ------------------------------------------------------------------------


def test_states_that_differ_in_one_bit_differ() -> None:
    one, other = State(t=1.0), State(t=float(np.nextafter(1.0, 2.0)))
    assert same(one, State(t=1.0))
    assert not same(one, other)
    assert not same({"a": np.zeros(3)}, {"a": np.array([0.0, 0.0, -0.0])})


@pytest.mark.parametrize("bad", [object(), {1: [object()]}, np.array([object()])])
def test_what_is_not_plain_data_is_refused(bad: object) -> None:
    with pytest.raises((pytest.fail.Exception, AssertionError)):
        list(_arrays(bad))


def test_the_suite_sees_shipped_and_sample_labs() -> None:
    slugs = [entry.slug for entry in ENTRIES]
    assert {"joint-control", "oscillator", "troublesome"} <= set(slugs)
    assert all(issubclass(entry.lab.Params, Params) for entry in ENTRIES)
