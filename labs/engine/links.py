"""A link to a lab: parameters and the seed as texts. What it can say holds; what it cannot is named
and left out, and takes nothing else with it."""

import math
from collections.abc import Mapping
from typing import TypeVar

from labs.errors import ParameterError
from labs.params import Knob, Params

SEED = "seed"
LARGEST_SEED = 2**32 - 1
MAX_QUOTED_LENGTH = 40
"""Letters of a name or a value that a remark repeats."""

P = TypeVar("P", bound=Params)


def read_link(defaults: P, texts: Mapping[str, str]) -> tuple[P, int | None, list[str]]:
    """The parameters and the seed (None: it has none) of a link's texts by name, and a remark on
    each that is unknown, out of range (the nearest end holds) or no value at all."""
    texts = dict(texts)
    remarks: list[str] = []
    seed = _seed(texts.pop(SEED), remarks) if SEED in texts else None
    known = {name: text for name, text in texts.items() if name in defaults.tunables}
    remarks += [
        f"{_truncate(name)} is no parameter of this lab, and was left out"
        for name in texts
        if name not in known
    ]
    values = defaults.read(known)
    for name, value in values.items():
        knob = defaults.tunables[name]
        if isinstance(knob, Knob) and isinstance(value, float) and not math.isnan(value):
            values[name] = clipped = min(max(value, knob.low), knob.high)
            if clipped != value:
                end = f"the {'least' if clipped > value else 'most'} it takes"
                remarks.append(f"{name} = {_truncate(known[name])} became {clipped:g}, {end}")
    try:
        return defaults.change(values), seed, remarks
    except ParameterError:
        pass  # which of them?
    params = defaults
    for name, value in values.items():
        try:
            params = params.change({name: value})
        except ParameterError as error:
            remarks.append(f"{error}; it was left out")
    return params, seed, remarks


def _seed(text: str, remarks: list[str]) -> int | None:
    if text.isascii() and text.isdigit() and len(text) <= 10 and int(text) <= LARGEST_SEED:
        return int(text)
    remarks.append(f"seed = {_truncate(text)}: it takes a whole number from 0 to {LARGEST_SEED}")
    return None


def _truncate(text: str) -> str:
    return text if len(text) <= MAX_QUOTED_LENGTH else f"{text[:MAX_QUOTED_LENGTH]}…"
