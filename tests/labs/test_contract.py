"""The contract of a lab (labs/lab.py), asked of every lab in the catalogue."""

import contextlib
import copy
import functools
import pickle
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from itertools import chain, combinations
from typing import Any

import numpy as np
import pytest

from labs import plots
from labs.engine.catalog import CatalogEntry
from labs.engine.events import Event
from labs.engine.headless import run_headless
from labs.engine.run import World
from labs.engine.snapshots import flatten
from labs.engine.solution import FILE_FORMATS, Solution
from labs.errors import ParameterError
from labs.lab import Action, Inputs, Snapshot, State
from labs.params import Choice, Knob, Params, Text, Toggle, Value
from labs.plots import Bars, Curves, HeatMap, Matrix, Note, Readout, TimeSeries, Trace
from server.articles import render
from server.formulas import tex_to_mathml
from tests.labs.contract import (
    CHECKED_ITERATIONS,
    ENTRIES,
    CheckingScene,
    InteractionScene,
    Point,
    advance,
    advanced_world,
    annotate_failure,
    arrays_of,
    bitwise_equal,
    check_world,
    extreme_values,
    iterate,
    plotted_values,
    record_drawing,
    settings,
    started_world,
    variants,
)
from tests.labs.solve_cache import sharing_disabled

SECONDS = 1.0
"""Simulated for each preset and each experiment."""
BRIEF_SECONDS = 0.24
"""Simulated for each end of each knob, each option, and each corner."""
BRIEF_ITERATIONS = 2
"""Iterations of a solver for each of these, from its guess and from what it found; the presets and
experiments are solved to the end."""
CORNER_ITERATIONS = CHECKED_ITERATIONS
"""Iterations for each corner."""
CORNER_COUNTS = {True: 4, False: 20}
"""All tunables at an extreme at once, so many times; fewer for labs with a solver."""
SETTINGS_OF_A_HANDLE = 3
"""In as many of those that offer it, each is dragged."""
INERT = {
    "kinematics", "dynamics", "integration", "bandits", "function-approximation",
    "descent", "troublesome",
}  # fmt: skip
"""Labs with nothing to press nor to drag."""

SETTINGS = [
    pytest.param(entry, dict(values), id=f"{entry.slug}: {name}")
    for entry in ENTRIES
    for name, values in settings(entry)
]
every_lab = pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.slug)


# What a lab says of itself --------------------------------------------------------------------


@every_lab
def test_a_lab_introduces_itself(entry: CatalogEntry) -> None:
    lab = entry.lab
    assert lab.title.strip() == lab.title != ""
    chapter = lab.section.split(".")[0]
    appendices = chapter.isalpha() and entry.chapter.isalpha()
    assert chapter == entry.chapter or appendices, "its section lies in its chapter"
    assert lab.summary.endswith(".")
    assert entry.article.strip()
    assert lab.period > 0.0
    assert entry.slug == entry.slug.lower()


@every_lab
def test_every_parameter_is_documented(entry: CatalogEntry) -> None:
    assert entry.lab.Params.model_config["frozen"]
    for name, tunable in entry.lab.Params.tunables.items():
        assert tunable.help.endswith("."), f"{name}: help is a sentence"
        assert tunable.label.strip(), f"{name} has a label"
        if tunable.symbol:
            tex_to_mathml(tunable.symbol)
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
def test_what_is_said_not_to_act_changes_nothing(entry: CatalogEntry) -> None:
    """At the defaults, and under options of each choice that others depend on, as many as it takes
    to see all that idles: it has another value, beside a twin where it has its default."""
    governors = {
        governor
        for tunable in entry.lab.Params.tunables.values()
        for choices in tunable.when
        for governor in choices
    }
    tried = [{}, *({name: value} for name, value in extreme_values(entry) if name in governors)]
    known: list[set[str]] = [set()]
    for changes in tried:
        params = entry.lab.Params().change(changes)
        idle = {name: other(entry, name) for name in params.tunables if not params.acts(name)}
        if set(idle) not in known:
            known.append(set(idle))
            with annotate_failure((changes, idle)):
                twin, world = (World(entry, {**more, **changes}) for more in ({}, idle))
                for each in (twin, world):
                    iterate(each, 3)
                    advance(each, 5)
                    each.state = replace(each.state, seconds={})
                assert plotted_values(world) == plotted_values(twin)
                assert record_drawing(world) == record_drawing(twin)


