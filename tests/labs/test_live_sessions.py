"""Live sessions at random: whatever a user does, in whatever order, leaves a world that is well.

All that a page can do is done: parameters change while the world and its solver run, actions are
pressed, handles dragged and let go, iterations taken in and looked back at."""

import numpy as np
import pytest

from labs.engine.catalog import CatalogEntry
from labs.engine.run import World
from labs.errors import LabError
from labs.params import Choice, Knob, Text, Tunable, Value
from tests.labs.contract import (
    ENTRIES,
    FAULTS,
    InteractionScene,
    advance,
    annotate_failure,
    check_sentence,
    check_world,
    iterate,
    settings,
)

SHORT, LONG = {True: 75, False: 150}, 1000
"""Operations of a session in every run of the tests, fewer for labs with a solver; and in a
study."""
OPERATION_WEIGHTS = {
    "change": 0.4,
    "advance": 0.2,
    "iterate": 0.15,
    "drag": 0.1,
    "release": 0.04,
    "press": 0.05,
    "show": 0.04,
    "reset": 0.02,
}
LOG_LENGTH = 15
"""Operations before a failure that it tells."""


class RandomSession:
    """A world and somebody who plays with it."""

    def __init__(self, entry: CatalogEntry, seed: int) -> None:
        self.entry, self.rng = entry, np.random.default_rng(seed)
        self.world = World(entry, seed=seed)
        self.log = [f"seed {seed}"]

    def __str__(self) -> str:
        """What was done last."""
        return f"{len(self.log)} operations: {'; '.join(self.log[-LOG_LENGTH:])}"

    def operate(self) -> None:
        """One thing at random; a refusal is a sentence."""
        kind = str(self.rng.choice(list(OPERATION_WEIGHTS), p=list(OPERATION_WEIGHTS.values())))
        if self.world.trouble and self.rng.random() < 0.3:
            kind = "reset"  # trouble waits for it
        try:
            getattr(self, f"_{kind}")()
        except LabError as error:
            check_sentence(f"{str(error)[:1].upper()}{str(error)[1:].rstrip('.')}.")
        check_world(self.world)

    def _note(self, text: str) -> None:
        self.log.append(text)

    def _change(self) -> None:
        tunables = self.entry.lab.Params.tunables
        count = min(int(self.rng.integers(1, 4)), len(tunables))
        names = self.rng.choice(list(tunables), count, replace=False)
        changes = {str(name): self._value(str(name), tunables[str(name)]) for name in names}
        self._note(f"change {changes}")
        self.world.change(changes)

    def _value(self, name: str, tunable: Tunable) -> Value:
        match tunable:
            case Knob():
                return tunable.at(float(self.rng.choice([0.0, 1.0, self.rng.random()])))
            case Choice():
                options: list[Value] = [
                    v for v in tunable.options if (self.entry.slug, v) not in FAULTS
                ]
                return options[self.rng.integers(len(options))]
            case Text():
                default: Value = getattr(self.entry.lab.Params(), name)
                texts = [default, *(s[name] for _, s in settings(self.entry) if name in s)]
                return texts[self.rng.integers(len(texts))]
            case _:
                return bool(self.rng.integers(2))

    def _advance(self) -> None:
        steps = int(self.rng.integers(1, 30))
        self._note(f"advance {steps}")
        advance(self.world, steps)

    def _iterate(self) -> None:
        count = int(self.rng.integers(1, 6))
        self._note(f"iterate {count}")
        iterate(self.world, count)

    def _show(self) -> None:
        iteration = int(self.rng.integers(0, 20))
        self._note(f"show {iteration}")
        self.world.show(iteration)

    def _press(self) -> None:
        actions = self.entry.lab.actions
        if actions:
            name = actions[self.rng.integers(len(actions))].name
            self._note(f"press {name}")
            self.world.press(name)

    def _drag(self) -> None:
        offered = InteractionScene(self.world)
        names = sorted(offered.interactive_names)
        if not names:
            return
        name = names[self.rng.integers(len(names))]
        if name in offered.boards:
            cells = offered.boards[name]
            cell = cells[self.rng.integers(len(cells))]
            self._note(f"click {name} at {cell}")
            self.world.hold(name, cell)
            self.world.hold(name, None)
        else:
            far = self.rng.choice([0.05, 0.3, 100.0])
            x, y, z = np.array(offered.handles[name]) + self.rng.normal(0.0, far, 3)
            self._note(f"drag {name} to {(x, y, z)}")
            self.world.hold(name, (float(x), float(y), float(z)))

    def _release(self) -> None:
        for handle in self.entry.lab.handles:
            for name in handle.names:
                self.world.hold(name, None)
        self._note("release")

    def _reset(self) -> None:
        self._note("reset")
        self.world.reset()


def play(entry: CatalogEntry, seed: int, operations: int) -> None:
    """A session of so many operations."""
    session = RandomSession(entry, seed)
    with annotate_failure(session):
        for _ in range(operations):
            session.operate()


every_lab = pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.slug)


@every_lab
def test_whatever_is_done_the_world_is_well(entry: CatalogEntry) -> None:
    play(entry, 1, SHORT[entry.lab.has_solver()])


@pytest.mark.study
@pytest.mark.parametrize("seed", range(2, 7))
@every_lab
def test_whatever_is_done_for_long_the_world_is_well(entry: CatalogEntry, seed: int) -> None:
    play(entry, seed, LONG)
