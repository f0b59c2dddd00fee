"""What a steady-state regulator asks of x+ = A x + B u with the cost x' Q x (notes, 2.4.2).

(A, B) is stabilizable iff [A - lambda I, B] has full row rank at every eigenvalue with
|lambda| >= 1 (Hautus test): every motion that does not decay can be acted on. Dually, Q detects
every unstable motion iff [A - lambda I; Q] has full column rank there: none is free of cost.
"""

import numpy as np

from labs.errors import LabError

NEGLIGIBLE = 1e-7
"""A singular value of at most this, A and the unit length of B or Q^(1/2) being the scale, counts
as zero; so does the distance of |lambda| to 1, to which double eigenvalues are computed."""


def hidden_modes(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The eigenvalues of A (n, n) with |lambda| >= 1 on which B (n, m) has no grip, (k,)."""
    size = np.linalg.norm(b)
    unit = b / size if size > 0.0 else b
    scale = max(1.0, float(np.abs(a).max()))
    found = []
    for eigenvalue in np.linalg.eigvals(a):
        if abs(eigenvalue) < 1.0 - NEGLIGIBLE:
            continue
        pencil = np.hstack([a - eigenvalue * np.eye(len(a)), unit])
        if np.linalg.svd(pencil, compute_uv=False)[-1] <= NEGLIGIBLE * scale:
            found.append(eigenvalue)
    return np.array(found)


def require_stabilizable(a: np.ndarray, b: np.ndarray) -> None:
    """Raises LabError naming an eigenvalue that no control can move."""
    hidden = hidden_modes(a, b)
    if len(hidden):
        raise LabError(
            f"(A, B) is not stabilizable: no control acts on the mode with eigenvalue "
            f"{shown(hidden[0])}, which does not decay; give B a part along it"
        )


def require_detectable(a: np.ndarray, q: np.ndarray) -> None:
    """Raises LabError naming an eigenvalue whose motion costs nothing. Q (n, n)."""
    share, directions = np.linalg.eigh(q)
    root = directions * np.sqrt(np.clip(share, 0.0, None))
    hidden = hidden_modes(a.T, root)
    if len(hidden):
        raise LabError(
            f"Q does not see the mode with eigenvalue {shown(hidden[0])}, which does not decay: "
            "a steady state needs a weight on it"
        )


def shown(eigenvalue: complex) -> str:
    """An eigenvalue in few digits, with its magnitude where it is not real."""
    if abs(eigenvalue.imag) <= NEGLIGIBLE:
        return f"{eigenvalue.real:.4g}"
    return f"{eigenvalue:.4g} of magnitude {abs(eigenvalue):.4g}"
