"""What the tests of labs share."""

import pytest

from labs.engine.catalog import catalog
from tests.labs.shared_runs import share


@pytest.fixture(scope="session", autouse=True)
def _shared_runs() -> None:
    """Solves once what several tests of a lab look at."""
    for entry in catalog().values():
        if entry.lab.has_solver():
            share(type(entry.lab))