def other(entry: CatalogEntry, name: str) -> Value:
    """Some value that is not the default."""
    default = getattr(entry.lab.Params(), name)
    ready = [dict(values)[name] for _, values in settings(entry) if name in values]
    values = [value for tried, value in extreme_values(entry) if tried == name]
    return next((value for value in values + ready if value != default), default)


@every_lab
def test_defaults_are_valid(entry: CatalogEntry) -> None:
    defaults = entry.lab.Params()
    assert defaults.change(defaults.model_dump()) == defaults


@every_lab
def test_settings_that_go_with_a_choice_are_valid(entry: CatalogEntry) -> None:
    defaults = entry.lab.Params()
    for name, by_value in entry.lab.choice_settings.items():
        assert defaults.tunables[name].effect == "restart", "or a run could not be reproduced"
        for value, more in by_value.items():
            assert name not in more
            defaults.change({name: value, **more})


@every_lab
def test_parameters_survive_as_text(entry: CatalogEntry) -> None:
    """A link and a command line hold every extreme value exactly."""
    params = entry.lab.Params
    for name, value in extreme_values(entry):
        text = str(value).lower() if isinstance(value, bool) else str(value)
        read = params.read({name: text})
        assert getattr(params().change(read), name) == value


@pytest.mark.parametrize(("entry", "changes"), SETTINGS)
def test_presets_and_experiments_run(entry: CatalogEntry, changes: dict[str, Value]) -> None:
    world = run_headless(entry.slug, changes, seconds=SECONDS)
    assert {name: getattr(world.params, name) for name in changes} == changes
    check_world(world)


@every_lab
def test_an_experiment_predicts_what_is_measured_and_compares_with_what_runs(
    entry: CatalogEntry,
) -> None:
    for experiment in render(entry).experiments:
        with annotate_failure(experiment.title):
            world = World(entry, experiment.settings)
            channel = getattr(experiment.predict, "channel", "")
            assert not channel or channel in world.recorder.columns
            other = World(entry, {**experiment.settings, **experiment.compare})
            other.advance()
            assert not other.trouble


@every_lab
def test_names_do_not_collide(entry: CatalogEntry) -> None:
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
    reserved = {"t", "lab", "seed", "trouble", "solver", "about"}
    assert not reserved & set(advanced_world(entry).recorder.columns[1:])
    assert not {"press", "hold", "iterate", "show"} & set(lab.Params.tunables)


# The solver -----------------------------------------------------------------------------------

solvers = pytest.mark.parametrize(
    "entry", [e for e in ENTRIES if e.lab.has_solver()], ids=lambda entry: entry.slug
)


def iterated(entry: CatalogEntry) -> tuple[World, list[State]]:
    """A world after some iterations, and the state after each."""
    world = World(entry)
    states: list[State] = []
    while world.solving and len(states) < CHECKED_ITERATIONS:
        world.iterate()
        states.append(copy.deepcopy(replace(world.state, seconds={})))
    return world, states


@solvers
def test_looking_back_shows_what_was(entry: CatalogEntry) -> None:
    """A snapshot is complete: accepted again, and after later ones, it gives the same state."""
    world, states = iterated(entry)
    for i in (*reversed(range(len(states))), 0, len(states) - 1):
        for _ in range(2):
            world.show(world.snapshots.iterations[i])
            assert bitwise_equal(replace(world.state, seconds={}), states[i]), f"iteration {i + 1}"


@solvers
def test_a_solver_counts_its_iterations_and_says_why_it_ends(entry: CatalogEntry) -> None:
    world, states = iterated(entry)
    assert world.snapshots.iterations == list(range(1, len(states) + 1))
    last = world.latest
    assert last is not None
    assert bool(last.done) == (not world.solving)
    assert last.progress is None or 0.0 <= last.progress <= 1.0


@solvers
def test_a_snapshot_is_plain_deterministic_and_never_written_into(entry: CatalogEntry) -> None:
    """Its durations stand under "seconds" alone; all else is the same each time."""
    world, _ = iterated(entry)
    before = [
        copy.deepcopy(_without_durations(world.snapshots.at(i))) for i in world.snapshots.iterations
    ]
    advance(world, 20)
    with sharing_disabled():
        again, _ = iterated(entry)
    for i, was in zip(world.snapshots.iterations, before, strict=True):
        assert all(np.isfinite(a).all() for a in arrays_of(was)), "a snapshot is finite"
        assert bitwise_equal(_without_durations(world.snapshots.at(i)), was)
        assert bitwise_equal(_without_durations(again.snapshots.at(i)), was)
        assert not {"about", "file"} & {name for name, _ in flatten(was)}, "names of the files"


