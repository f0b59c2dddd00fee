"""The experiments of an article. Each is a fenced block with the info string `experiment` that
holds TOML; what it says is checked when the article is rendered, and an ArticleError names what
is allowed.

    title = "PD alone sags"
    question = "Where will the arm come to rest?"    # Markdown, as are observe, ask and choices
    observe = "The error stays at $e = g / k_p$."    # shown once the button is pressed
    button = "Let it sag"

What makes its promise visible, all optional. What is not given has its default, so that nothing
of the experiment before is left:

    watch = "Error"             # a plot's exact title, or a list of up to two
    highlight = "RMS error"     # a read-out's exact label: its tile is marked
    window = 5                  # [s] the time window of the plots, 0 for all; else 10
    hold = 4.0                  # [s] pause exactly then; Run goes on
    speed = 0.5                 # simulated seconds per second, 0.1 to 4; else 1
    pace = 5                    # the solver's iterations a second: one of PACES; else 0, fastest

    [set]                       # parameters; all others take their defaults
    controller = "pd"
    [compare]                   # what a run made first has otherwise than [set]: it is made fast,
    kp = 400.0                  # up to the hold or through the window, and is the faint trace

A prediction is asked for first, in one of three forms:

    [predict]                   # 1. a choice
    choices = ["It sags.", "It overshoots."]
    answer = 0                  # which is right, from 0

    [predict]                   # 2. a number
    ask = "Error of joint 2"
    unit = "rad"
    channel = "error[1]"        # outcome: of a measured channel (components from 0); or instead
    of = "last"                 #   its "last" value, "min", "max", or "peak", the largest magnitude
    readout = "RMS error"       # outcome: a read-out, by its exact label; or instead
    answer = 16                 # outcome: a number that the lab's tests verify

    [predict]                   # 3. a curve, sketched on the empty plot
    ask = "Sketch the error of joint 2"
    curve = "error[1]"          # a channel of a watched TimeSeries: the run's curve is the outcome
    range = [-0.3, 0.1]         # what the empty plot's vertical axis shows

The outcome is read at the hold; without one when the solver is done, or in a lab without a solver
when the window is full; or when the run stops in trouble. A `channel` or `readout` counts up to
then. What has an `answer` is told at once; the lab's tests verify it (tests/labs/experiments.py).
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from html import escape
from typing import Any

from labs.engine.catalog import CatalogEntry
from labs.errors import LabError
from labs.lab import Lab
from labs.params import Knob, Params, Value
from labs.plots import Readout
from server import predictions
from server import toml_values as toml
from server.formulas import ArticleError, tex_to_mathml
from server.predictions import Prediction, find_readout

PACES = (0, 30, 10, 5, 2, 1)
"""What the page's menu has: iterations of the solver a second; 0 for as many as go."""
WINDOWS = (5, 10, 30, 0)
"""[s] What the page's menu has; 0 for all."""
MAX_SECONDS = 120.0
"""[s] As much of a run a page keeps."""
WATCHED = 2
"""Plots that fit on a laptop's screen."""


@dataclass(frozen=True)
class Experiment:
    """A question, the settings that answer it, and what to look for. Texts are HTML."""

    title: str
    question: str
    observe: str
    button: str
    watch: tuple[str, ...] = ()
    highlight: str = ""
    window: float = 10.0
    hold: float | None = None
    speed: float = 1.0
    pace: float = 0.0
    settings: Mapping[str, Value] = field(default_factory=dict)
    compare: Mapping[str, Value] = field(default_factory=dict)
    compared: str = ""
    """What is otherwise in the run compared with."""
    predict: Prediction | None = None

    @property
    def seconds(self) -> float:
        """[s] How far the run compared with goes, and a sketch."""
        return self.hold or self.window or MAX_SECONDS

    def describe(self) -> dict[str, Any]:
        """What the page's scripts need, as plain JSON data."""
        other = {"params": {**self.settings, **self.compare}, "seconds": self.seconds}
        return {
            "title": self.title,
            "set": dict(self.settings),
            "watch": self.watch,
            "highlight": self.highlight,
            "window": self.window,
            "seconds": self.seconds,
            "run": {
                "speed": self.speed,
                "pace": self.pace,
                "hold": self.hold,
                "compare": other if self.compare else None,
            },
            "predict": asdict(self.predict) if self.predict else None,
        }


def read_experiment(entry: CatalogEntry, source: str, html: Callable[[str], str]) -> Experiment:
    """The experiment that a block's TOML describes; `html` renders its Markdown. Raises
    ArticleError."""
    try:
        data = tomllib.loads(source)
    except tomllib.TOMLDecodeError as error:
        raise ArticleError(f"an experiment is not TOML: {error}") from None
    try:
        return _ExperimentReader(entry.lab, html).read(data)
    except LabError as error:
        raise ArticleError(f"experiment {data.get('title', '')!r}: {error}") from None


