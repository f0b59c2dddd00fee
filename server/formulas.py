"""TeX to MathML."""

import re
from functools import lru_cache

import math_core

from labs.errors import LabError

_math = math_core.LatexToMathML(fancy_error=False)


class ArticleError(LabError):
    """An article has bad TeX, or an experiment its lab cannot run."""


@lru_cache(maxsize=1024)
def tex_to_mathml(source: str, display: bool = False) -> str:
    """MathML of a TeX formula. Raises ArticleError."""
    try:
        return _math.convert_with_local_state(source, displaystyle=display)
    except math_core.LatexError as error:
        reason = re.sub(r"\x1b\[[0-9;]*m", "", str(error)).strip()
        raise ArticleError(f"bad TeX {source!r}: {reason}") from None
