"""Discovery of labs (labs/engine/catalog.py)."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from labs.engine import catalog as catalog_module
from labs.engine.catalog import CHAPTERS, catalog, find_lab
from labs.errors import LabError, UnknownLab

LAB = '''
from dataclasses import dataclass
from labs.lab import Lab, State
from labs.params import Params

class SmallParams(Params):
    """Nothing to turn."""

class Small(Lab[SmallParams, State]):
    title = "Small"
    section = "{section}"
    summary = "A small lab."
    Params = SmallParams

    def init(self, params, rng):
        return State()

    def draw(self, scene, params, state):
        pass
'''

Course = Callable[..., None]


@pytest.fixture
def course(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Course]:
    """Makes a chapter package of labs {module: section} and names it in ORCLAB_LABS."""
    monkeypatch.syspath_prepend(tmp_path)
    catalog.cache_clear()

    def make(package: str, init: str = "NUMBER = 'C'\nTITLE = 'Own'\n", **labs: str) -> None:
        folder = tmp_path / package
        folder.mkdir()
        (folder / "__init__.py").write_text(init)
        for name, section in labs.items():
            (folder / name).mkdir()
            (folder / name / "lab.py").write_text(LAB.replace("{section}", section))
            (folder / name / "article.md").write_text(f"About {name}.")
        monkeypatch.setenv("ORCLAB_LABS", package)

    yield make
    catalog.cache_clear()


def test_the_shipped_labs_are_found_with_their_articles() -> None:
    entry = find_lab("joint-control")
    assert (entry.chapter, entry.chapter_title) == ("1", "Reactive control")
    assert entry.lab.title == "Joint motion control"
    assert "$$" in entry.article
    assert entry.package == "labs.reactive_control"


def test_labs_stand_in_the_order_of_the_course() -> None:
    packages = [entry.package for entry in catalog().values()]
    places = [(*CHAPTERS, "tests.sample_labs").index(package) for package in packages]
    assert places == sorted(places)


def test_a_lab_of_ones_own_is_found(course: Course) -> None:
    course("own_course", my_first_lab="C.1")
    entry = find_lab("my-first-lab")
    assert (entry.chapter, entry.lab.section) == ("C", "C.1")
    assert entry.article == "About my_first_lab."
    assert entry.picture is None
    assert "oscillator" not in catalog()


def test_sections_are_sorted_as_numbers(course: Course) -> None:
    course("long_course", late="C.10", early="C.2", first="C.1", deep="C.2.1")
    own = [slug for slug, entry in catalog().items() if entry.package == "long_course"]
    assert own == ["first", "early", "deep", "late"]


def test_an_imported_lab_is_not_found_twice(course: Course, tmp_path: Path) -> None:
    course("importing_course", original="C.1")
    user = tmp_path / "importing_course" / "user"
    user.mkdir()
    (user / "lab.py").write_text("from importing_course.original.lab import Small\n")
    assert "user" not in catalog()
    assert "original" in catalog()


def test_two_labs_of_one_name_are_refused(course: Course) -> None:
    course("copied_course", joint_control="C.1")
    with pytest.raises(LabError, match=r"two labs are named joint-control: .*JointControl.*Small"):
        catalog()


def test_a_package_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ORCLAB_LABS", "no_such_course.chapter")
    catalog.cache_clear()
    try:
        with pytest.raises(LabError, match=r"ORCLAB_LABS names no_such_course\.chapter"):
            catalog()
    finally:
        catalog.cache_clear()


def test_a_lab_that_lacks_a_package_itself_says_which(course: Course, tmp_path: Path) -> None:
    course("lacking_course")
    lacking = tmp_path / "lacking_course" / "lacking"
    lacking.mkdir()
    (lacking / "lab.py").write_text("import no_such_dependency\n")
    with pytest.raises(ModuleNotFoundError, match="no_such_dependency"):
        catalog()


def test_a_package_without_a_number_is_no_chapter(course: Course) -> None:
    course("bare_course", init="")
    with pytest.raises(LabError, match="bare_course is no chapter"):
        catalog()


def test_an_unknown_lab_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(UnknownLab) as refused:
        find_lab("joint_control")
    assert str(refused.value).startswith("no lab is named 'joint_control'; there are ")
    assert all(slug in str(refused.value) for slug in catalog())


def test_the_catalogue_is_read_once() -> None:
    assert catalog() is catalog_module.catalog()
