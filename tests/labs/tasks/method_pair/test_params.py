"""One method, or two side by side."""

from labs.params import Group, Params
from labs.tasks.method_pair.params import chosen_methods, where_chosen

LEARNING = Group("Learning")
METHODS = {"sarsa": "SARSA", "traces": "Traces", "returns": "Returns"}


class PairParams(Params):
    """With a knob that two of the three methods have."""

    method: str = LEARNING.choice("sarsa", METHODS, "Method")
    """Learns."""
    second: str = LEARNING.choice("none", {"none": "None", **METHODS}, "Second")
    """Learns beside it."""
    decay: float = LEARNING.knob(0.5, 0.0, 1.0, "d", when=where_chosen("traces", "returns"))
    """Of both."""


def test_a_knob_acts_where_either_method_has_it() -> None:
    params = PairParams()
    assert not params.acts("decay")
    assert not params.change({"second": "sarsa"}).acts("decay")
    assert params.change({"second": "returns"}).acts("decay")
    assert params.change({"method": "traces"}).acts("decay")


def test_there_are_one_or_two_methods() -> None:
    assert chosen_methods("sarsa", "none") == ["sarsa"]
    assert chosen_methods("sarsa", "traces") == ["sarsa", "traces"]
    assert chosen_methods("sarsa", "sarsa") == ["sarsa", "sarsa"]
