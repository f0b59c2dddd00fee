"""What the user turns about Markov chains: the chain, its probabilities, its costs, the walk."""

from functools import lru_cache
from typing import Annotated

from labs.params import Group, Params, validated_by
from labs.reinforcement_learning.markov.chains import TITLES, chain_table, parse_rows
from labs.reinforcement_learning.markov.reward_process import (
    ChainEdit,
    RewardProcess,
    reward_process,
)
from labs.tasks.mdp_table.params import TABLE_LENGTH
from labs.tasks.mdp_table.table import parse_table

MAX_SHOWN_STATES = 12
"""States that a circle and a chooser still hold."""
STATE_NUMBERS = {str(x + 1): str(x + 1) for x in range(MAX_SHOWN_STATES)}

CONTROLLED = {"chain": ["machine", "table"]}
"""Chains that have several controls, or may have."""
EDITABLE = {"chain": [name for name in TITLES if name != "machine"]}
"""Chains that have one, or may have one."""

CHAIN = Group("Chain", effect="restart")
PROBABILITIES = Group("Probabilities", effect="solve")
COSTS = Group("Costs", effect="solve")
WALK = Group("Walk")


class MarkovParams(Params):
    """What the user can turn."""

    chain: str = CHAIN.choice("student", TITLES, "Chain", key=True)
    """The states, their probabilities and costs. The machine has two controls."""
    number: float = CHAIN.knob(
        1.0, 1.0, 41.0, "n", "", "Which random chain", step=1.0, key=True, when={"chain": "random"}
    )
    """Each number is another one of six states."""
    table: Annotated[str, validated_by(lambda text: parse_table(text, MAX_SHOWN_STATES))] = (
        CHAIN.text(
            "state, cost, Sun, Rain, Snow\nSun, 0, 2/3, 1/3, 0\nRain, 1, 1/2, 1/4, 1/4\n"
            "Snow, 3, 0, 1/2, 1/2",
            "Your table",
            rows=5,
            max_length=TABLE_LENGTH,
            when={"chain": "table"},
        )
    )
    """CSV: a heading (state, control if any, cost, the states), then a row each, or from, to,
    probability, cost; or JSON: [{"state": "A", "cost": 1, "to": {"A": 1}}]; or a file of such."""
    source: str = PROBABILITIES.choice("1", STATE_NUMBERS, "From state", key=True)
    """Whose beads lie on its ribbons; a click on a state's tile chooses it, too."""
    target: str = PROBABILITIES.choice("2", STATE_NUMBERS, "To state", key=True, when=EDITABLE)
    """Where the transition leads whose probability is shifted."""
    shift: float = PROBABILITIES.knob(
        0.0, -1.0, 1.0, "s", "", "Shift it", step=0.01, key=True, when=EDITABLE
    )
    """Down to -1: never. Up to 1: always. The others of its row keep their proportions."""
    rows: Annotated[str, validated_by(parse_rows)] = PROBABILITIES.text(
        "", "Changed rows", rows=3, max_length=1000, when=EDITABLE
    )
    """Beads that are dragged write here: a state and its weights, 1: 0 0.5 0.5. For chains without
    controls."""
    gamma: float = COSTS.knob(0.9, 0.0, 1.0, r"\gamma", "", "Discount", step=0.01, key=True)
    """What the cost of the next step counts today."""
    first: float = COSTS.knob(
        1.0, 0.0, 1.0, r"\pi(u_1 \mid x)", "", "First control", step=0.01, key=True, when=CONTROLLED
    )
    """How often the policy takes the first control of a table that has several, in every state; the
    others share what is left."""
    pace: float = WALK.knob(1.5, 0.2, 200.0, r"1/T", "1/s", "Steps a second", scale="log", key=True)
    """Of the token."""

    @property
    def chosen_states(self) -> tuple[int, int]:
        """The states chosen, from 0."""
        return int(self.source) - 1, int(self.target) - 1

    @property
    def process(self) -> RewardProcess:
        edit = (self.rows, *self.chosen_states, self.shift)
        return _process(self.chain, round(self.number), self.table, self.first, *edit)


@lru_cache(64)
def _process(
    name: str, number: int, own: str, first: float, rows: str, source: int, target: int, s: float
) -> RewardProcess:
    edit = ChainEdit(parse_rows(rows), source, target, s)
    return reward_process(chain_table(name, number, own), first, edit)
