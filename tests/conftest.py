"""What all tests share: lanes, the sample labs, and real servers in processes of their own.

The whole suite runs in three processes (`pytest-xdist`); a part of it, as `pytest PATH::TEST`, in
the one that was started. A server takes seconds to start: there is one for all tests that need the
same settings."""

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor

os.environ["ORCLAB_LABS"] = "tests.sample_labs"

from collections.abc import Iterator
from typing import Any

import pytest
from xdist.scheduler import LoadScopeScheduling

import labs  # noqa: F401  (before NumPy: it says how many threads BLAS gets)
from tests.served import Served, until

ORDER = (
    "browser/test_every_lab.py",
    "labs/test_contract.py",
    "browser",
    "server",
    "test_types.py",
    "labs/test_live_sessions.py",
    "labs",
    "",
)
"""What begins first: the longest pieces."""


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Three lanes for the whole suite, and none for a part. Two cores have room for a third: tests
    of the browser and the server wait for simulated time more than they compute."""
    return 3 if config.args_source is pytest.Config.ArgsSource.TESTPATHS else 0


def pytest_xdist_setupnodes() -> None:
    """Compiles what a fresh checkout lacks, once and on both cores, before every lane would."""
    from labs.engine.catalog import catalog

    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        list(pool.map(_prepare, reversed(catalog())))


def _prepare(slug: str) -> None:
    from labs.engine.catalog import find

    find(slug).lab.prepare()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Into an order."""
    here = config.rootpath / "tests"
    paths = {item: item.path.relative_to(here).as_posix() for item in items}
    items.sort(key=lambda item: next(i for i, x in enumerate(ORDER) if paths[item].startswith(x)))


class Lanes(LoadScopeScheduling):  # type: ignore[misc]
    """What stays together in one lane: all tests of the server, almost all of the browser, else
    those of a file."""

    def _split_scope(self, nodeid: str) -> str:
        path = nodeid.partition("::")[0].removeprefix("tests/")
        folder = path.partition("/")[0]
        if path == "browser/test_comeback.py":
            return "server"  # it ends the servers that those tests end, too
        alone = folder == "labs" or path == "browser/test_every_lab.py"
        return path if alone else folder


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Lanes:
    """In place of xdist's groups, which this pytest's ids have no place for."""
    return Lanes(config, log)


@pytest.fixture(scope="session")
def served() -> Iterator[Served]:
    """A server for all tests that leave it as they found it."""
    with Served(ORCLAB_MAX_SESSIONS="12", ORCLAB_HANG_SECONDS="3") as server:
        yield server


@pytest.fixture(scope="session")
def impatient() -> Iterator[Served]:
    """A server that soon ends what nobody watches, or nobody touches."""
    with Served(ORCLAB_VIEWERLESS_SECONDS="3", ORCLAB_UNTOUCHED_SECONDS="5") as server:
        yield server


@pytest.fixture(scope="session")
def _mortal(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with (
        (tmp_path_factory.mktemp("mortal") / "stderr").open("w+") as stderr,
        Served(stderr=stderr, ORCLAB_MAX_SESSIONS="1") as server,
    ):
        yield server


@pytest.fixture
def mortal(_mortal: Served) -> Served:
    """A server with a single place, for tests that fill or end it, or start it anew; each finds it
    running."""
    if not _mortal.running:
        _mortal.start()
    until(lambda: _mortal.health()["spares"] == 1 and _mortal.health()["sessions"] == 0)
    return _mortal
