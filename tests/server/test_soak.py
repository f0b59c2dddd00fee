"""A simulated day: six labs that are played with all the time, and memory that stays flat."""

import json
import random
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import psutil
import pytest

from labs.engine.catalog import find_lab
from labs.params import Choice, Knob, Toggle, Tunable, Value
from tests.server_process import ServerProcess, SessionClient

LABS = ["joint-control", "dynamics", "lqr", "ddp", "td-control", "mpc"]
CHANGES = 100_000
"""Of all labs together."""
WARM = 0.2
"""The part of them after which memory is taken for warm."""
GROWTH = 1.1
ALLOWANCE = 80e6
"""[bytes] What each process may grow beside: as much as a solver's snapshots may take, and some."""


def values_of(tunable: Tunable, dice: random.Random) -> Value | None:
    """One at random; None where only a text goes."""
    if isinstance(tunable, Knob):
        return tunable.at(dice.random())
    if isinstance(tunable, Choice):
        value: Value = dice.choice(list(tunable.options))
        return value
    return dice.random() < 0.5 if isinstance(tunable, Toggle) else None


def requests(slug: str, dice: random.Random, count: int) -> Iterator[dict[str, Any]]:
    """Changes, and now and then a command."""
    tunables = find_lab(slug).lab.Params.tunables
    for _ in range(count):
        name = dice.choice(list(tunables))
        value = values_of(tunables[name], dice)
        if value is not None and dice.random() < 0.97:
            yield {"type": "params", "changes": {name: value}}
        else:
            command = dice.choice(["reset", "run", "apply", "seed"])
            more = {"seed": dice.randrange(100)} if command == "seed" else {}
            yield {"type": "command", "command": {"command": command, **more}}


def play(session: SessionClient, seed: int, count: int) -> None:
    """Each change waits for its answer; a refusal is one, too."""
    with session.stream(max_size=None) as stream:
        dice = random.Random(seed)
        for ref, request in enumerate(requests(session.info["lab"], dice, count), 1):
            stream.socket.send(json.dumps(request | {"ref": ref}))
            while stream.next("answer")["ref"] != ref:
                pass


def memory(server: ServerProcess) -> dict[int, int]:
    """[bytes] Of each process, the web process and the workers."""
    processes = [psutil.Process(server.process.pid), *server.workers()]
    return {process.pid: process.memory_full_info().uss for process in processes}


def soak(changes: int) -> None:
    """Raises AssertionError where a process grew, or was replaced."""
    server = ServerProcess(ORCLAB_HANG_SECONDS="60", ORCLAB_VIEWERLESS_SECONDS="86400")
    with server, ThreadPoolExecutor(len(LABS)) as pool:
        opened = [SessionClient.new(server, slug, {}) for slug in LABS]
        sizes = []
        for seed, part in enumerate((WARM, 1.0 - WARM)):
            count = round(part * changes / len(LABS))
            list(pool.map(play, opened, [seed] * len(LABS), [count] * len(LABS)))
            sizes.append(memory(server))
        before, after = sizes
        assert after.keys() <= before.keys(), "a process was replaced"
        for pid, size in after.items():
            assert size < GROWTH * before[pid] + ALLOWANCE, (pid, before[pid], size)


@pytest.mark.study
@pytest.mark.timeout(7200)
def test_a_simulated_day_leaves_memory_flat() -> None:
    soak(CHANGES)
