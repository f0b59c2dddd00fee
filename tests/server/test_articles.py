"""Articles render, and refuse what a page could not show or a lab could not run."""

import dataclasses
import re

import pytest

from labs.engine.catalog import CatalogEntry, catalog, find_lab
from server.articles import Article, render, render_text, search_words
from server.formulas import ArticleError, tex_to_mathml
from server.line_breaks import split_statements

COURSE = [entry for entry in catalog().values() if entry.package.startswith("labs.")]
EXPERIMENT = """```experiment
title = "{title}"
question = "What will $e$ do?"
observe = "It **stays**."
button = "Try <it>"
{more}
```
"""


@pytest.fixture
def entry() -> CatalogEntry:
    return catalog()["joint-control"]


def write(entry: CatalogEntry, text: str) -> Article:
    return render_text(entry, text)


def experiment(more: str = "", title: str = "Sag") -> str:
    return EXPERIMENT.format(title=title, more=more)


@pytest.mark.parametrize("entry", COURSE, ids=lambda entry: entry.slug)
def test_every_article_renders(entry: CatalogEntry) -> None:
    article = render(entry)
    assert "<math" in article.html
    assert article.experiments
    assert "$$" not in article.html
    assert article.html.count("data-experiment=") == len(article.experiments)


def test_formulas_become_mathml(entry: CatalogEntry) -> None:
    html = write(entry, "Inline $x^2$ and\n\n$$\\frac{a}{b}$$\n").html
    assert "<math><msup>" in html
    assert '<math display="block"><mfrac>' in html


@pytest.mark.parametrize(
    ("source", "pieces"),
    [
        (r"a = b + c \quad d \le -e", [["a", "{}= b", "{}+ c"], ["d", r"{}\le -e"]]),
        (
            r"f\left(a = b\right) - |c + d| = e^+",
            [[r"f\left(a = b\right)", "{}- |c + d|", "{}= e^+"]],
        ),
        (
            r"\begin{cases} a & b = c \\ d \end{cases}",
            [[r"\begin{cases} a & b = c \\ d \end{cases}"]],
        ),
    ],
)
def test_a_formula_breaks_between_its_terms_alone(source: str, pieces: list[list[str]]) -> None:
    assert split_statements(source) == pieces


def test_a_text_may_begin_with_a_formula_and_end_with_a_number(entry: CatalogEntry) -> None:
    assert "<math><mi>M</mi></math> is 1.40 m²" in write(entry, "$M$ is 1.40 m²").html


def test_bad_tex_names_the_article_and_the_formula(entry: CatalogEntry) -> None:
    with pytest.raises(ArticleError, match=r"joint-control.*\\\\nonsense"):
        write(entry, "Here $\\nonsense{x}$.")


def test_bad_tex_inside_an_experiment_is_found_too(entry: CatalogEntry) -> None:
    with pytest.raises(ArticleError, match="frac"):
        write(entry, experiment().replace("$e$", "$\\\\frac{1$"))


def test_html_is_text(entry: CatalogEntry) -> None:
    html = write(entry, "<script>alert(1)</script> <b>bold</b>\n\n<img src=x>\n").html
    assert "<script" not in html
    assert "<b>" not in html
    assert "<img" not in html
    assert "&lt;script&gt;" in html


def test_a_title_the_page_shows_itself_is_not_repeated(entry: CatalogEntry) -> None:
    assert "<h1" not in write(entry, "# Joint control\n\nText.").html


def test_tables_can_scroll(entry: CatalogEntry) -> None:
    html = write(entry, "| a | b |\n|---|---|\n| 1 | 2 |\n").html
    assert html.startswith('<div class="table"><table>')
    assert "<td>1</td>" in html


def test_a_drawing_beside_the_article_stands_in_the_page() -> None:
    entry = find_lab("td-control")
    html = render_text(entry, '![two "lines"](policy_iteration.svg)').html
    assert 'role="img" aria-label="two &quot;lines&quot;"' in html
    assert "<svg" in html
    for wrong in ("no.svg", "card.webp", "../td_control/policy_iteration.svg", "http://x/a.svg"):
        with pytest.raises(ArticleError, match="no drawing"):
            render_text(entry, f"![]({wrong})")


def test_other_fenced_blocks_stay_code(entry: CatalogEntry) -> None:
    assert "<pre><code" in write(entry, "```python\nx < 1\n```\n").html


def test_a_symbol_with_a_slider_names_it(entry: CatalogEntry) -> None:
    html = write(entry, "The gain $k_p$.\n\n$$\\tau = k_p\\,e$$\n").html
    symbol = '<span class="symbol" role="button" tabindex="0" data-param="kp" aria-label="k_p">'
    assert symbol + "<math>" in html
    assert '<mrow class="symbol" data-param="kp"><msub><mi>k</mi><mi>p</mi></msub></mrow>' in html


