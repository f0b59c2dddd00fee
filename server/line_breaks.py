"""Where a display formula may break. MathML does not break by itself: a formula is set as several
pieces of mathematics, between which the browser breaks a line where the column is too narrow."""

import re
from collections.abc import Iterator

TOKENS = re.compile(r"\\(?:[a-zA-Z]+|.)|\s+|.", re.DOTALL)


def _set(tokens: str) -> frozenset[str]:
    return frozenset(TOKENS.findall(tokens))


RELATIONS = _set(r"=<>\le\ge\leq\geq\ll\gg\approx\Rightarrow\iff\leftarrow\succ\succeq")
SIGNS, SPACES, BARS = _set("+-"), _set(r"\quad\qquad"), _set(r"|\|")
OPENING, CLOSING = _set(r"([{\{\lVert\lvert\begin"), _set(r")]}\}\rVert\rvert\end")


def split_statements(source: str) -> list[list[str]]:
    """The statements of a TeX formula, which `\\quad` or `\\qquad` part, each as pieces that begin
    with a relation or a sign: `a = b + c \\quad d = e` is `[["a", "= b", "+ c"], ["d", "= e"]]`.
    What stands in brackets, bars or an environment stays whole."""
    found: list[list[str]] = [[""]]
    for token, where in _classify_tokens(source):
        if where == "statement":
            found.append([""])
        elif where == "piece" and found[-1][-1].strip():
            # An empty group in front: the sign keeps the space of one between two terms.
            found[-1].append("{}" + token)
        else:
            found[-1][-1] += token
    return [[piece.strip() for piece in pieces] for pieces in found if "".join(pieces).strip()]


def _classify_tokens(source: str) -> Iterator[tuple[str, str]]:
    """Every token, with what begins at it: "statement", "piece" or nothing."""
    open_: list[str] = []
    before = ""
    for token in TOKENS.findall(source):
        where = ""
        if token in OPENING:
            open_.append(token)
        elif token in CLOSING:
            while open_ and open_.pop() in BARS:
                pass
        elif token in BARS:
            open_.pop() if open_[-1:] == [token] else open_.append(token)
        elif not open_ and token in SPACES:
            where = "statement"
        elif not open_ and _begins_piece(token, before):
            where = "piece"
        yield token, where
        if token.strip():
            before = token


def _begins_piece(token: str, before: str) -> bool:
    if token in RELATIONS:
        return before not in ("", "^", "_")
    ends_term = before not in RELATIONS | SIGNS and before not in ("", "^", "_", ",")
    return token in SIGNS and ends_term
