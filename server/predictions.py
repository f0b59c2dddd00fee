"""What an experiment asks the reader to predict, and the form the guess is given in. What the block
`[predict]` of an article may say stands in server/experiments.py."""

from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from typing import Any, Literal

from labs.lab import Lab
from labs.plots import Readout, TimeSeries
from server.formulas import ArticleError
from server.toml_values import check_keys, number, text


@dataclass(frozen=True)
class ChoiceQuestion:
    """Which of these happens? `answer` is the index of the right one."""

    choices: tuple[str, ...]
    answer: int
    ask: str = ""
    kind: Literal["choice"] = "choice"


@dataclass(frozen=True)
class NumberQuestion:
    """How much? The outcome is of a `channel`, or the `answer` where there is none."""

    ask: str
    unit: str
    channel: str
    of: str
    answer: float | None
    kind: Literal["number"] = "number"


@dataclass(frozen=True)
class CurveQuestion:
    """How does a channel run? Sketched in the plot of this title, over its vertical `range`."""

    ask: str
    unit: str
    channel: str
    plot: str
    range: tuple[float, float]
    kind: Literal["curve"] = "curve"


Prediction = ChoiceQuestion | NumberQuestion | CurveQuestion


def read_prediction(
    lab: Lab[Any, Any], data: dict[str, Any], watch: tuple[str, ...], html: Callable[[str], str]
) -> Prediction:
    """What a block `[predict]` asks; `html` renders its Markdown. Raises ArticleError."""
    try:
        return _QuestionReader(lab, watch, html).read(data)
    except ArticleError as error:
        raise ArticleError(f"predict: {error}") from None


def find_readout(lab: Lab[Any, Any], key: str, label: str) -> Readout:
    """The read-out of this label. Raises ArticleError."""
    readouts = {plot.label: plot for plot in lab.plots if isinstance(plot, Readout)}
    if label not in readouts:
        raise ArticleError(
            f"{key}: no read-out has the label {label!r}; there are {list(readouts)}"
        )
    return readouts[label]


class _QuestionReader:
    def __init__(
        self, lab: Lab[Any, Any], watch: tuple[str, ...], html: Callable[[str], str]
    ) -> None:
        self.lab, self.watch, self.html = lab, watch, html

    def read(self, data: dict[str, Any]) -> Prediction:
        """Of the block's form: a curve, a choice or a number."""
        if "choices" in data:
            return self._choice(data)
        return self._curve(data) if "curve" in data else self._amount(data)

    def _choice(self, data: dict[str, Any]) -> ChoiceQuestion:
        check_keys(data, ("choices", "answer"), ("ask",))
        choices, answer = data["choices"], data["answer"]
        if not isinstance(choices, list) or not all(isinstance(c, str) and c for c in choices):
            raise ArticleError("choices has the wrong type: it takes a list of texts")
        if not 2 <= len(choices) <= 5:
            raise ArticleError(f"choices takes 2 to 5 texts, not {len(choices)}")
        if type(answer) is not int or not 0 <= answer < len(choices):
            raise ArticleError(
                f"answer = {answer!r}: takes a whole number, 0 to {len(choices) - 1}"
            )
        ask = self._inline(text(data, "ask", ""))
        return ChoiceQuestion(
            tuple(self._inline(text({"choices": c}, "choices")) for c in choices), answer, ask
        )

    def _amount(self, data: dict[str, Any]) -> NumberQuestion:
        sources = ("readout", "channel", "answer")
        check_keys(data, ("ask", "unit"), (*sources, "of"))
        given = [source for source in sources if source in data]
        if len(given) != 1:
            raise ArticleError(
                f"takes one of {', '.join(sources)}; has {' and '.join(given) or 'none'}"
            )
        channel = text(data, "channel", "")
        answer = number(data, "answer") if "answer" in data else None
        if "readout" in data:
            channel = find_readout(self.lab, "readout", text(data, "readout")).channel
        elif channel:
            self._check_channel(channel)
        of = text(data, "of", "last")
        if of not in ("last", "min", "max", "peak"):
            raise ArticleError(f"of = {of!r}: takes one of last, min, max, peak")
        unit = data["unit"]
        if not isinstance(unit, str):
            raise ArticleError("unit has the wrong type: it takes a text, which may be empty")
        return NumberQuestion(self._inline(text(data, "ask")), unit, channel, of, answer)

    def _curve(self, data: dict[str, Any]) -> CurveQuestion:
        check_keys(data, ("ask", "curve", "range"), ())
        channel = text(data, "curve")
        series = self._check_channel(channel, watched=True)
        span = data["range"]
        numbers = isinstance(span, list) and all(type(v) in (int, float) for v in span)
        if not numbers or len(span) != 2 or not span[0] < span[1]:
            raise ArticleError(f"range = {span!r}: takes two numbers, [lowest, highest]")
        place = (float(span[0]), float(span[1]))
        ask = self._inline(text(data, "ask"))
        return CurveQuestion(ask, series.unit, channel, series.title, place)

    def _check_channel(self, channel: str, watched: bool = False) -> TimeSeries:
        """The time series that shows it. That it has this component, a test of every lab asks."""
        series = [plot for plot in self.lab.plots if isinstance(plot, TimeSeries)]
        if watched:
            series = [plot for plot in series if plot.title in self.watch]
        for plot in series:
            if channel.partition("[")[0] in [line.channel for line in plot.lines]:
                return plot
        shown = sorted({line.channel for plot in series for line in plot.lines})
        kind = "time series that is watched" if watched else "time series"
        raise ArticleError(f"no {kind} shows the channel {channel!r}; there are {shown}")

    def _inline(self, text: str) -> str:
        return self.html(text).strip().removeprefix("<p>").removesuffix("</p>")


def prediction_form(predict: Prediction | None, number: int) -> str:
    """Where the reader commits to a guess, in the card of the experiment of this number."""
    match predict:
        case None:
            return ""
        case ChoiceQuestion(choices=choices, ask=ask):
            inside = "".join(
                f'<button type="button" data-choice="{i}" aria-pressed="false">'
                f"<span>{text}</span></button>\n"
                for i, text in enumerate(choices)
            )
            return _form("choice", ask or "Your guess", inside, number)
        case NumberQuestion(ask=ask, unit=unit):
            inside = f"""<input type="text" inputmode="decimal" autocomplete="off"
 spellcheck="false" aria-labelledby="ask-{number} unit-{number}">
<span id="unit-{number}">{escape(unit)}</span>
<button type="submit">Guess</button>
<p class="wrong" role="alert" hidden></p>
"""
            return _form("number", ask, inside, number)
        case CurveQuestion(ask=ask):
            return _form("curve", ask, '<button type="button">Sketch</button>\n', number)


def _form(kind: str, ask: str, inside: str, number: int) -> str:
    return f"""<form class="predict" data-kind="{kind}" aria-labelledby="ask-{number}">
<p class="ask" id="ask-{number}">{ask}</p>
<div class="guess">{inside}</div></form>
"""
