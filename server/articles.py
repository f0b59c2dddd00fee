"""Articles: a lab's Markdown to HTML with the mathematics as MathML and experiments as cards.

An experiment is a fenced block with the info string `experiment` that holds TOML:

    title = "PD alone sags"
    question = "Where will the arm come to rest?"    # Markdown; asks for a prediction first
    observe = "The error stays at $e = g / k_p$."    # Markdown; shown once the button is pressed
    button = "Try it"
    watch = "Error"                                  # optional: a plot's title
    [set]
    controller = "pd"                                # all other parameters take their defaults
"""

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from html import escape
from typing import Any

import math_core
from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.token import Token
from markdown_it.utils import OptionsDict
from mdit_py_plugins.dollarmath import dollarmath_plugin

from labs.engine.catalog import Entry
from labs.errors import LabError
from labs.params import Params, Value
from server.line_breaks import statements

_math = math_core.LatexToMathML(fancy_error=False)


class ArticleError(LabError):
    """An article has bad TeX, or an experiment its lab cannot run."""


@dataclass(frozen=True)
class Experiment:
    """A question, the settings that answer it, and what to look for. Texts are HTML."""

    title: str
    question: str
    observe: str
    button: str
    watch: str = ""
    settings: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class Article:
    html: str
    experiments: tuple[Experiment, ...]


@lru_cache(maxsize=1024)
def tex(source: str, display: bool = False) -> str:
    """MathML of a TeX formula. Raises ArticleError."""
    try:
        return _math.convert_with_local_state(source, displaystyle=display)
    except math_core.LatexError as error:
        reason = re.sub(r"\x1b\[[0-9;]*m", "", str(error)).strip()
        raise ArticleError(f"bad TeX {source!r}: {reason}") from None


@cache
def render(entry: Entry) -> Article:
    """The article of a lab, ready for its page. Raises ArticleError naming the article."""
    return render_text(entry, entry.article)


def render_text(entry: Entry, text: str) -> Article:
    """As `render`, of a given text."""
    try:
        return _Writer(entry).write(text)
    except LabError as error:
        raise ArticleError(f"the article of {entry.slug}: {error}") from None


def words(text: str) -> str:
    """The distinct words of a Markdown text in lower case, for searching."""
    found = re.findall(r"[^\W\d_]{3,}", re.sub(r"\$[^$]*\$", " ", text).lower())
    return " ".join(sorted(set(found)))


