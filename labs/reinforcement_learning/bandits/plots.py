"""What bandits plot, and the curves behind it."""

import numpy as np

from labs.plots import Bars, Curves, Plot, Readout, Trace
from labs.reinforcement_learning.bandits.game import Game
from labs.reinforcement_learning.bandits.params import KINDS_WITH_TEST, BanditParams

ORDER = ("first", "second")
WINDOW = 20
"""Turns over which the share of best choices is averaged."""
POINTS = 500
"""Of a curve over turns, at most."""
WITH_TEST = {"kind": KINDS_WITH_TEST}


def _curves(title: str, x: str, y: str, x_label: str, y_label: str) -> Curves:
    """One of each player."""
    return Curves(title, x_label, y_label, Trace(x, y, "{players}", series=1))


PLOTS: tuple[Plot, ...] = (
    _curves("Regret", "turns", "regret", "turns", "regret"),
    _curves("Best choices", "turns", "best", "turns", "% of the tasks"),
    _curves("Regret that counts", "turns", "counted", "turns", "regret"),
    _curves("Regret of each task, sorted", "share", "sorted", "% of the tasks", "regret"),
    _curves("Regret of the door that seems best", "after", "simple", "turns", "per turn"),
    Bars("Choices of blue", "choices_first", "n", "", names="doors"),
    Bars("Choices of orange", "choices_second", "n", "", names="doors"),
    Readout("turn", "Turn", "", whole=True),
    Readout("counted_first", "Regret that counts, {first}", ""),
    Readout("counted_second", "Regret that counts, {second}", ""),
    Readout("lessons_first", "Regret of the lessons, {first}", "", when=WITH_TEST),
    Readout("lessons_second", "Regret of the lessons, {second}", "", when=WITH_TEST),
    Readout("best_first", "Best choices at the end, {first}", "%"),
    Readout("best_second", "Best choices at the end, {second}", "%"),
    Readout("simple_first", "Regret of what seems best, {first}", ""),
    Readout("simple_second", "Regret of what seems best, {second}", ""),
)


def counted_regret(params: BanditParams, game: Game) -> np.ndarray:
    """(P, t) the part of the mean regret that counts: online all of it, else that of the test."""
    regrets, lessons = game["regrets"], params.training_turns
    if params.kind not in KINDS_WITH_TEST:
        return regrets
    before = regrets[:, min(lessons, regrets.shape[1]) - 1, None] if regrets.size else 0.0
    return np.asarray(np.maximum(regrets - before, 0.0))


def regret_readouts(params: BanditParams, game: Game) -> dict[str, float]:
    """The tiles: where the game stands."""
    shown = {"turn": float(game["regrets"].shape[1])}
    if shown["turn"]:
        counts = counted_regret(params, game)[:, -1]
        taught = game["regrets"][:, : params.training_turns][:, -1]
        for p, name in enumerate(ORDER):
            shown[f"counted_{name}"] = float(counts[p])
            shown[f"lessons_{name}"] = float(taught[p])
            shown[f"best_{name}"] = 100.0 * float(game["best"][p, -100:].mean())
            shown[f"simple_{name}"] = float(game["simple"][p, -1])
    return shown


def regret_curves(params: BanditParams, game: Game) -> dict[str, np.ndarray]:
    """All curves; the choices in one task."""
    turns = game["regrets"].shape[1]
    every = np.arange(0, turns, max(1, -(-turns // POINTS)))
    found = {
        "turns": every + 1.0,
        "after": game["after"],
        "share": np.linspace(0.0, 100.0, game["regret"].shape[1]),
        "regret": game["regrets"][:, every].T,
        "counted": counted_regret(params, game)[:, every].T,
        "best": 100.0 * _moving_average(game["best"])[:, every].T,
        "sorted": np.sort(game["regret"]).T,
        "simple": game["simple"].T,
    }
    for p, name in enumerate(ORDER):
        found[f"choices_{name}"] = game["visits"][p, params.shown].astype(float)
    return found


def _moving_average(curves: np.ndarray) -> np.ndarray:
    """Each point of curves (P, t) the mean of itself and up to WINDOW - 1 before it."""
    sums = np.pad(np.cumsum(curves, axis=1), ((0, 0), (1, 0)))
    end = np.arange(1, curves.shape[1] + 1)
    begin = np.maximum(end - WINDOW, 0)
    return np.asarray((sums[:, end] - sums[:, begin]) / (end - begin))
