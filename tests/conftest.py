"""What all tests share: the sample labs, and real servers in processes of their own.

A server takes seconds to start: there is one for all tests that need the same settings."""

import os

os.environ["ORCLAB_LABS"] = "tests.sample_labs"

from collections.abc import Iterator

import pytest

from tests.served import Served, until


@pytest.fixture(scope="session")
def served() -> Iterator[Served]:
    """A server for all tests that leave it as they found it."""
    with Served(ORCLAB_MAX_SESSIONS="12", ORCLAB_HANG_SECONDS="3") as server:
        yield server


@pytest.fixture(scope="session")
def small() -> Iterator[Served]:
    """A server with a single place."""
    with Served(ORCLAB_MAX_SESSIONS="1") as server:
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
        Served(stderr=stderr) as server,
    ):
        yield server


@pytest.fixture
def mortal(_mortal: Served) -> Served:
    """A server for tests that end it, or start it anew; each finds it running."""
    if not _mortal.running:
        _mortal.start()
    until(lambda: _mortal.health()["spares"] == 1 and _mortal.health()["sessions"] == 0)
    return _mortal
