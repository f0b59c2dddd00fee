"""Random finite MDPs, for properties that hold of all."""

from dataclasses import replace

import hypothesis.strategies as st
import numpy as np

from labs.problems.finite_mdp import FiniteMDP


def random_mdp(
    seed: int, X: int, U: int, gamma: float, deterministic: bool, ends: bool
) -> FiniteMDP:
    """Costs in [-1, 1], sparse rows; with `ends` state 0 is terminal."""
    rng = np.random.default_rng(seed)
    C = rng.uniform(-1.0, 1.0, (X, U))
    terminal = np.zeros(X, bool)
    successor = rng.integers(X, size=(X, U)).astype(np.int32)
    if ends:
        terminal[0], C[0], successor[0] = True, 0.0, 0
    mdp = FiniteMDP(C, gamma, terminal, successor=successor)
    if deterministic:
        return mdp
    weights = rng.random((U, X, X)) * (rng.random((U, X, X)) < 0.4)
    P = mdp.probabilities + np.where(terminal[:, None], 0.0, weights)
    return replace(mdp, successor=None, P=P / P.sum(axis=2, keepdims=True))


@st.composite
def mdps(draw: st.DrawFn, highest: float = 0.99) -> FiniteMDP:
    """Of 1 to 8 states and 1 to 4 controls, gamma in [0, highest]."""
    return random_mdp(
        draw(st.integers(0, 2**32 - 1)),
        draw(st.integers(1, 8)),
        draw(st.integers(1, 4)),
        draw(st.floats(0.0, highest)),
        draw(st.booleans()),
        draw(st.booleans()),
    )
