"""Whatever a text, a link or a file says: it is taken, or refused in a sentence."""

import json
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labs.engine.catalog import catalog, find_lab
from labs.engine.events import events_from_recording
from labs.engine.links import LARGEST_SEED, read_link
from labs.engine.run import World
from labs.engine.solution import Solution
from labs.errors import LabError
from labs.params import Params, Text
from tests.fuzzing import FUZZ_SETTINGS, SCALARS

LONGEST_ERROR, SHOWN = 2000, 6
TEXTS = [
    pytest.param(slug, name, id=f"{slug} {name}")
    for slug, entry in catalog().items()
    for name, tunable in entry.lab.Params.tunables.items()
    if isinstance(tunable, Text)
]
LETTERS = st.sampled_from(
    [*"|;,#SGCHF.0123456789%/-[]{}'\" \n\r\t\u2212\ufeff\x00\u0660\U0001f600"]
)
WORDS = ["1e9000000", "1/0", "nan", "-inf", "1e-320", "1/3", "100%", "||", "state", "cost", "to"]
FRAGMENTS = st.sampled_from([*WORDS, "sep=;", "9" * 200, "1" * 4000])
sometimes = settings(FUZZ_SETTINGS, max_examples=100)


@st.composite
def corrupt_text(draw: st.DrawFn, text: str) -> str:
    """A text with other letters, or splinters, in the place of some of its own."""
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, max(len(text) - 1, 0)))
        if draw(st.integers(0, 3)) < 3:
            text = text[:place] + draw(LETTERS) + text[place + 1 :]
        else:
            text = text[:place] + draw(FRAGMENTS) + text[place + draw(st.integers(0, 9)) :]
    return text


def is_accepted(work: Callable[[], object]) -> bool:
    """Whether it is; a refusal is short enough for a page."""
    sentence = ""
    try:
        work()
    except LabError as refused:
        sentence = str(refused)
    assert len(sentence) < LONGEST_ERROR
    return not sentence


@pytest.mark.parametrize(("slug", "name"), TEXTS)
def test_a_text_is_taken_or_refused(slug: str, name: str) -> None:
    """What is taken, the lab can show: the first few are looked at."""
    defaults: Params = find_lab(slug).lab.Params()
    left = SHOWN

    @sometimes
    @given(data=st.data())
    def attack(data: st.DataObject) -> None:
        text = data.draw(corrupt_text(getattr(defaults, name)) | st.text(max_size=300))
        nonlocal left
        if is_accepted(lambda: defaults.change({name: text})) and left:
            left -= 1
            world = World(find_lab(slug), {name: text})
            world.lab.fields(world.params, world.state)

    attack()


@sometimes
@given(data=st.data())
def test_a_link_is_taken_or_refused(data: st.DataObject) -> None:
    """All of it by a command line; by a page each part for itself."""
    slug = data.draw(st.sampled_from(list(catalog())))
    P: type[Params] = find_lab(slug).lab.Params
    names = st.one_of(st.sampled_from(["seed", *P.tunables]), st.text(max_size=20))
    values = st.one_of(FRAGMENTS, LETTERS, st.text(max_size=40), st.floats().map(str))
    texts = data.draw(st.dictionaries(names, values, max_size=4))
    whole = is_accepted(lambda: P().change(P.read(texts)))
    params, seed, remarks = read_link(P(), texts)
    assert params == P.model_validate(params.model_dump())
    assert seed is None or 0 <= seed <= LARGEST_SEED
    assert len(remarks) <= len(texts), "one on each part at most"
    assert all(len(remark) < LONGEST_ERROR for remark in remarks)
    if whole:
        assert (params, seed, remarks) == (P().change(P.read(texts)), None, [])


def found(slug: str) -> Solution:
    world = World(find_lab(slug))
    for _ in range(3):
        world.iterate()
    return world.solution()


@pytest.mark.parametrize("form", ["json", "npz"])
def test_a_solution_file_is_taken_or_refused(form: str) -> None:
    whole = found("descent").write(form)
    world = World(find_lab("descent"))

    @sometimes
    @given(data=st.data())
    def attack(data: st.DataObject) -> None:
        content = bytearray(whole)
        for _ in range(data.draw(st.integers(1, 3))):
            start = data.draw(st.integers(0, max(0, len(content) - 1)))
            end = start + data.draw(st.sampled_from([0, 1, 1, 4, 100, 10_000]))
            content[start:end] = data.draw(st.binary(max_size=8))
        is_accepted(lambda: world.load(Solution.read(bytes(content))))

    attack()


def test_the_parts_of_a_solution_are_taken_or_refused() -> None:
    """Sound JSON that says something else."""
    whole = found("descent").to_dict()
    world = World(find_lab("descent"))
    anything = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=4), max_leaves=8)

    @sometimes
    @given(data=st.data())
    def attack(data: st.DataObject) -> None:
        document = json.loads(json.dumps(whole))
        place = data.draw(st.sampled_from([document, *document["data"].values()]))
        place[data.draw(st.sampled_from(list(place)))] = data.draw(anything)
        content = json.dumps(document).encode()
        is_accepted(lambda: world.load(Solution.read(content)))

    attack()


@sometimes
@given(st.data())
def test_the_changes_of_a_recording_are_taken_or_refused(data: st.DataObject) -> None:
    values = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
    change = {
        "step": data.draw(st.one_of(st.integers(), values)),
        "kind": data.draw(st.sampled_from(["set", "press", "hold", "solve", "dance"])),
        "name": data.draw(st.one_of(st.sampled_from(["omega", "kick", "iterate"]), values)),
        "value": data.draw(st.one_of(values, st.lists(values, max_size=4))),
    }
    is_accepted(lambda: events_from_recording({"changes_complete": True, "changes": [change]}))