@solvers
def test_a_solution_is_saved_and_taken_up_again(entry: CatalogEntry) -> None:
    for form in FILE_FORMATS:
        found, _ = iterated(entry)
        world = World(entry, solution=Solution.read(found.solution().write(form)))
        with annotate_failure(form):
            assert bitwise_equal(replace(world.state, seconds={}), replace(found.state, seconds={}))
            check_world(world)
            assert world.latest is not None
            assert found.latest is not None
            assert world.latest.iteration == found.latest.iteration
            if world.solving:
                world.iterate()
                check_world(world)


def _without_durations(snapshot: Snapshot | None) -> dict[str, Any]:
    assert snapshot is not None
    return {name: value for name, value in snapshot.data.items() if name != "seconds"}


# Plots ----------------------------------------------------------------------------------------


@every_lab
def test_plots_name_real_channels(entry: CatalogEntry) -> None:
    """Of every plot where it is shown."""
    unseen = set(range(len(entry.lab.plots)))
    for world in chain(
        [advanced_world(entry)], (World(entry, changes) for changes in variants(entry))
    ):
        if not unseen:
            return
        params = world.params.model_dump()
        shown = {i for i in unseen if plots.is_shown(entry.lab.plots[i], params)}
        check_plots(world, [entry.lab.plots[i] for i in shown])
        unseen -= shown
    assert not unseen, [entry.lab.plots[i] for i in unseen]


def check_plots(world: World, shown: list[plots.Plot]) -> None:
    """What they show is there, and of their shapes."""
    lab = world.lab
    measured = lab.measure(world.params, world.state)
    pictured = lab.fields(world.params, world.state)
    noted = lab.notes(world.params, world.state)
    said = lab.labels(world.params)
    assert len({*noted, *pictured, *said}) == len(noted) + len(pictured) + len(said)
    for plot in shown:
        known = noted if isinstance(plot, Note) else pictured
        assert set(plots.field_names(plot)) - optional_fields(plot) <= set(known), plot
        assert set(plots.label_names(plot)) <= {*said, getattr(plot, "select", "")}, plot
        for governor, values in getattr(plot, "when", {}).items():
            tunable = lab.Params.tunables[governor]
            assert isinstance(tunable, Choice), plot
            assert set(values) < set(tunable.options), f"{plot}: some of its options"
        match plot:
            case TimeSeries(unit=unit, lines=lines, select=select):
                assert lines, plot
                sizes = {np.shape(measured.get(line.channel, 0.0)) for line in lines}
                assert all(len(shape) <= 1 for shape in sizes), plot
                vectors = {shape for shape in sizes if shape}
                assert len(vectors) <= 1, f"{plot}: its vectors have one size"
                assert bool(select) == bool(vectors), f"{plot}: vectors and only they are selected"
                for line in lines:
                    tex_to_mathml(line.symbol)
                assert unit == unit.strip()
            case Curves(traces=traces, log_x=log_x, log_y=log_y, equal=equal):
                there = [t for t in traces if not t.optional or {t.x, t.y} & set(known)]
                for trace in there:
                    x, y = np.asarray(pictured[trace.x]), np.asarray(pictured[trace.y])
                    assert x.ndim == 1 or x.shape == y.shape, trace
                    assert y.ndim in (1, 2), trace
                    assert len(x) == len(y), trace
                    assert 0 <= trace.series <= 8, trace
                    assert trace.label or not trace.note, f"{trace}: a note stands by a label"
                    if isinstance(trace.label, tuple):
                        assert y.shape[1:] == (len(trace.label),), trace
                    elif y.ndim == 2:
                        assert "{" in trace.label or not trace.label, trace
                    if trace.note:
                        assert len(pictured[trace.note]) in {0, *(y.shape[1:] or (1,))}, trace
                labels = [name for trace in traces for name in trace_labels(trace)]
                assert labels or len(traces) == 1, f"{plot}: a legend names what is drawn"
                assert len(labels) == len(set(labels)), plot
                pairs = combinations((t for t in there if t.label), 2)
                assert not [
                    p for p in pairs if set.intersection(*(curve_style(t, pictured) for t in p))
                ]
                assert not (equal and (log_x or log_y)), f"{plot}: one scale is linear"
            case HeatMap(x=x, y=y, z=z, arrows=arrows):
                assert np.shape(pictured[z]) == (len(pictured[y]), len(pictured[x]))
                if arrows:
                    ways = np.asarray(pictured[arrows])
                    assert ways.shape == (len(ways), 4), plot
                    assert np.linalg.norm(ways[:, 2:], axis=1).max(initial=0.0) <= 1.0 + 1e-9
            case Matrix(field=name, symbol=symbol):
                assert np.ndim(pictured[name]) == 2
                tex_to_mathml(symbol)
            case Bars(field=name, symbol=symbol, limit=limit, marks=marks):
                assert np.ndim(pictured[name]) == 1
                if limit:
                    assert np.shape(pictured[limit]) == np.shape(pictured[name])
                if marks:
                    assert np.shape(pictured[marks]) in {np.shape(pictured[name]), (0,)}
                tex_to_mathml(symbol)
            case Readout(channel=channel, label=label):
                assert label
                assert np.ndim(measured.get(channel, 0.0)) == 0, "a read-out is one number"


