"""Tunables of labs in which one method learns, or two side by side: the choices `method` and
`second`, which may be none."""

from labs.tunables import Condition


def where_chosen(*names: str) -> Condition:
    """Where `method` or `second` is one of these."""
    return ({"method": names}, {"second": names})


def chosen_methods(method: str, second: str) -> list[str]:
    """The names of one or two methods."""
    return [method] if second == "none" else [method, second]
