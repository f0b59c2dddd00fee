"""Linear dynamics with a quadratic cost over N steps, as a problem (notes, 2.4.3 to 2.4.5).

With z = (x, u, 1), all in SI units,

    minimise    J = sum over t < N of  z_t' [Q_t S_t q_t; S_t' R_t s_t; q_t' s_t' w_t] z_t
                    + x_N' Q_f x_N + 2 q_N' x_N + w_N
    subject to  x_(t+1) = A_t x_t + B_t u_t + c_t,   x_0 given.

Its policy is u_t = K_t x_t + k_t and its value function V_t(x) = x' P_t x + 2 p_t' x + v_t;
`riccati.py` finds them. In the augmented state (x, 1) the same problem has neither linear nor
constant terms (2.4.4): [A c; 0 1], [B; 0], [Q q; q' w], [S; s'], R, [Q_f q_N; q_N' w_N].
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from labs.errors import LabError

NEGLIGIBLE = 1e-9
"""An asymmetry or a negative eigenvalue of at most this, of a weight scaled to a diagonal of ones,
is rounding."""
ROUNDING = 1e-13
"""An eigenvalue of at most this, likewise, is zero."""


@dataclass(frozen=True, eq=False)
class LqrProblem:
    """What to regulate over N steps. A term is one array for all t, or has a first axis of
    length N. Raises LabError where shapes do not fit, numbers are not finite, a weight is not
    symmetric, R_t is not positive definite, or Q_f or [Q_t S_t; S_t' R_t] not semidefinite."""

    horizon: int
    """N >= 1."""
    a: np.ndarray
    """A (n, n) or (N, n, n)."""
    b: np.ndarray
    """B (n, m) or (N, n, m)."""
    q: np.ndarray
    """Q (n, n) or (N, n, n): the weight of the state."""
    r: np.ndarray
    """R (m, m) or (N, m, m): the weight of the control."""
    q_final: np.ndarray
    """Q_f (n, n)."""
    s: np.ndarray | None = None
    """S (n, m) or (N, n, m): the cross term 2 x' S u. Left out it is zero, like all below."""
    c: np.ndarray | None = None
    """c (n,) or (N, n): what the dynamics add to x at each step."""
    q_linear: np.ndarray | None = None
    """q (n,) or (N, n): the linear term 2 q' x."""
    s_linear: np.ndarray | None = None
    """s (m,) or (N, m): the linear term 2 s' u."""
    constant: np.ndarray | None = None
    """w () or (N,): moves the cost, not the policy."""
    q_final_linear: np.ndarray | None = None
    """q_N (n,)."""
    constant_final: float = 0.0
    """w_N."""

    def __post_init__(self) -> None:
        if self.horizon < 1:
            raise LabError(f"the horizon is N = {self.horizon}: it takes at least one step")
        for name, shape in self._shapes.items():
            if (given := getattr(self, name)) is not None:
                check_shape(name, given, shape, 0 if "final" in name else self.horizon)
        terms = self.terms
        check_weight("R", terms["r"], definite=True)
        if self.s is None:
            check_weight("Q", terms["q"])
        else:
            q, s, r = terms["q"], terms["s"], terms["r"]
            check_weight("[Q S; S' R]", _block_matrices([[q, s], [s.transpose(0, 2, 1), r]]))
        check_weight("Q_f", terms["q_final"])

    @property
    def n(self) -> int:
        return int(self.a.shape[-1])

    @property
    def m(self) -> int:
        return int(self.b.shape[-1])

    @property
    def homogeneous(self) -> bool:
        """Whether neither dynamics nor cost have linear or constant terms."""
        added = (self.c, self.q_linear, self.s_linear, self.constant, self.q_final_linear)
        return all(term is None for term in added) and self.constant_final == 0.0

    @cached_property
    def terms(self) -> dict[str, np.ndarray]:
        """Every term by its name here, with a first axis of length N or 1; those left out are
        zero."""
        terms = {}
        for name, shape in self._shapes.items():
            given = getattr(self, name)
            array = np.zeros(shape) if given is None else np.asarray(given, float)
            terms[name] = np.ascontiguousarray(array if array.ndim > len(shape) else array[None])
        return terms

    def augmented(self) -> dict[str, np.ndarray]:
        """a, b, q, r, s and q_final of the same problem in the state (x, 1), shaped as `terms`."""
        terms, one = self.terms, np.ones((1, 1, 1))
        column = {name: terms[name][:, :, None] for name in ("c", "q_linear", "q_final_linear")}
        row = {name: terms[name][:, None, :] for name in ("q_linear", "s_linear", "q_final_linear")}
        constant = terms["constant"][:, None, None]
        final = [row["q_final_linear"], self.constant_final * one]
        return {
            "a": _block_matrices([[terms["a"], column["c"]], [np.zeros((1, 1, self.n)), one]]),
            "b": _block_matrices([[terms["b"]], [np.zeros((1, 1, self.m))]]),
            "q": _block_matrices([[terms["q"], column["q_linear"]], [row["q_linear"], constant]]),
            "r": terms["r"],
            "s": _block_matrices([[terms["s"]], [row["s_linear"]]]),
            "q_final": _block_matrices([[terms["q_final"], column["q_final_linear"]], final]),
        }

    def cost(self, x: np.ndarray, u: np.ndarray) -> float:
        """J of a trajectory: x (N + 1, n), u (N, m)."""
        terms, end = self.terms, x[-1]
        stage = (
            np.einsum("ti,tij,tj->t", x[:-1], _broadcast(terms["q"], self.horizon), x[:-1])
            + np.einsum("ti,tij,tj->t", u, _broadcast(terms["r"], self.horizon), u)
            + 2.0 * np.einsum("ti,tij,tj->t", x[:-1], _broadcast(terms["s"], self.horizon), u)
            + 2.0 * (terms["q_linear"] * x[:-1]).sum(axis=1)
            + 2.0 * (terms["s_linear"] * u).sum(axis=1)
            + terms["constant"]
        )
        last = end @ terms["q_final"][0] @ end + 2.0 * terms["q_final_linear"][0] @ end
        return float(stage.sum() + last + self.constant_final)

    def rollout(self, policy: "LqrPolicy", x0: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x (N + 1, n) and u (N, m) from x0 (n,) under the policy."""
        a, b, c = (_broadcast(self.terms[name], self.horizon) for name in "abc")
        x, u = np.zeros((self.horizon + 1, self.n)), np.zeros((self.horizon, self.m))
        x[0] = x0
        for t in range(self.horizon):
            u[t] = policy.control(x[t], t)
            x[t + 1] = a[t] @ x[t] + b[t] @ u[t] + c[t]
        return x, u

    @cached_property
    def _shapes(self) -> dict[str, tuple[int, ...]]:
        """Of each term at one step."""
        for name, array in (("a", self.a), ("b", self.b)):
            if np.ndim(array) not in (2, 3):
                raise LabError(
                    f"{name} has shape {np.shape(array)}: it takes a matrix, or N of them"
                )
        n, m = self.n, self.m
        matrices = {"a": (n, n), "b": (n, m), "q": (n, n), "r": (m, m), "q_final": (n, n)}
        vectors = {"c": (n,), "q_linear": (n,), "s_linear": (m,), "q_final_linear": (n,)}
        return matrices | vectors | {"s": (n, m), "constant": ()}


@dataclass(frozen=True, eq=False)
class LqrPolicy:
    """u_t = K_t x_t + k_t and what it costs, V_t(x) = x' P_t x + 2 p_t' x + v_t."""

    gains: np.ndarray
    """K (N, m, n)."""
    values: np.ndarray
    """P (N + 1, n, n), symmetric."""
    offsets: np.ndarray
    """k (N, m)."""
    linear: np.ndarray
    """p (N + 1, n)."""
    constants: np.ndarray
    """v (N + 1,)."""

    def control(self, x: np.ndarray, t: int) -> np.ndarray:
        """u_t (m,) where x_t = x (n,)."""
        u: np.ndarray = self.gains[t] @ x + self.offsets[t]
        return u

    def value(self, x: np.ndarray, t: int = 0) -> float:
        """V_t(x): the cost from step t on where x_t = x (n,)."""
        quadratic = x @ self.values[t] @ x
        return float(quadratic + 2.0 * self.linear[t] @ x + self.constants[t])


def tracking_problem(
    horizon: int,
    dynamics: tuple[np.ndarray, np.ndarray, np.ndarray | None],
    weights: tuple[np.ndarray, np.ndarray, np.ndarray],
    x_ref: np.ndarray,
    u_ref: np.ndarray,
) -> LqrProblem:
    """Follow x_ref (N + 1, n) and u_ref (N, m): the sum over t < N of
    (x - x_ref)' Q (x - x_ref) + (u - u_ref)' R (u - u_ref), plus the same at N with Q_f, has
    q = -Q x_ref, s = -R u_ref, w = x_ref' Q x_ref + u_ref' R u_ref. The dynamics are (A, B, c),
    c None where there is none; the weights are (Q, R, Q_f). Raises LabError as LqrProblem does."""
    (a, b, c), (q, r, q_final) = dynamics, weights
    n, m = np.shape(a)[-1], np.shape(b)[-1]
    for name, given, shape in (
        ("x_ref", x_ref, (horizon + 1, n)),
        ("u_ref", u_ref, (horizon, m)),
        ("q_final", q_final, (n, n)),
    ):
        check_shape(name, given, shape)
    check_shape("q", q, (n, n), horizon)
    check_shape("r", r, (m, m), horizon)
    from_x = np.einsum("...ij,...j->...i", q, x_ref[:-1])
    from_u = np.einsum("...ij,...j->...i", r, u_ref)
    end = q_final @ x_ref[-1]
    return LqrProblem(
        horizon=horizon,
        a=a,
        b=b,
        q=q,
        r=r,
        q_final=q_final,
        c=c,
        q_linear=-from_x,
        s_linear=-from_u,
        constant=(x_ref[:-1] * from_x).sum(axis=1) + (u_ref * from_u).sum(axis=1),
        q_final_linear=-end,
        constant_final=float(x_ref[-1] @ end),
    )


def check_shape(name: str, array: np.ndarray, shape: tuple[int, ...], horizon: int = 0) -> None:
    """Raises LabError unless the array has this shape, or `horizon` times it, and is finite."""
    allowed = (shape, (horizon, *shape)) if horizon else (shape,)
    if np.shape(array) not in allowed:
        takes = " or ".join(map(str, allowed))
        raise LabError(f"{name} has shape {np.shape(array)}: it takes {takes}")
    if not np.isfinite(array).all():
        raise LabError(f"{name} has entries that are not finite numbers: it takes only such")


def check_weight(name: str, stack: np.ndarray, definite: bool = False) -> None:
    """Raises LabError unless each of the matrices (k, n, n) is symmetric and positive
    semidefinite, or definite. What is rounding is told in the units that make the diagonal one."""
    units = unit_scale(stack)
    scaled = units[:, :, None] * stack * units[:, None, :]
    skew = np.abs(scaled - scaled.transpose(0, 2, 1)) > NEGLIGIBLE
    if skew.any():
        apart = np.abs(stack - stack.transpose(0, 2, 1))[skew].max()
        raise LabError(f"{name} is not symmetric: entries differ by {apart:.3g} across it")
    least, size = np.linalg.eigvalsh(scaled)[:, 0], np.abs(scaled).max(axis=(1, 2))
    if definite and (least <= 0.0).any():
        raise LabError(
            f"{name} has an eigenvalue {_least_eigenvalue(stack):.3g}: it takes a positive "
            "definite matrix, all eigenvalues above zero"
        )
    if (least < -NEGLIGIBLE * size).any():
        raise LabError(
            f"{name} has an eigenvalue {_least_eigenvalue(stack):.3g}: it takes a positive "
            "semidefinite matrix, no eigenvalue below zero"
        )


def unit_scale(stack: np.ndarray) -> np.ndarray:
    """Units d (k, n) in which d_i W_ij d_j has ones on its diagonal, or minus ones; 1 where the
    matrices W (k, n, n) have a zero there."""
    diagonal = np.abs(np.einsum("kii->ki", stack))
    return np.asarray(1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)))


def weight_roots(stack: np.ndarray) -> np.ndarray:
    """Matrices V (k, n, n) with V' V = W of semidefinite W (k, n, n), each entry to the accuracy
    of its own row: by the eigenvectors of W in units that make its diagonal one."""
    units = unit_scale(stack)
    share, directions = np.linalg.eigh(units[:, :, None] * stack * units[:, None, :])
    share[share <= ROUNDING] = 0.0
    scaled = np.sqrt(share)[:, :, None] * directions.transpose(0, 2, 1)
    roots: np.ndarray = scaled / units[:, None, :]
    return roots


def _least_eigenvalue(stack: np.ndarray) -> float:
    """The least eigenvalue."""
    return float(np.linalg.eigvalsh(stack).min())


def _broadcast(stack: np.ndarray, horizon: int) -> np.ndarray:
    """The terms (N or 1, ...) as a view of N of them."""
    return np.broadcast_to(stack, (horizon, *stack.shape[1:]))


def _block_matrices(rows: Sequence[Sequence[np.ndarray]]) -> np.ndarray:
    """Stacks of matrices (k or 1, ., .) put together as the blocks of larger ones."""
    steps = max(len(part) for row in rows for part in row)
    joined = [np.concatenate([_broadcast(part, steps) for part in row], axis=2) for row in rows]
    return np.concatenate(joined, axis=1)