def optional_fields(plot: plots.Plot) -> set[str]:
    """Those a lab may leave out."""
    traces = plot.traces if isinstance(plot, Curves) else ()
    return {name for trace in traces if trace.optional for name in (trace.x, trace.y)}


def curve_style(trace: Trace, pictured: Mapping[str, np.ndarray]) -> set[tuple[str, int]]:
    """What tells its curves from others': style and colour, 0 for ink."""
    y = np.asarray(pictured[trace.y])
    curves = y.shape[1] if y.ndim == 2 else 1
    series = [(trace.series - 1 + k) % 8 + 1 if trace.series else 0 for k in range(curves)]
    return {(trace.style, k) for k in series}


@every_lab
def test_labels_fit_what_they_name_whatever_is_chosen(entry: CatalogEntry) -> None:
    """As many names as components, bars and rows, and one unit for each; never two systems'."""
    lab = entry.lab
    for changes in variants(entry):
        world = World(entry, changes)
        said = lab.labels(world.params)
        counts = {name: len(said[name]) for name in said if not isinstance(said[name], str)}
        measured = lab.measure(world.params, world.state)
        pictured = lab.fields(world.params, world.state)
        for plot in (p for p in lab.plots if plots.is_shown(p, world.params.model_dump())):
            sizes: set[int] = set()
            if isinstance(plot, TimeSeries) and plot.select:
                shapes = [np.shape(measured[line.channel]) for line in plot.lines]
                sizes = {shape[0] for shape in shapes if shape}
            elif isinstance(plot, Bars | Matrix):
                sizes = {len(pictured[plot.field])}
            for name in plots.label_names(plot):
                if name in counts and not isinstance(plot, Curves):
                    assert sizes == {counts[name]}, (plot, changes)
        for words in said.values():
            for word in [words] if isinstance(words, str) else words:
                assert ";" not in word, (words, changes)
                assert word == word.strip(), (words, changes)


def trace_labels(trace: Trace) -> tuple[str, ...]:
    """The labels of a trace in the legend."""
    labels = trace.label if isinstance(trace.label, tuple) else (trace.label,)
    return tuple(filter(None, labels))


@every_lab
def test_every_channel_is_measured_somewhere(entry: CatalogEntry) -> None:
    """A misspelt one would never show a value, whatever is set."""
    wanted = {name for plot in entry.lab.plots for name in plots.channel_names(plot)}
    optional = {name for plot in entry.lab.plots for name in optional_fields(plot)}
    wanted |= optional
    found: set[str] = set()
    for changes in ({}, *(values for _, values in settings(entry))):
        if wanted <= found:
            break
        world = run_headless(entry.slug, changes, seconds=5.0)
        channels = world.recording().channels
        found |= {name for name in wanted - optional if np.isfinite(channels[name]).any()}
        found |= optional & set(entry.lab.fields(world.params, world.state))
    assert wanted <= found


@every_lab
def test_channels_keep_their_shape_and_stay_finite(entry: CatalogEntry) -> None:
    world = World(entry)
    lab = entry.lab
    optional = {name for plot in lab.plots for name in plots.channel_names(plot)}
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


