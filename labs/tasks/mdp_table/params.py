"""Tunables that the labs which take a table have in common: its text, and published ones."""

from collections.abc import Mapping
from typing import Annotated

from labs.params import validated_by
from labs.tasks.mdp_table.table import parse_table
from labs.tunables import MAX_TEXT_LENGTH

TAXICAB = """from, action, to, probability, reward
A, cruise, A, 1/2, 10
A, cruise, B, 1/4, 4
A, cruise, C, 1/4, 8
A, stand, A, 1/16, 8
A, stand, B, 3/4, 2
A, stand, C, 3/16, 4
A, radio, A, 1/4, 4
A, radio, B, 1/8, 6
A, radio, C, 5/8, 4
B, cruise, A, 1/2, 14
B, cruise, C, 1/2, 18
B, stand, A, 1/16, 8
B, stand, B, 7/8, 16
B, stand, C, 1/16, 8
C, cruise, A, 1/4, 10
C, cruise, B, 1/4, 2
C, cruise, C, 1/2, 8
C, stand, A, 1/8, 6
C, stand, B, 3/4, 4
C, stand, C, 1/8, 2
C, radio, A, 3/4, 4
C, radio, B, 1/16, 0
C, radio, C, 3/16, 8"""
"""R. A. Howard's taxicab (Dynamic Programming and Markov Processes, 1960): three towns, and in B
no radio."""
EXAMPLE_TABLES: Mapping[str, str] = {"Taxicab": TAXICAB}

TABLE_LENGTH = MAX_TEXT_LENGTH
"""Characters: 100 states in wide form, and the dictionary P of FrozenLake's 64."""
TableText = Annotated[str, validated_by(parse_table)]
"""The type of a field of Params that holds a table; what is none is refused in a sentence."""