def test_a_greek_letter_in_a_formula_that_stands_alone_is_its_knob() -> None:
    """But not in a script, with a subscript or an accent, nor where a text sets it to a number."""
    lab = catalog()["td-lambda"]

    def html(text: str) -> str:
        return render_text(lab, text).html

    gamma = '<mrow class="symbol" data-param="gamma"><mi>\u03b3</mi></mrow>'
    assert gamma + "<mi>V</mi>" in html("$$J = \\gamma V$$")
    assert f"<msup>{gamma}<mi>k</mi></msup>" in html("$$J = \\sum_{k=0}^N \\gamma^k l_k$$")
    for other in ("x^\\gamma", "\\gamma_1", "\\hat\\gamma", "\\sum_\\gamma x"):
        assert "data-param" not in html(f"$${other}$$"), other
    assert "data-param" not in html("with $\\gamma = 1$")
    assert "\u2061" in html("$$\\sin \\gamma$$")  # applies the function


def test_what_touches_a_formula_stays_on_its_line(entry: CatalogEntry) -> None:
    html = write(entry, "$x$, not ($y$), & the $z$ <alone>, as $n$-th; $a$").html
    kept = re.findall(r'<span class="joined">(.*?)<math>.*?</math>(.*?)</span>', html)
    assert kept == [("", ","), ("(", "),"), ("", "-th;")]
    assert "</span> not <span" in html
    assert " &amp; the <math><mi>z</mi></math> &lt;alone&gt;, as" in html
    assert "</span> <math><mi>a</mi></math>" in html


def test_an_experiment_is_read_and_shown(entry: CatalogEntry) -> None:
    article = write(entry, experiment('watch = "Error"\n[set]\nkp = 200.0\n'))
    (found,) = article.experiments
    assert (found.title, found.button, found.watch) == ("Sag", "Try <it>", ("Error",))
    assert dict(found.settings) == {"kp": 200.0}
    assert "<math>" in found.question
    assert "<strong>stays</strong>" in found.observe
    assert "Try &lt;it&gt;" in article.html
    assert found.observe in article.html


def test_an_experiment_says_what_makes_its_promise_visible(entry: CatalogEntry) -> None:
    more = """watch = ["Error", "Torque"]
highlight = "RMS error"
window = 3
hold = 2.5
speed = 0.5
[set]
ki = 0.0
[compare]
kp = 400.0"""
    (found,) = write(entry, experiment(more)).experiments
    told = found.describe()
    assert told["watch"] == ("Error", "Torque")
    assert (told["highlight"], told["window"], told["seconds"]) == ("RMS error", 3.0, 2.5)
    other = {"params": {"ki": 0.0, "kp": 400.0}, "seconds": 2.5}
    assert told["run"] == {"speed": 0.5, "pace": 0.0, "hold": 2.5, "compare": other}
    assert "<mi>k</mi><mi>p</mi></msub></math> = 400 N·m/rad" in found.compared


def test_what_an_experiment_does_not_say_has_its_default(entry: CatalogEntry) -> None:
    (found,) = write(entry, experiment("")).experiments
    assert found.describe() == {
        "title": "Sag",
        "set": {},
        "watch": (),
        "highlight": "",
        "window": 10.0,
        "seconds": 10.0,
        "run": {"speed": 1.0, "pace": 0.0, "hold": None, "compare": None},
        "predict": None,
    }


CHOICE = '[predict]\nchoices = ["sags by $g/k_p$", "rises"]\nanswer = 0'
NUMBER = '[predict]\nask = "Error"\nunit = "rad"\n'
CURVE = 'watch = "Error"\n[predict]\nask = "Sketch it"\ncurve = "error[1]"\nrange = [-1, 1]'


@pytest.mark.parametrize(
    ("more", "told", "shown"),
    [
        (
            CHOICE,
            {"kind": "choice", "answer": 0},
            'data-choice="1" aria-pressed="false"><span>rises<',
        ),
        (NUMBER + 'channel = "error[1]"', {"channel": "error[1]", "of": "last"}, 'inputmode="dec'),
        (NUMBER + 'readout = "RMS error"', {"channel": "rms_error", "unit": "rad"}, "Error</p>"),
        (NUMBER + "answer = 3", {"kind": "number", "channel": "", "answer": 3.0}, ">rad<"),
        (CURVE, {"plot": "Error", "unit": "rad", "range": (-1.0, 1.0)}, "Sketch it</p>"),
    ],
)
def test_a_prediction_is_asked_for(
    entry: CatalogEntry, more: str, told: object, shown: str
) -> None:
    article = write(entry, experiment(more))
    asked = article.experiments[0].describe()["predict"]
    assert {key: asked[key] for key in told} == told  # type: ignore[attr-defined]
    assert shown in article.html


