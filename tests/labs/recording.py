"""What a lab measures along a run, for the tests of labs."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from labs.lab import Lab, State
from labs.params import Params


def record(lab: Lab[Any, Any], params: Params, states: Iterable[State]) -> dict[str, np.ndarray]:
    """Every channel over time, of those that are there in the first state."""
    rows: list[Any] = [lab.measure(params, state) for state in states]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}
