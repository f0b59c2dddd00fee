"""What all tests share: the sample labs, and a real server in a process of its own."""

import os

os.environ["ORCLAB_LABS"] = "tests.sample_labs"

from collections.abc import Iterator

import pytest

from tests.served import Served


@pytest.fixture(scope="session")
def served() -> Iterator[Served]:
    """A server for all tests that leave it as they found it."""
    with Served(ORCLAB_MAX_SESSIONS="12", ORCLAB_HANG_SECONDS="3") as server:
        yield server