def brief(
    entry: CatalogEntry, changes: Mapping[str, Value], iterations: int = BRIEF_ITERATIONS
) -> World:
    """A short run that the solver has only begun."""
    events = [Event(0, "solve", "iterate", iterations)] if entry.lab.has_solver() else []
    return run_headless(entry.slug, changes, seconds=BRIEF_SECONDS, events=events)


@every_lab
def test_every_tunable_starts_at_one_extreme_and_changes_to_the_others(entry: CatalogEntry) -> None:
    """Each that acts by default, while the others stand still: a run that begins at one of its
    extremes, now the first and now the last, goes on through the others to its default."""
    lab = entry.lab
    acting = {
        name: values for name, values in tunable_extremes(entry).items() if lab.Params().acts(name)
    }
    for i, (name, values) in enumerate(acting.items()):
        first, *others = values if i % 2 else values[::-1]
        with annotate_failure({name: first}):
            world = brief(entry, {name: first})
            check_world(world)
            if not world.trouble and lab.has_world():
                assert world.t == pytest.approx(BRIEF_SECONDS, abs=lab.period / 2)
        for value in (*others, getattr(lab.Params(), name)):
            with annotate_failure({name: value}):
                world.change({name: value})
                if world.trouble:
                    world.reset()
                iterate(world, BRIEF_ITERATIONS)
                advance(world, 3)
                assert getattr(world.params, name) == value
                check_world(world)


@every_lab
def test_what_acts_under_a_choice_runs_at_its_extremes_there(entry: CatalogEntry) -> None:
    """All that act under the same choices at once: first at one end, then through the others."""
    lab, options = entry.lab, tunable_extremes(entry)
    governed: dict[tuple[tuple[str, Value], ...], list[str]] = {}
    for name, tunable in lab.Params.tunables.items():
        if not lab.Params().acts(name):
            choices = tuple((governor, values[0]) for governor, values in tunable.when[0].items())
            governed.setdefault(choices, []).append(name)
    for choices, names in governed.items():
        world = World(entry, dict(choices))
        assert all(world.params.acts(name) for name in names), choices
        for i in range(max(len(options[name]) for name in names)):
            changes = {name: options[name][i % len(options[name])] for name in names}
            with annotate_failure((choices, changes)):
                world.change(changes)
                if world.trouble:
                    world.reset()
                iterate(world, BRIEF_ITERATIONS)
                advance(world, round(BRIEF_SECONDS / lab.period))
                check_world(world)


def tunable_extremes(entry: CatalogEntry) -> dict[str, list[Value]]:
    """The extremes of each tunable."""
    found: dict[str, list[Value]] = {}
    for name, value in extreme_values(entry):
        found.setdefault(name, []).append(value)
    return found


@every_lab
def test_random_corners_run(entry: CatalogEntry) -> None:
    """All tunables at an extreme at once."""
    options = tunable_extremes(entry)
    rng = np.random.default_rng(0)
    for _ in range(CORNER_COUNTS[entry.lab.has_solver()]):
        changes = {name: values[rng.integers(len(values))] for name, values in options.items()}
        with annotate_failure(changes):
            check_world(brief(entry, changes, CORNER_ITERATIONS))


# Actions and handles --------------------------------------------------------------------------


@functools.cache
def interaction_settings(entry: CatalogEntry) -> list[tuple[Mapping[str, Value], InteractionScene]]:
    """In which settings what can be dragged or clicked."""
    found = []
    for changes in variants(entry):
        with annotate_failure(changes):
            found.append((changes, InteractionScene(started_world(entry, changes, iterations=1))))
    return found


@every_lab
def test_handles_are_declared(entry: CatalogEntry) -> None:
    """Every one that is drawn in some setting, and no other."""
    drawn = set().union(*(offered.interactive_names for _, offered in interaction_settings(entry)))
    for name in drawn:
        entry.lab.check_handle(name)
    for handle in entry.lab.handles:
        assert drawn & set(handle.names), f"{handle} is drawn somewhere"
        assert handle.help.endswith(".")


