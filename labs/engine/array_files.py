"""Arrays in JSON and NPZ files, read back at a bounded cost, whatever a file says.

Nothing is built before its size is known to be allowed, and no header is evaluated: NumPy's own
reader takes it for Python. Numbers, truth values, complex numbers and texts go; objects do not.
Whatever is wrong is a ValueError, KeyError, TypeError, or one of zipfile's."""

import io
import math
import re
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

MAX_UNPACKED = 64 * 2**20
"""[bytes] Of all arrays of a file together: as much as all snapshots of a live solver."""
MAX_ARRAYS = 2000
MAX_NAME = 200
"""Characters."""
MAX_AXES = 8
MAX_JSON_TOKENS = {b"[": 20_000, b"{": 20_000, b'"': 100_000, b",": 2**22}
"""How often these may stand in JSON: lists, objects, ends of texts, values. An array saved by us
has one object and two lists; no lab's solution comes near any of these numbers."""
MAGIC = b"\x93NUMPY\x01\x00"
HEADER = re.compile(
    r"\{'descr': '([<>|=]?[biufcU]\d{1,8})', 'fortran_order': (True|False), "
    r"'shape': \(((?:\d{1,10}(?:, ?)?){0,8})\), \} *\n"
)
DTYPES = re.compile(r"bool|u?int(8|16|32|64)|float(16|32|64)|complex(64|128)")
JSON_NUMBER_TYPES = {int, float, bool, type(None)}


# JSON -----------------------------------------------------------------------------------------


def parse_json(data: bytes) -> Any:
    """What JSON says. Each part of it takes up to a hundred times its letters once it is built: the
    parts are counted before."""
    import orjson  # on demand: a headless run without files needs no reader

    for mark, most in MAX_JSON_TOKENS.items():
        if data.count(mark) > most:
            raise ValueError(f"it has more than {most} of the sign {mark.decode()}")
    return orjson.loads(data)


def to_json(array: np.ndarray) -> dict[str, Any]:
    """{dtype, shape, values}, bit for bit; of a complex number, its two parts."""
    if array.dtype.kind == "U":
        return {"dtype": "str", "shape": array.shape, "values": array.ravel().tolist()}
    flat = np.ascontiguousarray(array).ravel()
    parts = flat.view(flat.real.dtype) if array.dtype.kind == "c" else flat
    return {"dtype": array.dtype.name, "shape": array.shape, "values": parts.tolist()}


def from_json(spelled: Mapping[str, Mapping[str, Any]]) -> dict[str, np.ndarray]:
    """All arrays of a file, by name, as `to_json` gave them."""
    _check_names(list(spelled))
    arrays, left = {}, MAX_UNPACKED
    for name, array in spelled.items():
        arrays[name] = _from_json(name, array, left)
        left -= arrays[name].nbytes
    return arrays


def _from_json(name: str, spelled: Mapping[str, Any], most: int) -> np.ndarray:
    shape, values, dtype = spelled["shape"], spelled["values"], spelled["dtype"]
    whole = isinstance(shape, list | tuple) and all(
        type(n) is int and 0 <= n < 2**32 for n in shape
    )
    if not whole or len(shape) > MAX_AXES or not isinstance(values, list):
        raise ValueError(f"{name} is no array")
    if dtype == "str":
        if not all(type(value) is str for value in values):
            raise ValueError(f"{name} holds more than text")
        kind = np.dtype(f"U{max(map(len, values), default=1) or 1}")
    elif isinstance(dtype, str) and DTYPES.fullmatch(dtype):
        kind = np.dtype(dtype)
        if not set(map(type, values)) <= JSON_NUMBER_TYPES:
            raise ValueError(f"{name} holds more than numbers")
        # What is not a number in JSON was not finite.
        values = [math.nan if value is None else value for value in values]
    else:
        raise ValueError(f"{name} holds neither numbers nor text")
    parts = np.dtype(f"f{kind.itemsize // 2}") if kind.kind == "c" else kind
    if len(values) * parts.itemsize > most:
        raise ValueError(f"{name} takes more than {MAX_UNPACKED // 2**20} MiB")
    if math.prod(shape) * kind.itemsize != len(values) * parts.itemsize:
        raise ValueError(f"{name} has {len(values)} values for the shape {shape}")
    with np.errstate(all="ignore"):
        array = np.array(values, parts)
    return array.view(kind).reshape(shape)


# NPZ ------------------------------------------------------------------------------------------


def from_npz(data: bytes, without: str) -> dict[str, np.ndarray]:
    """The arrays of a file, by name, but for those whose names begin with `without`."""
    with zipfile.ZipFile(io.BytesIO(data)) as packed:
        members = [m for m in packed.infolist() if not m.filename.startswith(without)]
        if sum(member.file_size for member in members) > MAX_UNPACKED:
            raise ValueError(f"it unpacks to more than {MAX_UNPACKED // 2**20} MiB")
        _check_names([member.filename for member in members])
        if {m.compress_type for m in members} - {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}:
            raise ValueError("it is packed in another way than NumPy does it")
        return {m.filename.removesuffix(".npy"): _from_npy(packed.read(m)) for m in members}


def _from_npy(content: bytes) -> np.ndarray:
    start = len(MAGIC) + 2
    end = start + int.from_bytes(content[len(MAGIC) : start], "little")
    header = HEADER.fullmatch(content[start:end].decode("latin-1"))
    if not content.startswith(MAGIC) or not header:
        raise ValueError("an array in it is not as NumPy writes it")
    dtype = np.dtype(header[1])
    shape = tuple(int(size) for size in header[3].split(",") if size.strip())
    if math.prod(shape) * dtype.itemsize != len(content) - end:
        raise ValueError("an array in it is not what it says")
    array = np.frombuffer(content, dtype, offset=end)
    if dtype.kind == "U":
        "".join(array.tolist()).encode()  # raises where a letter is none
    return array.reshape(shape, order="F" if header[2] == "True" else "C")


def _check_names(names: list[str]) -> None:
    if len(names) > MAX_ARRAYS or max(map(len, names), default=0) > MAX_NAME:
        raise ValueError(
            f"it has more than {MAX_ARRAYS} arrays, or names beyond {MAX_NAME} letters"
        )
