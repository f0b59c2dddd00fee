"""Articles: a lab's Markdown to HTML, with the mathematics as MathML, drawings (SVG files beside
the article) and experiments as cards."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from html import escape, unescape
from typing import Any
from xml.etree import ElementTree

from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.rules_core import StateCore
from markdown_it.token import Token
from markdown_it.utils import OptionsDict
from mdit_py_plugins.dollarmath import dollarmath_plugin

from labs.engine.catalog import CatalogEntry
from labs.errors import LabError
from labs.params import Params
from server import experiments
from server.experiments import Experiment
from server.formulas import ArticleError, tex_to_mathml
from server.line_breaks import split_statements

GREEK = frozenset("αβγδεϵζηθϑικλμνξπρσςτυφϕχψω")
NAMED = re.compile("&(?!lt;|gt;|amp;)[A-Za-z]+;")
"""Characters that XML has no names for."""
SCRIPTS = frozenset({"msub", "msup", "msubsup", "munder", "mover", "munderover"})


@dataclass(frozen=True)
class Article:
    html: str
    experiments: tuple[Experiment, ...]


@cache
def render(entry: CatalogEntry) -> Article:
    """The article of a lab, ready for its page. Raises ArticleError naming the article."""
    return render_text(entry, entry.article)


def render_text(entry: CatalogEntry, text: str) -> Article:
    """As `render`, of a given text."""
    try:
        return _ArticleRenderer(entry).write(text)
    except LabError as error:
        raise ArticleError(f"the article of {entry.slug}: {error}") from None


def search_words(text: str) -> str:
    """The distinct words of a Markdown text in lower case, for searching."""
    found = re.findall(r"[^\W\d_]{3,}", re.sub(r"\$[^$]*\$", " ", text).lower())
    return " ".join(sorted(set(found)))


class _ArticleRenderer:
    """Renders one article; collects its experiments in order."""

    def __init__(self, entry: CatalogEntry) -> None:
        self.entry = entry
        self.experiments: list[Experiment] = []
        self.symbols = _SymbolMarker(entry.lab.Params)
        self.markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
        self.markdown.use(dollarmath_plugin, allow_digits=False, double_inline=True)
        self.markdown.core.ruler.before("inline", "first_formula", _shield_first_formula)
        self.markdown.core.ruler.push("touching", _join_punctuation)
        for rule, method in (
            ("math_inline", self._inline),
            ("math_inline_double", self._display),
            ("math_block", self._display),
            ("math_block_label", self._display),
            ("fence", self._fence),
            ("table_open", self._table_open),
            ("table_close", self._table_close),
            ("image", self._figure),
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
        lines = [
            [tex_to_mathml(piece, True) for piece in pieces] for pieces in split_statements(source)
        ]
        spans = [
            f"<span>{'<wbr>'.join(map(self.symbols.display, pieces))}</span>" for pieces in lines
        ]
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
        experiment = experiments.read_experiment(self.entry, tokens[i].content, self._text)
        self.experiments.append(experiment)
        return experiments.render_card(experiment, len(self.experiments))

    def _figure(self, tokens: Sequence[Token], i: int, *_: Any) -> str:
        """A drawing beside the article, `![what it shows](NAME.svg)`. It stands in the page itself,
        so that it has the page's colours: `currentColor`, `var(--accent)`."""
        name, shows = str(tokens[i].attrs["src"]), tokens[i].content
        path = self.entry.folder / name
        if not re.fullmatch(r"\w+\.svg", name) or not path.is_file():
            raise ArticleError(f"no drawing NAME.svg beside the article is called {name!r}")
        drawing = path.read_text(encoding="utf-8")
        return f'<span class="figure" role="img" aria-label="{escape(shows)}">{drawing}</span>'

    def _text(self, markdown: str) -> str:
        """HTML of a text within an experiment."""
        return str(self.markdown.render(_escape_number(markdown)))