@every_lab
def test_every_handle_that_is_drawn_acts(entry: CatalogEntry) -> None:
    """Dragged by a little and out of the picture both ways, beside a twin that is left alone; in
    the first settings that offer it."""
    tried: Counter[str] = Counter()
    for changes, offered in interaction_settings(entry):
        for name, (x, y, z) in offered.handles.items():
            tried[name] += 1
            if tried[name] > SETTINGS_OF_A_HANDLE:
                continue
            visible, twin = False, started_world(entry, changes, iterations=2)
            advance(twin, 5)
            for offset in (0.1, 1000.0, -1000.0):
                with annotate_failure((changes, name, offset)):
                    world = started_world(entry, changes, iterations=2)
                    world.hold(name, (x + offset, y + offset, z + offset))
                    advance(world, 5)
                    check_world(world)
                    assert world.params != twin.params or not bitwise_equal(world.state, twin.state)
                    visible |= world.params != twin.params or plotted_values(
                        world
                    ) != plotted_values(twin)
                    world.hold(name, None)
                    advance(world, 1)
                    check_world(world)
            assert visible, f"{name} moves something with {changes}"


@every_lab
def test_every_board_that_is_drawn_acts(entry: CatalogEntry) -> None:
    """A click in one of its cells changes a parameter, at the latest after others were clicked."""
    for changes, offered in interaction_settings(entry):
        if not offered.boards:
            continue
        world, acted = started_world(entry, changes), set()
        for name, cells in [*offered.boards.items(), *offered.boards.items()]:
            with annotate_failure((changes, name)):
                if name not in acted and any(
                    click_changes_params(world, name, cell) for cell in cells
                ):
                    acted.add(name)
                    check_world(world)
        assert acted == set(offered.boards), changes


def click_changes_params(world: World, board: str, cell: Point) -> bool:
    """Whether a click changes a parameter; one that is refused does not."""
    before = world.params
    with contextlib.suppress(ParameterError):
        world.hold(board, cell)
        world.hold(board, None)
    return bool(world.params != before)


@every_lab
def test_every_action_acts(entry: CatalogEntry) -> None:
    """In some setting, if need be after a drag, within some steps, beside a twin left alone."""
    for action in entry.lab.actions:
        assert any(
            action_has_effect(entry, changes, action, dragged)
            for changes in variants(entry)
            for dragged in (False, True)
        ), f"{action.name} changes something"


def action_has_effect(
    entry: CatalogEntry, changes: Mapping[str, Value], action: Action, dragged: bool
) -> bool:
    """Whether what is seen differs within half a second after it was pressed."""
    world, twin = started_world(entry, changes, 20), started_world(entry, changes, 20)
    for name, (x, y, z) in InteractionScene(twin).handles.items() if dragged else ():
        for each in (world, twin):
            each.hold(name, (x + 0.1, y + 0.1, z + 0.1))
            advance(each, 1)
            each.hold(name, None)
    world.press(action.name)
    for _ in range(50):
        advance(world, 1)
        advance(twin, 1)
        check_world(world)
        if plotted_values(world) != plotted_values(twin):
            return True
    return False


def test_nothing_can_be_done_only_where_it_is_said() -> None:
    inert = {entry.slug for entry in ENTRIES if not entry.lab.actions + entry.lab.handles}
    assert inert == INERT


# Determinism and plain data -------------------------------------------------------------------


def _all_events(entry: CatalogEntry) -> list[Event]:
    """Every action pressed, and every live knob moved, one after the other."""
    events = [Event(5 + i, "press", action.name) for i, action in enumerate(entry.lab.actions)]
    for i, (name, tunable) in enumerate(entry.lab.Params.tunables.items()):
        if isinstance(tunable, Knob) and tunable.effect == "live":
            events.append(Event(10 + 2 * i, "set", name, tunable.at(0.4)))
    return events if entry.lab.has_world() else []


def _with_noise(entry: CatalogEntry) -> dict[str, Value]:
    """Noise on, where a lab has any."""
    changes: dict[str, Value] = {}
    for name, tunable in entry.lab.Params.tunables.items():
        if name.startswith("nois"):
            changes[name] = tunable.high if isinstance(tunable, Knob) else True
    return changes


@every_lab
def test_the_same_seed_and_events_give_the_same_run(entry: CatalogEntry) -> None:
    a = run_headless(
        entry.slug, _with_noise(entry), seconds=SECONDS, seed=3, events=_all_events(entry)
    )
    with sharing_disabled():
        b = run_headless(
            entry.slug, _with_noise(entry), seconds=SECONDS, seed=3, events=_all_events(entry)
        )
    assert a.recording().rows.tobytes() == b.recording().rows.tobytes()
    assert bitwise_equal(a.state, b.state)


