"""Reads the values of a TOML table, each with its type; what is wrong is said plainly."""

from collections.abc import Mapping
from typing import Any

from server.formulas import ArticleError


def check_keys(data: dict[str, Any], needed: tuple[str, ...], known: tuple[str, ...]) -> None:
    unknown = sorted(set(data) - {*needed, *known})
    missing = [key for key in needed if data.get(key) in (None, "") and key != "unit"]
    missing += ["unit"] if "unit" in needed and "unit" not in data else []
    if unknown or missing:
        raise ArticleError(
            f"needs {', '.join(needed)}"
            + (f", may have {', '.join(known)}" if known else "")
            + (f"; lacks {', '.join(missing)}" if missing else "")
            + (f"; does not know {', '.join(unknown)}" if unknown else "")
        )


def text(data: Mapping[str, Any], key: str, default: str | None = None) -> str:
    value = data.get(key, default)
    if not isinstance(value, str):
        raise ArticleError(f"{key} has the wrong type: it takes a text")
    if not value.replace("\n", "").isprintable():
        raise ArticleError(
            f"{key} = {value!r} holds a control character: in TOML, TeX's \\ is \\\\"
        )
    return value


def table(data: Mapping[str, Any], key: str) -> dict[str, Any]:
    value = data.get(key, {})
    if not isinstance(value, dict):
        raise ArticleError(f"{key} has the wrong type: it takes a table, [{key}]")
    return value


def number(
    data: Mapping[str, Any],
    key: str,
    low: float = float("-inf"),
    high: float = float("inf"),
    default: float | None = None,
) -> float:
    value = data.get(key, default)
    if type(value) not in (int, float) or not low <= value <= high:
        bounds = f" from {low:g} to {high:g}" if high < float("inf") else ""
        raise ArticleError(f"{key} = {value!r}: takes a number{bounds}")
    return float(value)