class _Writer:
    """Renders one article; collects its experiments in order."""

    def __init__(self, entry: Entry) -> None:
        self.lab = entry.lab
        self.experiments: list[Experiment] = []
        self.symbols = _Symbols(entry.lab.Params)
        self.markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
        self.markdown.use(dollarmath_plugin, allow_digits=False, double_inline=True)
        for rule, method in (
            ("math_inline", self._inline),
            ("math_inline_double", self._display),
            ("math_block", self._display),
            ("math_block_label", self._display),
            ("fence", self._fence),
            ("table_open", self._table_open),
            ("table_close", self._table_close),
        ):
            self.markdown.renderer.rules[rule] = method  # type: ignore[attr-defined]

    def write(self, text: str) -> Article:
        # The page shows the lab's title itself; one that the article opens with would be twice.
        body = re.sub(r"\A\s*# .*\n", "", text)
        return Article(self.markdown.render(body), tuple(self.experiments))

    def _inline(self, tokens: Sequence[Token], i: int, *_: Any) -> str:
        return self.symbols.inline(tokens[i].content)

    def _display(self, tokens: Sequence[Token], i: int, *_: Any) -> str:
        """In pieces, between which a narrow column breaks the line."""
        source = tokens[i].content
        lines = [[tex(piece, True) for piece in pieces] for pieces in statements(source)]
        spans = [f"<span>{self.symbols.mark('<wbr>'.join(pieces))}</span>" for pieces in lines]
        return f'<div class="formula">{" ".join(spans)}</div>\n'

    def _table_open(self, *_: Any) -> str:
        return '<div class="table"><table>\n'

    def _table_close(self, *_: Any) -> str:
        return "</table></div>\n"

    def _fence(
        self, tokens: Sequence[Token], i: int, options: OptionsDict, env: dict[str, Any]
    ) -> str:
        if tokens[i].info.strip() != "experiment":
            return RendererHTML.fence(
                self.markdown.renderer,  # type: ignore[arg-type]
                tokens,
                i,
                options,
                env,
            )
        experiment = self._experiment(tokens[i].content)
        self.experiments.append(experiment)
        return _card(experiment, len(self.experiments))

    def _experiment(self, source: str) -> Experiment:
        try:
            data = tomllib.loads(source)
        except tomllib.TOMLDecodeError as error:
            raise ArticleError(f"an experiment is not TOML: {error}") from None
        name = f"experiment {data.get('title', '')!r}"
        texts = ("title", "question", "observe", "button", "watch")
        unknown = sorted(set(data) - {*texts, "set"})
        missing = [key for key in texts if key != "watch" and not data.get(key)]
        if unknown or missing:
            raise ArticleError(
                f"{name}: needs title, question, observe and button, may have watch and [set]"
                + (f"; lacks {', '.join(missing)}" if missing else "")
                + (f"; does not know {', '.join(unknown)}" if unknown else "")
            )
        wrong = [key for key in texts if not isinstance(data.get(key, ""), str)]
        settings = data.get("set", {})
        if wrong or not isinstance(settings, dict):
            raise ArticleError(f"{name}: {', '.join(wrong) or 'set'} has the wrong type")
        self._check(name, settings, data.get("watch", ""))
        return Experiment(
            data["title"],
            self.markdown.render(_escape_number(data["question"])),
            self.markdown.render(_escape_number(data["observe"])),
            data["button"],
            data.get("watch", ""),
            settings,
        )

    def _check(self, name: str, settings: Mapping[str, Value], watch: str) -> None:
        try:
            self.lab.Params().change(settings)
        except LabError as error:
            raise ArticleError(f"{name}: {error}") from None
        titles = [plot.title for plot in self.lab.plots if hasattr(plot, "title")]
        if watch and watch not in titles:
            raise ArticleError(f"{name}: no plot has the title {watch!r}; there are {titles}")


class _Symbols:
    """Marks the symbols that have a slider, so that the page can name them where they stand."""

    def __init__(self, params: type[Params]) -> None:
        named = {name: t for name, t in params.tunables.items() if t.symbol}
        self.labels = {name: t.label for name, t in named.items()}
        self.names = {t.symbol.strip(): name for name, t in named.items()}
        # A bare letter inside a formula may be part of another symbol: those stay unmarked.
        structured = {_inner(tex(t.symbol)): name for name, t in named.items()}
        self.parts = {part: name for part, name in structured.items() if part.count("<") > 2}

    def inline(self, source: str) -> str:
        name = self.names.get(source.strip())
        if name is None:
            return self.mark(tex(source))
        link = f'<a class="symbol" href="#param-{name}" data-param="{name}" aria-label='
        return f'{link}"{escape(self.labels[name])}">{tex(source)}</a>'

    def mark(self, formula: str) -> str:
        for part, name in self.parts.items():
            marked = f'<mrow class="symbol" data-param="{name}">{part}</mrow>'
            formula = formula.replace(part, marked)
        return formula


def _escape_number(text: str) -> str:
    """A text whose first words are "22. The" begins with a number, not with a list."""
    return re.sub(r"\A(\d+)\. ", r"\1\\. ", text)


def _inner(formula: str) -> str:
    return re.sub(r"^<math[^>]*>|</math>$", "", formula)


def _card(experiment: Experiment, number: int) -> str:
    """The card of an experiment. Before the button is pressed it asks; then it tells."""
    return f"""<section class="experiment" id="experiment-{number}" data-experiment="{number - 1}"
 aria-labelledby="experiment-{number}-title">
<header><span class="number" aria-hidden="true">{number}</span>
<h3 id="experiment-{number}-title">{escape(experiment.title)}</h3></header>
<div class="question">{experiment.question}</div>
<button type="button" class="primary try">{escape(experiment.button)}</button>
<details><summary>What to look for</summary>
<div class="observe">{experiment.observe}</div></details>
</section>
"""