@pytest.mark.parametrize(
    "entry", [e for e in ENTRIES if _with_noise(e)], ids=lambda entry: entry.slug
)
def test_another_seed_gives_another_run_where_there_is_noise(entry: CatalogEntry) -> None:
    a, b = (
        run_headless(entry.slug, _with_noise(entry), seconds=SECONDS, seed=seed) for seed in (3, 4)
    )
    assert a.recording().rows.tobytes() != b.recording().rows.tobytes()


@every_lab
def test_runs_do_not_disturb_each_other(entry: CatalogEntry) -> None:
    """Two worlds of one lab, stepped in turns, go as each alone: no state hides in the lab."""
    alone = advanced_world(entry, _with_noise(entry), steps=40)
    with sharing_disabled():
        one, other = World(entry, _with_noise(entry), seed=1), World(entry, seed=2)
        for world in (one, other):
            while world.solving:
                world.iterate()
    for _ in range(40 if entry.lab.has_world() else 0):
        other.advance()
        one.advance()
        other.lab.fields(other.params, other.state)
    assert bitwise_equal(one.state, alone.state)


@every_lab
def test_a_copied_state_continues_the_same(entry: CatalogEntry) -> None:
    world = advanced_world(entry, _with_noise(entry))
    copies = [copy.deepcopy(world.state), pickle.loads(pickle.dumps(world.state))]  # noqa: S301
    ends = []
    for state in (world.state, *copies):
        for _ in range(20 if entry.lab.has_world() else 0):
            state = world.lab.step(world.params, Inputs(), state)
        ends.append(state)
    assert all(bitwise_equal(end, ends[0]) for end in ends[1:])


@every_lab
def test_a_step_leaves_the_old_state_alone(entry: CatalogEntry) -> None:
    world = advanced_world(entry, _with_noise(entry))
    lab, params, old = world.lab, world.params, world.state
    before = copy.deepcopy(old)
    if lab.has_world():
        new = lab.step(params, Inputs(tuple(a.name for a in lab.actions)), old)
        assert new is not old
        assert new.t == pytest.approx(old.t + lab.period)
    lab.measure(params, old)
    lab.fields(params, old)
    lab.draw(CheckingScene(), params, old)
    assert bitwise_equal(old, before)


@pytest.mark.parametrize(
    "entry", [e for e in ENTRIES if e.lab.has_solver()], ids=lambda entry: entry.slug
)
def test_a_solver_ends_with_a_reason_and_accepting_leaves_the_old_state_alone(
    entry: CatalogEntry,
) -> None:
    lab, world = entry.lab, World(entry)
    snapshots: list[Snapshot] = []
    for snapshot in filter(None, lab.solve(world.params, world.state)):
        snapshots.append(snapshot)
        before = copy.deepcopy(world.state)
        after = lab.accept(world.params, world.state, snapshot)
        assert bitwise_equal(world.state, before)
        world.state = after
    assert [s.iteration for s in snapshots] == list(range(1, len(snapshots) + 1))
    assert [bool(s.done) for s in snapshots] == [False] * (len(snapshots) - 1) + [True]


@every_lab
def test_a_world_in_trouble_stays_where_it_was(entry: CatalogEntry) -> None:
    world = advanced_world(entry)
    world.state = copy.deepcopy(world.state)
    world.state.trouble = "It went wrong: change something."
    before, t = copy.deepcopy(world.state), world.t
    world.advance()
    assert bitwise_equal(world.state, before)
    assert world.t == t


# The checks themselves ------------------------------------------------------------------------


def test_states_that_differ_in_one_bit_differ() -> None:
    one, other = State(t=1.0), State(t=float(np.nextafter(1.0, 2.0)))
    assert bitwise_equal(one, State(t=1.0))
    assert not bitwise_equal(one, other)
    assert not bitwise_equal({"a": np.zeros(3)}, {"a": np.array([0.0, 0.0, -0.0])})


@pytest.mark.parametrize("bad", [object(), {1: [object()]}, np.array([object()])])
def test_what_is_not_plain_data_is_refused(bad: object) -> None:
    with pytest.raises((pytest.fail.Exception, AssertionError)):
        list(arrays_of(bad))


def test_the_suite_sees_shipped_and_sample_labs() -> None:
    slugs = [entry.slug for entry in ENTRIES]
    assert {"joint-control", "oscillator", "troublesome"} <= set(slugs)
    assert all(issubclass(entry.lab.Params, Params) for entry in ENTRIES)
