"""What is plotted of a Markov chain, and the curves behind it."""

import numpy as np

from labs.algorithms.markov_chain import normalized_discounted_costs
from labs.plots import Bars, Curves, Line, Matrix, Note, Plot, Readout, TimeSeries, Trace
from labs.reinforcement_learning.markov.reward_process import RewardProcess

GAMMAS = np.concatenate([np.linspace(0.0, 0.95, 39), np.linspace(0.96, 1.0, 11)])

PLOTS: tuple[Plot, ...] = (
    Note("The chain in words", "chain"),
    Bars("Distribution now, and in the long run", "mu", r"\mu_k", "", marks="far", names="state"),
    TimeSeries(
        "Probability of each state",
        "",
        Line("mu", r"\mu"),
        Line("far", r"\text{long run}", "dash"),
        select="state",
    ),
    TimeSeries(
        "Share of the token's visits",
        "",
        Line("visited", r"f"),
        Line("far", r"\text{long run}", "dash"),
        select="state",
    ),
    Curves(
        "Eigenvalues of P",
        "Re λ",
        "Im λ",
        Trace("re", "im", style="points", series=1),
        guide="unit-circle",
    ),
    Matrix("Transition matrix", "P", "P", shade=True, rows="state"),
    Note("The value in words", "value"),
    Bars(
        "Cost-to-go by iteration, and exact",
        "V",
        r"V_k",
        "",
        marks="exact",
        gaps=True,
        names="state",
    ),
    Curves(
        "Error of the iteration",
        "iteration k",
        "error",
        Trace("sweep", "error", "max|Vₖ − V|", "line", 1),
        Trace("sweep", "bound", "γᵏ max|V₀ − V|", "dash", 2),
        log_y=True,
    ),
    Curves(
        "Mean cost (1 − γ) V over the discount",
        "γ",
        "mean cost",
        Trace("gammas", "means", "{state}", series=1),
        Trace("now", "span", "γ now", "dash", 2),
    ),
    Matrix("Action values, a row a state", "Q", r"Q", shade=True, rows="state"),
    Readout("steps", "Steps walked", "", whole=True),
    Readout("off", "μ off the long run", "%"),
    Readout("visits_off", "Visits off the long run", "%"),
    Readout("second", "|λ₂|", ""),
    Readout("step_cost", "Cost of a step, long run", ""),
    Readout("value", "V, chosen state", ""),
)


def discount_curves(process: RewardProcess, gamma: float) -> dict[str, np.ndarray]:
    """The mean cost of a step over the discount, of every state, and the line at the discount of
    now."""
    means = normalized_discounted_costs(process.P, process.C, GAMMAS, process.classes)
    return {
        "gammas": GAMMAS,
        "means": means,
        "now": np.full(2, gamma),
        "span": np.array([means.min(), means.max()]),
    }
