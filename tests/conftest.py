"""What all tests share: lanes, the sample labs, and real servers in processes of their own.

The whole suite runs in three processes (`pytest-xdist`); a part of it, as `pytest PATH::TEST`, in
the one that was started. A server takes seconds to start: there is one for all tests that need the
same settings."""

import multiprocessing
import os
import re
from concurrent.futures import ProcessPoolExecutor

os.environ["ORCLAB_LABS"] = "tests.sample_labs"

from collections.abc import Iterator
from typing import Any

import pytest
from xdist.scheduler import LoadScopeScheduling

import labs  # noqa: F401  (before NumPy: it says how many threads BLAS gets)
from tests.server_process import ServerProcess, wait_until

ORDER = (
    "browser/test_every_lab.py",
    "browser",
    "server",
    "test_types.py",
    "labs",
    "",
)
"""What begins first: the longest pieces."""
LAB_TEST = re.compile(
    r"labs/(?:test_(?:contract|live_sessions)\.py::\w+\[([a-z0-9-]+)(?:: .*)?\]$|\w+/(\w+)/test_)"
)
"""A test of all labs that names this one, or a test in its own folder."""


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Three lanes for the whole suite, and none for a part. Two cores have room for a third: tests
    of the browser and the server wait for simulated time more than they compute."""
    return 3 if config.args_source is pytest.Config.ArgsSource.TESTPATHS else 0


def pytest_xdist_setupnodes() -> None:
    """Compiles what a fresh checkout lacks, once and on both cores, before every lane would."""
    from labs.engine.catalog import catalog

    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        list(pool.map(_compile_lab, reversed(catalog())))


def _compile_lab(slug: str) -> None:
    from labs.engine.catalog import find_lab

    find_lab(slug).lab.prepare()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Into an order."""

    def place(item: pytest.Item) -> tuple[int, str]:
        name = item.nodeid.removeprefix("tests/")
        return next(i for i, x in enumerate(ORDER) if name.startswith(x)), _lab_of_test(name)

    items.sort(key=place)


def _lab_of_test(nodeid: str) -> str:
    """The lab that a test looks at, if it is one."""
    found = LAB_TEST.match(nodeid)
    return next(filter(None, found.groups())).replace("_", "-") if found else ""


class LaneScheduler(LoadScopeScheduling):  # type: ignore[misc]
    """What stays together in one lane: all tests of the server; almost all of the browser, for an
    open page takes a core's time for as long as it is open, and two at once take longer than one
    after the other; those of a lab, which share runs of its solver; else those of a file."""

    def _split_scope(self, nodeid: str) -> str:
        nodeid = nodeid.removeprefix("tests/")
        path = nodeid.partition("::")[0]
        folder = path.partition("/")[0]
        if path in ("browser/test_recovery.py", "browser/test_prefix.py"):
            return "server"  # they start and end servers as those tests do
        return _lab_of_test(nodeid) or (path if folder == "labs" else folder)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LaneScheduler:
    """In place of xdist's groups, which this pytest's ids have no place for."""
    return LaneScheduler(config, log)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """A lane that only computes gives way to those with pages and servers: these follow real time,
    and compute the more the longer they are kept waiting."""
    live = item.nodeid.removeprefix("tests/").startswith(("browser/", "server/"))
    if "PYTEST_XDIST_WORKER" in os.environ and not live:
        os.setpriority(os.PRIO_PROCESS, 0, 10)


@pytest.fixture(scope="session")
def shared_server() -> Iterator[ServerProcess]:
    """A server for all tests that leave it as they found it."""
    with ServerProcess(ORCLAB_MAX_SESSIONS="12", ORCLAB_HANG_SECONDS="3") as server:
        yield server


@pytest.fixture(scope="session")
def short_timeout_server() -> Iterator[ServerProcess]:
    """A server that soon ends what nobody watches, or nobody touches."""
    with ServerProcess(ORCLAB_VIEWERLESS_SECONDS="3", ORCLAB_UNTOUCHED_SECONDS="5") as server:
        yield server


@pytest.fixture(scope="session")
def _single_place_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with (
        (tmp_path_factory.mktemp("mortal") / "stderr").open("w+") as stderr,
        ServerProcess(stderr=stderr, ORCLAB_MAX_SESSIONS="1") as server,
    ):
        yield server


@pytest.fixture
def single_place_server(_single_place_server: ServerProcess) -> ServerProcess:
    """A server with a single place, for tests that fill or end it, or start it anew; each finds it
    running."""
    if not _single_place_server.running:
        _single_place_server.start()
    wait_until(
        lambda: (
            _single_place_server.health()["spares"] == 1
            and _single_place_server.health()["sessions"] == 0
        )
    )
    return _single_place_server