def test_titles_are_escaped(entry: CatalogEntry) -> None:
    assert "<i>" not in write(entry, experiment(title="<i>Sag</i>")).html


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ("[set]\nnonsense = 1.0", "no parameter is named 'nonsense'"),
        ("[set]\nkp = -1.0", "kp takes a number from"),
        ("[set]\nkp = true", "kp takes a number from"),
        ('[set]\ncontroller = "magic"', "controller takes one of"),
        ('watch = "no such plot"', "no plot has the title 'no such plot'"),
        ('watch = ["Error", "Erro"]', "no plot has the title 'Erro'; there are ['Position'"),
        ('watch = ["Error", "Torque", "Energy"]', "watch takes 2 titles at most, not 3"),
        ('highlight = "Peak"', "no read-out has the label 'Peak'; there are ['RMS error'"),
        ("window = -1", "window = -1: takes a number from 0 to 120"),
        ("hold = 0", "hold = 0: takes a number from 0.01 to 120"),
        ('hold = "2 s"', "hold = '2 s': takes a number from 0.01 to 120"),
        ("speed = 8", "speed = 8: takes a number from 0.1 to 4"),
        ("pace = 7", "pace = 7: the page has 0, 30, 10, 5, 2, 1"),
        ("pace = 5", "pace is for labs with a solver"),
        ("[compare]\nkp = -1.0", "kp takes a number from"),
        ("[predict]\nanswer = 0", "predict: needs ask, unit"),
        ('[predict]\nchoices = ["a"]\nanswer = 0', "choices takes 2 to 5 texts, not 1"),
        ('[predict]\nchoices = ["a", "b"]\nanswer = 2', "answer = 2: takes a whole number, 0 to 1"),
        (NUMBER, "takes one of readout, channel, answer; has none"),
        (NUMBER + "answer = 1\nchannel = 'error'", "has channel and answer"),
        (NUMBER + "readout = 'RMS'", "no read-out has the label 'RMS'"),
        (
            NUMBER + "channel = 'eror'",
            "no time series shows the channel 'eror'; there are ['error'",
        ),
        (NUMBER + "channel = 'error'\nof = 'mean'", "takes one of last, min, max, peak"),
        (CURVE.replace("Error", "Energy"), "no time series that is watched shows the channel"),
        (CURVE.replace("-1, 1", "1, -1"), "range = [1, -1]: takes two numbers, [lowest, highest]"),
        (
            NUMBER.replace("Error", "$\\theta$") + "answer = 1",
            "ask = '$\\theta$' holds a control character",
        ),
        ("wach = 1", "does not know wach"),
        ("watch = 1", "watch has the wrong type"),
        ("set = 1", "set has the wrong type"),
        ("][", "not TOML"),
    ],
)
def test_an_experiment_its_lab_cannot_run_is_refused(
    entry: CatalogEntry, more: str, sentence: str
) -> None:
    with pytest.raises(ArticleError, match="joint-control") as caught:
        write(entry, experiment(more))
    assert sentence in str(caught.value)


@pytest.mark.parametrize("more", ["hold = 1.0", "[compare]\nrate = 0.02"])
def test_what_needs_time_is_refused_where_none_runs(more: str) -> None:
    with pytest.raises(ArticleError, match="is for labs in which time runs"):
        write(catalog()["descent"], experiment(more))


@pytest.mark.parametrize("key", ["title", "question", "observe", "button"])
def test_an_experiment_needs_its_texts(entry: CatalogEntry, key: str) -> None:
    text = "\n".join(line for line in experiment().split("\n") if not line.startswith(key))
    with pytest.raises(ArticleError, match=f"lacks {key}"):
        write(entry, text)


def test_an_answer_may_begin_with_a_number(entry: CatalogEntry) -> None:
    text = experiment().replace("It **stays**.", "22. That is all.")
    (found,) = write(entry, text).experiments
    assert "<p>22. That is all.</p>" in found.observe


def test_tex_renders_symbols() -> None:
    assert tex_to_mathml("k_p") == "<math><msub><mi>k</mi><mi>p</mi></msub></math>"
    assert 'display="block"' in tex_to_mathml("x", display=True)
    with pytest.raises(ArticleError, match="frac"):
        tex_to_mathml("\\frac{1")


def test_words_are_distinct_and_without_formulas() -> None:
    assert search_words("The arm, the ARM $\\alpha$ sags") == "arm sags the"


def test_an_article_is_rendered_once(entry: CatalogEntry) -> None:
    assert render(entry) is render(dataclasses.replace(entry))
