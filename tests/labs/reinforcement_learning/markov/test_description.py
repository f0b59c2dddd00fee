"""What is said of a chain is true of it."""

import pytest

from labs.reinforcement_learning.markov.chains import chain_table
from labs.reinforcement_learning.markov.description import describe_chain, describe_value
from labs.reinforcement_learning.markov.reward_process import (
    ChainEdit,
    RewardProcess,
    reward_process,
)


def process(name: str, first: float = 1.0, own: str = "state, A\nA, 1") -> RewardProcess:
    return reward_process(chain_table(name, 1, own), first, ChainEdit({}, 0, 0, 0.0))


@pytest.mark.parametrize(
    ("name", "said", "unsaid"),
    [
        ("student", ["Irreducible: every", "Aperiodic, one", "0.754: ", "2.4 steps"], ["Not"]),
        ("term", ["Not irreducible", "Nothing leads out of Sleep.", "Aperiodic, one"], ["closed"]),
        ("lights", ["Irreducible", "multiples of 4 steps. Four eigenvalues"], ["Aperiodic"]),
        (
            "doors",
            [
                "out of Desk and Sofa or out of Tick and Tock. Hall is left for good",
                "Two closed classes: P has the eigenvalue 1 twice",
                "ways back within Tick and Tock take multiples of 2 steps. Two eigenvalues",
            ],
            ["Irreducible", "Aperiodic"],
        ),
        ("machine", ["follow from the policy"], []),
    ],
)
def test_the_structure_in_words(name: str, said: list[str], unsaid: list[str]) -> None:
    text = describe_chain(process(name), 0, 0)
    for part in said:
        assert part in text
    for part in unsaid:
        assert part not in text


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("A,1/2,1/2\nB,1/2,1/2", "all others are 0"),
        ("A,0.99999,0.00001\nB,0.00001,0.99999", "forgotten very slowly"),
        ("A,0.6,0.4\nB,0.4,0.6", "0.200: what is left of the start halves within a step"),
        ("A,0,1\nB,0,1", "all others are 0"),
    ],
)
def test_how_fast_the_start_is_forgotten(rows: str, said: str) -> None:
    assert said in describe_chain(process("table", own=f"state,A,B\n{rows}"), 0, 1)


def test_a_single_state_has_no_other_eigenvalue() -> None:
    assert "there is no other" in describe_chain(process("table"), 0, 0)


def test_a_transition_that_does_not_exist_is_not_edited() -> None:
    assert "no state 7 in this chain" in describe_chain(process("student"), 0, 6)
    assert "no state" not in describe_chain(process("student"), 0, 5)


@pytest.mark.parametrize(
    ("name", "gamma", "said"),
    [
        ("student", 0.0, "γ = 0, myopic: V = C"),
        ("student", 0.9, "1/(1 − γ) = 10 steps ahead"),
        (
            "student",
            1.0,
            "From every state the chain never ends, and in the long run a step costs ",
        ),
        ("student", 1.0, " costs −0.412 on average"),
        ("term", 1.0, "V exists all the same: the chain is sure to end in Sleep, for nothing."),
        ("gambler", 1.0, "sure to end in Rich and Broke, for nothing."),
        ("doors", 1.0, "Their mean is 0, so that V = C + P V has infinitely many solutions"),
        ("machine", 0.9, "mend in Worn (37.5 < 49.1), mend in Broken (46.2 < 60)."),
    ],
)
def test_the_value_in_words(name: str, gamma: float, said: str) -> None:
    assert said in describe_value(process(name), gamma)


def test_only_gamma_one_is_singular() -> None:
    for gamma in (0.0, 0.5, 0.99):
        assert "singular" not in describe_value(process("student"), gamma)
    for name in ("student", "term", "lights", "doors"):
        assert "I − P is singular" in describe_value(process(name), 1.0)


def test_some_states_may_have_a_value_and_others_none() -> None:
    own = "state,cost,A,B,C\nA,1,0,1,0\nB,0,0,1,0\nC,-2,0,0,1"
    text = describe_value(process("table", own=own), 1.0)
    assert "From C the chain never ends, and in the long run a step costs −2 on average" in text


def test_a_policy_nothing_can_improve_on() -> None:
    own = "state,control,cost,A\nA,go,1,1\nA,stay,2,1"
    assert "No control is better" in describe_value(process("table", own=own), 0.5)
    worse = describe_value(process("table", first=0.0, own=own), 0.5)
    assert "go in A (3 < 4)." in worse


def test_who_can_end_is_told_of_every_state() -> None:
    """The graph decides: 0.1 / 0.7 + 0.4 / 0.7 + 0.2 / 0.7 is 1, and B can only come to A."""
    own = "state,cost,A,B,C,D\nA,0,1,0,0,0\nB,1,.2,.8,0,0\nC,1,.1,.4,.3,.2\nD,5,0,0,0,1"
    text = describe_value(process("table", own=own), 1.0)
    assert "From D the chain never ends, and in the long run a step costs 5 on average" in text
    assert "From C it may end or come to that: no finite value either." in text
    assert "From A and B V exists: the chain is sure to end in A, for nothing." in text


def test_a_small_mean_is_not_called_none() -> None:
    for cost, said in (("0.0004", "a step costs 0.0004 on average"), ("-1e-9", "costs −1e−09 on")):
        assert said in describe_value(process("table", own=f"state,cost,A\nA,{cost},1"), 1.0)
    # 0.1 + 0.2 - 0.3 is 5.6e-17 in floats.
    own = "state,cost,A,B,C\nA,.1,0,1,0\nB,.2,0,0,1\nC,-.3,1,0,0"
    assert "Their mean is 0" in describe_value(process("table", own=own), 1.0)


def test_means_that_cancel_between_ends_are_not_called_none() -> None:
    own = "state,cost,A,B,C\nA,0,0,.5,.5\nB,1,0,1,0\nC,-1,0,0,1"
    text = describe_value(process("table", own=own), 1.0)
    assert "From A, B and C the chain never ends" in text or "From every state the chain" in text
    assert "a step costs −1 to 1 on average" in text
    assert "infinitely many" not in text


def test_small_costs_have_better_controls_too() -> None:
    own = "state,control,cost,A\nA,go,1e-10,1\nA,stay,2e-10,1"
    assert "go in A (3e−10 < 4e−10)." in describe_value(process("table", first=0.0, own=own), 0.5)


def test_two_costs_that_differ_are_not_written_alike() -> None:
    own = "state,control,cost,A\nA,go,1,1\nA,stay,1.00001,1"
    text = describe_value(process("table", first=0.0, own=own), 0.5)
    assert "go in A (2.00001 < 2.00002)." in text


@pytest.mark.parametrize("leak", ["1e-5", "1e-12"])
def test_a_magnitude_below_1_is_not_rounded_to_1(leak: str) -> None:
    own = f"state,A,B\nA,{1.0 - float(leak)!r},{leak}\nB,{leak},{1.0 - float(leak)!r}"
    text = describe_chain(process("table", own=own), 0, 0)
    assert "the next is within 2" in text
    assert "of 1: the start is forgotten very slowly" in text
