"""Where the derivatives of a collocation's programme have entries, and what each is a sum of
(notes, 2.3.3: sparsity).

    c_y = D - T W f_z E,   with the column -W f of a free T;      L_zz = E' (L at the points) E
"""

import numpy as np
from scipy.sparse import csr_array

from labs.algorithms.assembly import Assembly, MatrixTerms, block_terms
from labs.algorithms.collocation_grid import CollocationGrid
from labs.problems.continuous_control import ContinuousProblem


def derivative_assemblies(
    problem: ContinuousProblem, grid: CollocationGrid, starts: np.ndarray, ends: np.ndarray
) -> tuple[Assembly, Assembly, Assembly]:
    """Of c_y, g_y and the Hessian. `starts`: where x_0, defects, the components `ends` of x_T, and
    e begin among the equalities, and how many there are.

    Their sources: of c_y a one, T f_z, W f if T is free, and e_x; of g_y the Jacobians at all
    nodes; of the Hessian that at the points, at the nodes, and if T is free, its cross terms."""
    free = problem.T_limits is not None
    n = grid.n + free
    first, last = grid.nodes[0], grid.nodes[-1]
    nx, points = len(first), grid.points
    b = nx + problem.dynamics.nu
    D, W, E = grid.D.tocoo(), grid.W.tocoo(), grid.E.tocoo()
    terms = [
        _constant_terms(starts[0] + np.arange(nx), first, np.ones(nx)),
        _constant_terms(starts[2] + np.arange(len(ends)), last[ends], np.ones(len(ends))),
        _constant_terms(starts[1] + D.row, D.col, D.data),
    ]
    of_W, of_E = _matching_pairs(W.col // nx, E.row // b, points)
    source = 1 + W.col[of_W] * b + E.row[of_E] % b
    terms.append(
        MatrixTerms(starts[1] + W.row[of_W], E.col[of_E], source, -W.data[of_W] * E.data[of_E])
    )
    sources = 1 + points * nx * b
    if free:
        rows = np.arange(grid.rows.size)
        by_T = np.full(len(rows), n - 1)
        terms.append(MatrixTerms(starts[1] + rows, by_T, sources + rows, np.full(len(rows), -1.0)))
        sources += len(rows)
    if problem.end:
        rows = np.arange(starts[3], starts[4])
        terms.append(block_terms(rows[None], last[None], sources))
        sources += rows.size * nx
    c_y = Assembly((int(starts[-1]), n), sources, *terms)

    each = problem.path.size if problem.path else 0
    by_node = np.arange(len(grid.nodes) * each).reshape(len(grid.nodes), each)
    g_y = Assembly((by_node.size, n), by_node.size * nx, block_terms(by_node, grid.nodes, 0))

    left, right = _matching_pairs(E.row // b, E.row // b, points)
    source = E.row[left] * b + E.row[right] % b
    terms = [
        MatrixTerms(E.col[left], E.col[right], source, E.data[left] * E.data[right]),
        block_terms(grid.nodes, grid.nodes, points * b * b),
    ]
    sources = points * b * b + len(grid.nodes) * nx * nx
    if free:
        by_T = np.full(E.nnz, n - 1)
        terms.append(MatrixTerms(E.col, by_T, sources + E.row, E.data))
        terms.append(MatrixTerms(by_T, E.col, sources + E.row, E.data))
        terms.append(_constant_terms(np.array([n - 1]), np.array([n - 1]), np.zeros(1)))
        sources += points * b
    return c_y, g_y, Assembly((n, n), sources, *terms)


def _constant_terms(rows: np.ndarray, columns: np.ndarray, coefficients: np.ndarray) -> MatrixTerms:
    """Constants: coefficients times the first source."""
    return MatrixTerms(rows, columns, np.zeros(len(rows), int), coefficients)


def _matching_pairs(
    left: np.ndarray, right: np.ndarray, keys: int
) -> tuple[np.ndarray, np.ndarray]:
    """All i, j with left[i] = right[j], out of so many keys."""
    by_left = csr_array((np.ones(len(left)), (np.arange(len(left)), left)), shape=(len(left), keys))
    by_right = csr_array(
        (np.ones(len(right)), (right, np.arange(len(right)))), shape=(keys, len(right))
    )
    found = (by_left @ by_right).tocoo()
    return found.row, found.col
