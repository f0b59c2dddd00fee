"""What the structure of a Markov reward process means, in sentences."""

import numpy as np

from labs.algorithms.markov_chain import CommunicatingClass, can_reach, is_irreducible
from labs.reinforcement_learning.markov.reward_process import RewardProcess
from labs.rounding import round_up

TIE_TOLERANCE = 1e-9
"""Values that differ by less are equal, relative to the largest of them and of the costs."""
ROUNDING = 1e-15
"""Of an eigenvalue near 1."""
ZERO_MEAN_TOLERANCE = 1e-12
"""A mean cost is 0 if it is smaller than this, relative to the mean of its magnitudes."""


def describe_chain(process: RewardProcess, source: int, target: int) -> str:
    """The structure of P, and whether it can be edited; a paragraph a line."""
    about = [
        *describe_structure(process),
        *process.table.notes,
        edit_error(process, source, target),
    ]
    return "\n".join(filter(None, about))


def describe_value(process: RewardProcess, gamma: float) -> str:
    """What the discount does to V, and the controls; a paragraph a line."""
    return "\n".join(
        filter(None, [describe_discount(process, gamma), describe_controls(process, gamma)])
    )


def describe_structure(process: RewardProcess) -> list[str]:
    """Irreducible or not, periodic or not, and how many stationary distributions there are."""
    names, classes = process.table.states, process.classes
    closed = [c for c in classes if c.closed]
    if is_irreducible(classes):
        text = ["Irreducible: every state leads to every other."]
    else:
        text = [
            "Not irreducible: not every state leads to every other. "
            + _describe_classes(names, classes)
        ]
    if len(closed) == 1:
        text.append(_describe_convergence(names, process.eigenvalues, closed[0]))
    else:
        text.append(
            f"{_count(len(closed))} closed classes: P has the eigenvalue 1 {_times(len(closed))}, "
            "and every mixture of their distributions is stationary. Where the walk begins (and "
            "its luck) decides."
        )
        text += [_describe_period(names, c) for c in closed if c.period > 1]
    return text


def describe_discount(process: RewardProcess, gamma: float) -> str:
    """What the discount does to V."""
    if gamma == 0.0:
        return "γ = 0, myopic: V = C, the next cost is all that counts."
    if gamma < 1.0:
        return (
            f"γ = {gamma} looks about 1/(1 − γ) = {1.0 / (1.0 - gamma):.3g} steps ahead. The "
            f"eigenvalues of γP stay within {gamma}, so I − γP is regular: V is unique."
        )
    names, found = process.table.states, process.cost_to_go(gamma)
    closed = [c for c in process.classes if c.closed]
    singular = "γ = 1: I − P is singular, for P has the eigenvalue 1. "
    if found.finite.all():
        ends = _join_names(names, np.concatenate([c.states for c in closed]))
        return (
            f"{singular}V exists all the same: the chain is sure to end in {ends}, for nothing. "
            "Put V = 0 there, and the system of the other states is regular."
        )
    return f"{singular}{_describe_infinite_cost(process, found.finite)} Take γ < 1."


def _describe_infinite_cost(process: RewardProcess, finite: np.ndarray) -> str:
    """From where costs go on for ever, from where they may, and from where they do not (`finite`):
    a matter of which states lead to which."""
    names, P = process.table.states, process.P
    free = can_reach(P, finite)
    never, may, sure = np.flatnonzero(~free), np.flatnonzero(free & ~finite), np.flatnonzero(finite)
    mean, size = (
        process.long_run @ process.C,
        process.long_run @ np.abs(process.C),
    )  # of a step, long run
    mean[np.abs(mean) <= ZERO_MEAN_TOLERANCE * size] = 0.0
    which = "every state" if len(never) == len(names) else _join_names(names, never)
    stays = np.concatenate([c.states for c in process.classes if c.closed])
    if not mean[stays].any():
        text = (
            f"From {which} costs come and go for ever. Their mean is 0, so that V = C + P V has "
            "infinitely many solutions, and the sum of costs need not settle."
        )
    else:
        rates = sorted(mean[never])
        grows = " to ".join(dict.fromkeys(_number(rate) for rate in (rates[0], rates[-1])))
        text = (
            f"From {which} the chain never ends, and in the long run a step costs {grows} on "
            "average: the sum of costs has no finite value."
        )
    if len(may):
        text += (
            f" From {_join_names(names, may)} it may end or come to that: no finite value either."
        )
    if len(sure):
        ends = _join_names(names, stays[finite[stays]])
        text += (
            f" From {_join_names(names, sure)} V exists: the chain is sure to end in {ends}, for "
        )
        text += "nothing."
    return text


