"""Running a lab without a page: from given parameters, seed and events to the end."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from labs.engine.catalog import CatalogEntry, find_lab
from labs.engine.events import Event
from labs.engine.run import World
from labs.engine.solution import Solution
from labs.errors import ParameterError

MAX_STEPS = 2_000_000


def run_headless(
    slug: str,
    changes: Mapping[str, object] | None = None,
    *,
    seconds: float = 10.0,
    seed: int | None = None,
    events: Iterable[Event] = (),
    solution: Solution | None = None,
    progress: Callable[[float], None] | None = None,
) -> World:
    """Runs a lab headless to the end of `seconds`, or to trouble.

    `events` are applied before the step they name. A lab with a solver is solved to the end
    before time starts and after each change, unless `events` say how far. It starts from a
    `solution`, if given, with its parameters but for the `changes`, and its seed (else 0). A
    solution that is done is not solved further. `progress` hears the part of the steps done in
    [0, 1], again and again."""
    entry = find_lab(slug)
    period = entry.lab.period
    if not 0 <= seconds <= MAX_STEPS * period:
        raise ParameterError(
            f"seconds = {seconds}: takes a number from 0 to {MAX_STEPS * period:g}"
        )
    steps = round(seconds / period) if entry.lab.has_world() else 0
    todo = sorted(events, key=lambda event: event.step)
    if solution:
        solution = _override_params(entry, solution, changes or {}, seed)
    world = World(entry, changes, seed or 0, steps + 1, solution)
    iterations_given = any(event.name == "iterate" for event in todo if event.kind == "solve")

    def report_progress() -> None:
        if progress:
            progress(world.steps / max(steps, 1))

    for step in range(steps + 1):
        while todo and todo[0].step <= step:
            if todo[0].name == "show" and not iterations_given:
                _solve_to_end(world, report_progress)
            _apply_event(world, todo.pop(0))
        if not iterations_given:
            _solve_to_end(world, report_progress)
        if step == steps or world.trouble:
            break
        world.advance()
        if step % 100 == 0:
            report_progress()
    if todo:
        last = max(event.step for event in todo) * period
        if not world.trouble:
            raise ParameterError(f"a change at {last:g} s lies beyond the run's {seconds:g} s")
    return world


def _solve_to_end(world: World, report_progress: Callable[[], None]) -> None:
    """To the end, unless a loaded solution was there already; `report_progress` after every
    iteration."""
    while world.solving and not (world.latest and world.latest.done):
        world.iterate()
        report_progress()


def _override_params(
    entry: CatalogEntry, solution: Solution, changes: Mapping[str, object], seed: int | None
) -> Solution:
    """The solution with other parameters: where they are another problem, it is not done."""
    solution.check_lab(entry.slug)
    before = entry.lab.Params().change(solution.params)
    params = before.change(changes)
    other = {params.tunables[name].effect for name in params.changed_from(before)} - {"live"}
    return replace(
        solution,
        params=params.model_dump(),
        seed=solution.seed if seed is None else seed,
        done="" if other else solution.done,
    )


def _apply_event(world: World, event: Event) -> None:
    match event.kind:
        case "set":
            tunable = world.params.tunables.get(event.name)
            if event.step and tunable and tunable.effect == "restart":
                raise ParameterError(f"{event.name} restarts the run: give it with --set, not --at")
            world.change({event.name: event.value})
        case "press":
            world.press(event.name)
        case "hold":
            world.hold(event.name, event.value and tuple(event.value))
        case "solve" if event.name == "show":
            world.show(event.value)
        case "solve":
            left = event.value
            while left and world.solving:
                world.iterate()
                left -= 1