class _ExperimentReader:
    """Reads and checks the blocks of one lab."""

    def __init__(self, lab: Lab[Any, Any], html: Callable[[str], str]) -> None:
        self.lab, self.html = lab, html
        self.titles = [plot.title for plot in lab.plots if not isinstance(plot, Readout)]

    def read(self, data: dict[str, Any]) -> Experiment:
        texts = ("title", "question", "observe", "button")
        more = ("watch", "highlight", "window", "hold", "speed", "pace")
        toml.check_keys(data, texts, (*more, "set", "compare", "predict"))
        title, question, observe, button = (toml.text(data, key) for key in texts)
        settings, compare = (toml.table(data, key) for key in ("set", "compare"))
        self.lab.Params().change(settings)
        self.lab.Params().change({**settings, **compare})
        if compare and not self.lab.has_world():
            raise ArticleError("compare is for labs in which time runs")
        experiment = Experiment(
            title,
            self.html(question),
            self.html(observe),
            button,
            self._watch(data.get("watch", [])),
            self._highlight(data),
            toml.number(data, "window", 0.0, MAX_SECONDS, 10.0),
            self._hold(data),
            toml.number(data, "speed", 0.1, 4.0, 1.0),
            self._pace(data),
            settings,
            compare,
            _describe_comparison(self.lab.Params().change(settings), compare),
        )
        if "predict" not in data:
            return experiment
        table = toml.table(data, "predict")
        predict = predictions.read_prediction(self.lab, table, experiment.watch, self.html)
        return Experiment(**vars(experiment) | {"predict": predict})

    def _watch(self, given: object) -> tuple[str, ...]:
        titles = [given] if isinstance(given, str) else given
        if not isinstance(titles, list) or not all(isinstance(title, str) for title in titles):
            raise ArticleError("watch has the wrong type: it takes a plot's title or a list")
        if len(titles) > WATCHED:
            raise ArticleError(f"watch takes {WATCHED} titles at most, not {len(titles)}")
        for title in titles:
            if title not in self.titles:
                raise ArticleError(f"no plot has the title {title!r}; there are {self.titles}")
        return tuple(titles)

    def _highlight(self, data: Mapping[str, Any]) -> str:
        label = toml.text(data, "highlight", "")
        return find_readout(self.lab, "highlight", label).label if label else ""

    def _hold(self, data: Mapping[str, Any]) -> float | None:
        if "hold" not in data:
            return None
        if not self.lab.has_world():
            raise ArticleError("hold is for labs in which time runs")
        return toml.number(data, "hold", self.lab.period, MAX_SECONDS)

    def _pace(self, data: Mapping[str, Any]) -> float:
        pace = toml.number(data, "pace", 0.0, max(PACES), 0.0)
        if pace not in PACES:
            raise ArticleError(f"pace = {pace:g}: the page has {', '.join(map(str, PACES))}")
        if pace and not self.lab.has_solver():
            raise ArticleError("pace is for labs with a solver")
        return pace


def _describe_comparison(params: Params, compare: Mapping[str, Value]) -> str:
    """What is otherwise, as HTML: k_p = 400 N/m, in symbols where there are some."""
    described = {tunable["name"]: tunable for tunable in params.describe()}
    values = params.model_dump() | dict(compare)
    parts = []
    for name, value in compare.items():
        tunable = described[name]
        symbol = tunable.get("symbol")
        labels = {o["value"]: o["label"] for o in tunable.get("options", [])}
        shown = f"{value:g}" if type(value) in (int, float) else str(labels.get(value, value))
        knob = params.tunables[name]
        unit = knob.unit_under(values) if isinstance(knob, Knob) else ""
        unit = f" {unit}" if unit else ""
        named = tex_to_mathml(symbol) if symbol else escape(tunable["label"])
        parts.append(f"{named} = {escape(shown + unit)}")
    return ", ".join(parts)


def render_card(experiment: Experiment, number: int) -> str:
    """The card of an experiment. Before the button is pressed it asks; then it tells."""
    compared = experiment.compared and f'<p class="compared">Faint: {experiment.compared}</p>\n'
    return f"""<section class="experiment" id="experiment-{number}" data-experiment="{number - 1}"
 aria-labelledby="experiment-{number}-title">
<header><span class="number" aria-hidden="true">{number}</span>
<h3 id="experiment-{number}-title">{escape(experiment.title)}</h3></header>
<div class="question">{experiment.question}</div>
{predictions.prediction_form(experiment.predict, number)}
<button type="button" class="primary try">{escape(experiment.button)}</button>
<p class="verdict" role="status" hidden></p>
<details><summary>What to look for</summary>
{compared}<div class="observe">{experiment.observe}</div></details>
</section>
"""