def describe_controls(process: RewardProcess, gamma: float) -> str:
    """In which states one control would be cheaper than the policy; empty where there is no
    choice or no V."""
    table, found = process.table, process.cost_to_go(gamma)
    if len(table.controls) == 1 or not found.finite.all():
        return ""
    Q = process.action_values(gamma, found.V)
    best = Q.argmin(axis=1)
    tie = TIE_TOLERANCE * (np.abs(table.C).max() + np.abs(found.V).max())
    wins = np.flatnonzero(Q.min(axis=1) < found.V - tie)
    if not len(wins):
        return "No control is better than this policy: V = min Q in every state."
    phrases = [
        f"{table.controls[best[x]]} in {table.states[x]} "
        f"({_format_less(Q[x, best[x]], found.V[x])})"
        for x in wins
    ]
    return f"Once, and then the policy, is cheaper (Q < V): {', '.join(phrases)}."


def edit_error(process: RewardProcess, source: int, target: int) -> str:
    """Why the chosen transition cannot be edited; empty where it can."""
    if len(process.table.controls) > 1:
        return "These probabilities follow from the policy: they are changed in the table only."
    if process.can_edit(source, target):
        return ""
    missing = max(source, target) + 1
    return f"There is no state {missing} in this chain: choose a transition between its states."


def _describe_classes(names: tuple[str, ...], classes: list[CommunicatingClass]) -> str:
    closed = [_join_names(names, c.states) for c in classes if c.closed]
    passed = np.concatenate([c.states for c in classes if not c.closed] or [np.zeros(0, int)])
    text = f"Nothing leads out of {' or out of '.join(closed)}."
    if len(passed):
        leaves = "is left" if len(passed) == 1 else "are left"
        text += f" {_join_names(names, passed)} {leaves} for good sooner or later."
    return text


def _describe_convergence(
    names: tuple[str, ...], modes: np.ndarray, end: CommunicatingClass
) -> str:
    if end.period > 1:
        return _describe_period(names, end)
    magnitudes = np.abs(modes)
    second = float(magnitudes[1]) if len(magnitudes) > 1 else 0.0
    if len(magnitudes) == 1:
        speed = "and there is no other"
    elif second < 1e-6:
        speed = "all others are 0 to six digits: the start is soon forgotten altogether"
    elif second > 0.999:
        short = round_up(max(1.0 - second, ROUNDING))
        speed = f"the next is within {short} of 1: the start is forgotten very slowly"
    else:
        half = np.log(0.5) / np.log(second)
        speed = f"the next has magnitude {second:.3f}: what is left of the start halves " + (
            "within a step" if half < 1.0 else f"every {half:.2g} steps"
        )
    return (
        "Aperiodic, one stationary distribution π: μ converges to it from every start. One "
        f"eigenvalue of P is 1, {speed}."
    )


def _describe_period(names: tuple[str, ...], c: CommunicatingClass) -> str:
    where = "" if len(c.states) == len(names) else f" within {_join_names(names, c.states)}"
    return (
        f"Periodic: ways back{where} take multiples of {c.period} steps. {_count(c.period)} "
        "eigenvalues lie on the unit circle, and μ goes round for ever; only its mean over time "
        "settles."
    )


def _join_names(names: tuple[str, ...], states: np.ndarray) -> str:
    phrases = [names[x] for x in sorted(states)]
    return phrases[0] if len(phrases) == 1 else f"{', '.join(phrases[:-1])} and {phrases[-1]}"


def _number(value: float, digits: int = 3) -> str:
    return f"{value:.{digits}g}".replace("-", "−")


def _format_less(a: float, b: float) -> str:
    """a < b, in as many digits as it takes to see it."""
    digits = next((d for d in range(3, 17) if f"{a:.{d}g}" != f"{b:.{d}g}"), 17)
    return f"{_number(a, digits)} < {_number(b, digits)}"


def _times(n: int) -> str:
    return "twice" if n == 2 else f"{n} times"


def _count(n: int) -> str:
    words = ("No", "One", "Two", "Three", "Four", "Five", "Six")
    return words[n] if n < len(words) else str(n)
