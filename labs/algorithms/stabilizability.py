"""What a steady-state regulator asks of x+ = A x + B u with the cost x' Q x (notes, 2.4.2).

(A, B) is stabilizable iff [A - lambda I, B] has full row rank at every eigenvalue with
|lambda| >= 1 (Hautus test): every motion that does not decay can be acted on. Dually, Q detects
every unstable motion iff [A - lambda I; Q] has full column rank there: none is free of cost.

Neither depends on the units of the coordinates, but a rank told by singular values does. So each
x_i is measured in a unit of its own, by how strongly B reaches it through A:

    d = sum_k (|A| / 2 rho)^k |B| 1,    rho the spectral radius of |A|

which has |A| d <= 2 rho d: in these units no row of A is larger than 2 rho. Where d_i = 0, no
path leads from B to x_i at all, and the eigenvalues of A over these coordinates are out of reach.
"""

import numpy as np

from labs.errors import LabError
from labs.problems.linear_quadratic import weight_roots

NEGLIGIBLE = 1e-7
"""A singular value of at most this, A and the unit length of B or Q^(1/2) being the scale, counts
as zero; so does the distance of |lambda| to 1, to which double eigenvalues are computed."""


def unstabilizable_modes(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The eigenvalues of A (n, n) with |lambda| >= 1 on which B (n, m) has no grip, (k,)."""
    unit = _state_units(a, b)
    near, far = unit > 0.0, unit == 0.0
    found = [value for value in _eigenvalues(a[np.ix_(far, far)]) if _does_not_decay(value)]
    unit = unit[near]
    a, b = a[np.ix_(near, near)] * unit / unit[:, None], b[near] / unit[:, None]
    b /= max(float(np.linalg.norm(b)), np.finfo(float).tiny)
    scale = max(1.0, float(np.abs(a).max(initial=0.0)))
    for value in _eigenvalues(a):
        if _does_not_decay(value):
            pencil = np.hstack([a - value * np.eye(len(a)), b])
            if np.linalg.svd(pencil, compute_uv=False)[-1] <= NEGLIGIBLE * scale:
                found.append(value)
    return np.array(found)


def require_stabilizable(a: np.ndarray, b: np.ndarray) -> None:
    """Raises LabError naming an eigenvalue that no control can move."""
    hidden = unstabilizable_modes(a, b)
    if len(hidden):
        raise LabError(
            f"(A, B) is not stabilizable: no control acts on the mode with eigenvalue "
            f"{eigenvalue_text(hidden[0])}, which does not decay; give B a part along it"
        )


def require_detectable(a: np.ndarray, q: np.ndarray) -> None:
    """Raises LabError naming an eigenvalue whose motion costs nothing. Q (n, n)."""
    hidden = unstabilizable_modes(a.T, weight_roots(q[None])[0].T)
    if len(hidden):
        raise LabError(
            f"Q does not see the mode with eigenvalue {eigenvalue_text(hidden[0])}, which does not "
            "decay: a steady state needs a weight on it"
        )


def eigenvalue_text(eigenvalue: complex) -> str:
    """An eigenvalue in few digits, with its magnitude where it is not real."""
    if abs(eigenvalue.imag) <= NEGLIGIBLE:
        return f"{eigenvalue.real:.4g}"
    return f"{eigenvalue:.4g} of magnitude {abs(eigenvalue):.4g}"


def _state_units(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """d (n,), its sum up to k = 2 n."""
    n, a = len(a), np.abs(a)
    spread = a / (2.0 * float(np.abs(np.linalg.eigvals(a)).max()) or 1.0)
    term = np.abs(b).sum(axis=1)
    unit: np.ndarray = term.copy()
    for _ in range(2 * n):
        term = spread @ term
        unit += term
    return unit


def _does_not_decay(eigenvalue: complex) -> bool:
    return abs(eigenvalue) >= 1.0 - NEGLIGIBLE


def _eigenvalues(a: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.eigvals(a)) if len(a) else np.zeros(0)
