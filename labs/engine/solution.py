"""A solver's solution as a file, to be taken up again another day.

It holds the lab, its parameters and seed, the iteration, and what the snapshot holds, flat: every
array under the names that lead to it, joined by dots ("policy.K", "knots.0"). A JSON file has them
under "data", each with dtype, shape and values; an NPZ file has an array each, and all else as
JSON in the array "about". Durations ("seconds" in a snapshot) are left out: they belong to one
run on one machine.

Beside them stand the results, for other programs and never read back: what the lab's plots show
(learning curves, values, policies) and what `Lab.results` adds (an LQR's A, B, K, P and poles); in
a JSON file under "results", in an NPZ file as "results/NAME".
"""

import io
import json
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from labs.engine.array_files import from_json, from_npz, parse_json, to_json
from labs.engine.record import versions
from labs.engine.snapshots import flatten
from labs.errors import LabError
from labs.lab import Snapshot
from labs.params import Value

FILE_FORMATS = ("json", "npz")
RESULTS_PREFIX = "results/"
DTYPE_NAMES = {"b": "truth values", "i": "whole numbers", "f": "numbers", "c": "complex numbers"}
DTYPE_NAMES |= {"u": DTYPE_NAMES["i"], "U": "text"}


class _About(BaseModel):
    """What a file says beside its arrays."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    lab: Annotated[str, Field(max_length=64)]
    params: Annotated[dict[Annotated[str, Field(max_length=64)], Value], Field(max_length=200)]
    seed: Annotated[int, Field(ge=0, lt=2**32)]
    iteration: Annotated[int, Field(ge=0, le=2**53)]
    done: Annotated[str, Field(max_length=1000)]
    progress: Annotated[float, Field(ge=0.0, le=1.0)] | None = None


@dataclass(frozen=True)
class Solution:
    """What a solver had found, of which problem."""

    lab: str
    params: Mapping[str, Value]
    seed: int
    iteration: int
    done: str
    """Why the solver had stopped; empty where it had not."""
    progress: float | None
    arrays: Mapping[str, np.ndarray]
    """By their flat names."""
    results: Mapping[str, np.ndarray] = field(default_factory=dict)
    """What is written for other programs; a file that is read has none."""

    @classmethod
    def of(cls, lab: str, params: Mapping[str, Value], seed: int, snapshot: Snapshot) -> "Solution":
        """What a snapshot holds."""
        about = (snapshot.iteration, snapshot.done, snapshot.progress)
        return cls(lab, params, seed, *about, dict(flatten(_without_durations(snapshot.data))))

    def about(self) -> dict[str, Any]:
        """All but the arrays."""
        return {
            "lab": self.lab,
            "params": dict(self.params),
            "seed": self.seed,
            "iteration": self.iteration,
            "done": self.done,
            "progress": self.progress,
            "versions": versions(),
        }

    # Writing ----------------------------------------------------------------------------------

    def to_dict(self) -> dict[str, Any]:
        """What the JSON file holds."""
        parts = {"data": self.arrays} | ({"results": self.results} if self.results else {})
        return self.about() | {
            part: {name: to_json(a) for name, a in arrays.items()} for part, arrays in parts.items()
        }

    def json(self) -> bytes:
        import orjson  # on demand: a headless run without output needs no writer

        return orjson.dumps(self.to_dict())

    def npz(self) -> bytes:
        data = io.BytesIO()
        about = np.array(json.dumps(self.about()))
        results = {f"{RESULTS_PREFIX}{name}": a for name, a in self.results.items()}
        np.savez_compressed(data, about=about, **self.arrays, **results)  # type: ignore[arg-type]
        return data.getvalue()

    def write(self, form: str) -> bytes:
        """`form` is "json" or "npz"."""
        return {"json": self.json, "npz": self.npz}[form]()

    # Reading ----------------------------------------------------------------------------------

    @classmethod
    def read(cls, data: bytes) -> "Solution":
        """What a file holds, JSON or NPZ. Raises LabError."""
        if data.startswith((b"t,", b"#")):
            raise LabError("this is a recording as CSV, not a solution: a solution is NPZ or JSON")
        try:
            if data.startswith(b"PK"):
                arrays = from_npz(data, without=RESULTS_PREFIX)
                about = parse_json(str(arrays.pop("about")).encode())
                return cls._from_validated(about, arrays)
            return cls.from_dict(parse_json(data))
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
            raise LabError(
                f"this is no solution saved by orclab ({_error_message(error)})"
            ) from None
        except (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError) as error:
            raise LabError(f"this NPZ file cannot be read ({_error_message(error)})") from None

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> "Solution":
        """What `to_dict` gave. Raises LabError, ValueError, KeyError or TypeError."""
        _refuse_recording(found)
        return cls._from_validated(found, from_json(found["data"]))

    @classmethod
    def _from_validated(
        cls, about: Mapping[str, Any], arrays: Mapping[str, np.ndarray]
    ) -> "Solution":
        _refuse_recording(about)
        try:
            checked = _About.model_validate(
                {k: about[k] for k in _About.model_fields if k in about}
            )
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise LabError(
                f"this is no solution saved by orclab ({where}: {first['msg']})"
            ) from None
        return cls(**dict(checked), arrays=arrays)

    # Taking up --------------------------------------------------------------------------------

    def check_lab(self, slug: str) -> None:
        """Raises LabError unless it is a solution of this lab."""
        if self.lab != slug:
            raise LabError(
                f"this is a solution of {self.lab!r}, and here is {slug!r}: load it there"
            )

    def snapshot_data(self, own: Sequence[Snapshot]) -> Mapping[str, Any]:
        """The data of a snapshot, put together as the lab's `own` first ones are.

        Names, kinds and ranks have to be those of `own`, and shapes too, but along axes that
        differ among `own`, or are empty yet: those grow from iteration to iteration. Raises
        LabError."""
        shapes = [
            {name: a.shape for name, a in flatten(_without_durations(one.data))} for one in own
        ]
        wanted = dict(flatten(_without_durations(own[0].data)))
        if missing := sorted(wanted.keys() - self.arrays.keys()):
            raise LabError(f"the solution lacks {_join_names(missing)}: it is of another version")
        if unknown := sorted(self.arrays.keys() - wanted.keys()):
            raise LabError(
                f"the solution has {_join_names(unknown)}, of which this lab knows nothing"
            )
        fitted = {
            name: _cast_like(name, self.arrays[name], model, [s[name] for s in shapes if name in s])
            for name, model in wanted.items()
        }
        data = _unflatten(_without_durations(own[0].data), "", fitted)
        assert isinstance(data, dict)
        # A solver's durations begin anew.
        return data | ({"seconds": {}} if "seconds" in own[0].data else {})

    def snapshot(self, own: Sequence[Snapshot]) -> Snapshot:
        """As `Lab.accept` takes it. Raises LabError."""
        return Snapshot(self.iteration, self.snapshot_data(own), self.done, self.progress)


def _refuse_recording(about: Mapping[str, Any]) -> None:
    """Raises LabError where it is a recording that was taken for a solution."""
    if "covers" in about and "iteration" not in about:
        raise LabError(
            f"this is a recording of {str(about.get('lab'))[:64]!r}, not a solution: as JSON it "
            "is repeated by orclab run --replay FILE"
        )


def _without_durations(data: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in data.items() if name != "seconds"}


def _cast_like(
    name: str, array: np.ndarray, model: np.ndarray, shapes: Sequence[tuple[int, ...]]
) -> np.ndarray:
    """The array with the type and layout of the lab's own."""
    if DTYPE_NAMES.get(array.dtype.kind) != DTYPE_NAMES.get(model.dtype.kind):
        kinds = [DTYPE_NAMES.get(a.dtype.kind, "something else") for a in (array, model)]
        raise LabError(f"{name} of the solution holds {kinds[0]}; it takes {kinds[1]}")
    if array.ndim != model.ndim or not all(
        size == own
        or own == 0
        or any(other[axis] != own for other in shapes if len(other) == model.ndim)
        for axis, (size, own) in enumerate(zip(array.shape, model.shape, strict=True))
    ):
        raise LabError(
            f"{name} of the solution has the shape {array.shape}; with its parameters "
            f"it takes {model.shape}"
        )
    if model.dtype.kind == "U":
        return array
    columns = model.flags.f_contiguous and not model.flags.c_contiguous
    with np.errstate(all="ignore"):
        cast: np.ndarray = np.array(array, dtype=model.dtype, order="F" if columns else "C")
    if model.dtype.kind in "fc" and not np.isfinite(cast).all():
        raise LabError(f"{name} of the solution holds numbers that are not finite")
    if model.dtype.kind in "iu" and not np.array_equal(cast, array):
        raise LabError(f"{name} of the solution holds numbers too large for this lab")
    return cast


def _unflatten(model: Any, path: str, arrays: Mapping[str, np.ndarray]) -> Any:
    """Plain data in the form of `model` with these values in it."""

    def part(name: object, value: Any) -> Any:
        return _unflatten(value, f"{path}.{name}" if path else str(name), arrays)

    if model is None:
        return None
    if isinstance(model, Mapping):
        return {name: part(name, value) for name, value in model.items()}
    if is_dataclass(model) and not isinstance(model, type):
        return replace(
            model, **{f.name: part(f.name, getattr(model, f.name)) for f in fields(model)}
        )
    if isinstance(model, list | tuple):
        return type(model)(part(place, value) for place, value in enumerate(model))
    if isinstance(model, np.ndarray):
        return arrays[path]
    return type(model)(arrays[path].item())


def _join_names(names: Sequence[str]) -> str:
    return ", ".join(names[:5]) + (" and more" if len(names) > 5 else "")


def _error_message(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"[:200]