class _SymbolMarker:
    """Marks the symbols that have a slider, so that the page can show and change them where
    they stand."""

    def __init__(self, params: type[Params]) -> None:
        named = {name: t for name, t in params.tunables.items() if t.symbol}
        self.labels = {name: t.label for name, t in named.items()}
        self.names = {t.symbol.strip(): name for name, t in named.items()}
        whole = {_inner_mathml(tex_to_mathml(t.symbol)): name for name, t in named.items()}
        self.parts = {part: name for part, name in whole.items() if part.count("<") > 2}
        # A Latin letter inside a formula may be an index or a matrix as well: those stay unmarked.
        single = {re.sub("</?mi>", "", part): name for part, name in whole.items()}
        self.greek = {letter: name for letter, name in single.items() if letter in GREEK}

    def inline(self, source: str) -> str:
        name = self.names.get(source.strip())
        if name is None:
            return self.mark(tex_to_mathml(source))
        shown = tex_to_mathml(source)
        label = escape(self.labels[name])
        return (
            f'<span class="symbol" role="button" tabindex="0" data-param="{name}"'
            f' aria-label="{label}">{shown}</span>'
        )

    def display(self, formula: str) -> str:
        """Of a formula that stands alone: there a letter is itself, not what a text sets it to."""
        if any(f"<mi>{letter}</mi>" in formula for letter in self.greek):
            root = ElementTree.fromstring(NAMED.sub(lambda found: unescape(found[0]), formula))
            self._mark_letters(root)
            formula = ElementTree.tostring(root, encoding="unicode")
        return self.mark(formula)

    def mark(self, formula: str) -> str:
        for part, name in self.parts.items():
            marked = f'<mrow class="symbol" data-param="{name}">{part}</mrow>'
            formula = formula.replace(part, marked)
        return formula

    def _mark_letters(self, element: ElementTree.Element) -> None:
        """Greek ones but in scripts, and with a subscript or an accent: these are other symbols."""
        parts = list(element)
        if element.tag in SCRIPTS:
            parts = [] if element.tag != "msup" else parts[:1]
        for part in parts:
            name = self.greek.get(part.text or "") if part.tag == "mi" else None
            if name is None:
                self._mark_letters(part)
                continue
            marked = ElementTree.Element("mrow", {"class": "symbol", "data-param": name})
            marked.append(part)
            element[list(element).index(part)] = marked


def _escape_number(text: str) -> str:
    """A text whose first words are "22. The" begins with a number, not with a list."""
    return re.sub(r"\A(\d+)\. ", r"\1\\. ", text)


def _shield_first_formula(state: StateCore) -> None:
    """A formula at a text's very beginning: before it, the plugin for mathematics looks at the
    text's last character, and takes a dollar after a digit for a price."""
    for token in state.tokens:
        if token.type == "inline" and token.content.startswith("$"):
            token.content += "\u200b"  # a space without width


def _join_punctuation(state: StateCore) -> None:
    """What touches a formula, a bracket before it or a comma after it, stays on its line."""
    for token in state.tokens:
        children = token.children or []
        for i in reversed(range(len(children))):
            if children[i].type != "math_inline":
                continue
            before = _cut_match(children, i - 1, r"[^\s\u200b]*\Z")
            after = _cut_match(children, i + 1, r"\A[^\s\u200b]*")
            if before or after:
                opening = _html_token(f'<span class="joined">{before}')
                closing = _html_token(f"{after}</span>")
                children[i : i + 1] = [opening, children[i], closing]


def _cut_match(children: Sequence[Token], i: int, pattern: str) -> str:
    """Cuts what a pattern finds out of a text, if the i-th is one; as HTML."""
    if not 0 <= i < len(children) or children[i].type != "text":
        return ""
    found = re.search(pattern, children[i].content)
    children[i].content = re.sub(pattern, "", children[i].content, count=1)
    return escape(found[0]) if found else ""


def _html_token(source: str) -> Token:
    return Token("html_inline", "", 0, content=source)


def _inner_mathml(formula: str) -> str:
    return re.sub(r"^<math[^>]*>|</math>$", "", formula)
