"""Finds the labs: every folder of a chapter with a `lab.py` that defines a `Lab` is one.

A chapter is a package with `NUMBER` and `TITLE`. The lab in `joint_control/lab.py` has the slug
"joint-control", its article `article.md` beside it, and its picture `card.webp`. `ORCLAB_LABS` may
name further chapter packages, separated by commas (one's own course, the test suite's labs).
"""

import importlib
import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from labs.errors import LabError, UnknownLab
from labs.lab import Lab

CHAPTERS = (
    "labs.reactive_control",
    "labs.optimal_control",
    "labs.reinforcement_learning",
    "labs.appendix",
)


@dataclass(frozen=True)
class CatalogEntry:
    """One lab found: where it stands in the course, and the lab itself."""

    slug: str
    chapter: str
    chapter_title: str
    lab: Lab[Any, Any]
    package: str
    """Of its chapter."""
    folder: Path
    """Where its `lab.py` is."""

    @property
    def article(self) -> str:
        """The article's Markdown."""
        return (self.folder / "article.md").read_text(encoding="utf-8")

    @property
    def picture(self) -> bytes | None:
        """The card's picture, rendered from the real scene; None if not made."""
        path = self.folder / "card.webp"
        return path.read_bytes() if path.is_file() else None


@cache
def catalog() -> dict[str, CatalogEntry]:
    """All labs by slug, in the order of the course. Raises LabError for a wrong `ORCLAB_LABS`."""
    extra = [name for name in os.environ.get("ORCLAB_LABS", "").split(",") if name]
    entries = [entry for package in (*CHAPTERS, *extra) for entry in _labs_in(package)]
    found: dict[str, CatalogEntry] = {}
    for entry in entries:
        if entry.slug in found:
            both = f"{found[entry.slug].lab.__class__} and {entry.lab.__class__}"
            raise LabError(f"two labs are named {entry.slug}: {both}")
        found[entry.slug] = entry
    return found


def find_lab(slug: str) -> CatalogEntry:
    """The lab of this name. Raises UnknownLab, which lists those there are."""
    try:
        return catalog()[slug]
    except KeyError:
        raise UnknownLab(f"no lab is named {slug!r}; there are {', '.join(catalog())}") from None


def _labs_in(package: str) -> list[CatalogEntry]:
    chapter = _chapter(package)
    folders = [path.parent for root in chapter.__path__ for path in Path(root).glob("*/lab.py")]
    entries = []
    for folder in sorted(folders):
        module = importlib.import_module(f"{package}.{folder.name}.lab")
        for value in vars(module).values():
            if (
                isinstance(value, type)
                and issubclass(value, Lab)
                and value.__module__ == module.__name__
            ):
                slug = folder.name.replace("_", "-")
                entries.append(
                    CatalogEntry(slug, chapter.NUMBER, chapter.TITLE, value(), package, folder)
                )
    return sorted(entries, key=lambda entry: (_section_key(entry.lab.section), entry.slug))


def _chapter(package: str) -> Any:
    try:
        chapter = importlib.import_module(package)
    except ModuleNotFoundError as error:
        if not f"{package}.".startswith(f"{error.name}."):
            raise  # It is there, and lacks something itself.
        raise LabError(f"ORCLAB_LABS names {package}, which is not on Python's path") from None
    if not all(hasattr(chapter, name) for name in ("NUMBER", "TITLE", "__path__")):
        raise LabError(f"{package} is no chapter: make it a package with NUMBER and TITLE")
    return chapter


def _section_key(section: str) -> list[tuple[int, str]]:
    """Sorts "2.9" before "2.10"."""
    return [(int(part) if part.isdecimal() else 0, part) for part in section.split(".")]
