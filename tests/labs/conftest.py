"""What the tests of labs share."""

import pytest

from labs.engine.catalog import catalog
from tests.labs.solve_cache import share_solves


@pytest.fixture(scope="session", autouse=True)
def _shared_runs() -> None:
    """Solves once what several tests of a lab look at."""
    for entry in catalog().values():
        if entry.lab.has_solver():
            share_solves(type(entry.lab))
