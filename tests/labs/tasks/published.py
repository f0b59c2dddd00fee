"""Problems of books and courses, and an oracle that knows nothing of dynamic programming."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linprog


def optimal_rewards(P: np.ndarray, reward: np.ndarray, gamma: float) -> np.ndarray:
    """V* (X,), rewards maximised: the least V with V >= reward[:, u] + gamma P[u] V for all u,
    a linear programme."""
    U, X, _ = P.shape
    A = np.concatenate([gamma * P[u] - np.eye(X) for u in range(U)])
    b = np.concatenate([-reward[:, u] for u in range(U)])
    found = linprog(np.ones(X), A, b, bounds=(None, None), method="highs")
    assert found.status == 0
    return np.asarray(found.x)


def frozen_lake(rows: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """P (4, X, X) and rewards (X, 4) of FrozenLake as Gymnasium defines it: left, down, right, up;
    of three directions, the wanted one and the two beside it, each with 1/3."""
    height, width = len(rows), len(rows[0])
    P, reward = np.zeros((4, height * width, height * width)), np.zeros((height * width, 4))
    ways = [(0, -1), (1, 0), (0, 1), (-1, 0)]
    for row in range(height):
        for column in range(width):
            x = row * width + column
            for u in range(4):
                if rows[row][column] in "GH":
                    P[u, x, x] = 1.0
                    continue
                for b in (u - 1, u, u + 1):
                    down, right = ways[b % 4]
                    to = (
                        min(max(row + down, 0), height - 1),
                        min(max(column + right, 0), width - 1),
                    )
                    P[u, x, to[0] * width + to[1]] += 1 / 3
                    reward[x, u] += (rows[to[0]][to[1]] == "G") / 3
    return P, reward


LAKES = {
    "FrozenLake": ("SFFF", "FHFH", "FFFH", "HFFG"),
    "FrozenLake 8 x 8": (
        "SFFFFFFF", "FFFFFFFF", "FFFHFFFF", "FFFFFHFF",
        "FFFHFFFF", "FHHFFFHF", "FHFFHFHF", "FFFHFFFG",
    ),
}  # fmt: skip
UTILITIES = [[0.812, 0.868, 0.918, 0.0], [0.762, np.nan, 0.660, 0.0], [0.705, 0.655, 0.611, 0.388]]
"""Of the 4 x 3 world, as Russell and Norvig print them (their ends have their rewards in them)."""
TAXICAB = {"A": 121.65, "B": 135.31, "C": 122.84}
"""Of Howard's taxicab with the discount 0.9; the stand is best in all towns."""
