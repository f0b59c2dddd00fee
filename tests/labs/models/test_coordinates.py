"""Each mechanism's own words, and no other's."""

import pytest

from labs.models.coordinates import coordinate_labels, state_and_control_names
from labs.models.mechanisms import MECHANISMS, mechanism


@pytest.mark.parametrize("name", MECHANISMS)
def test_there_is_a_word_for_each_joint_and_motor(name: str) -> None:
    body = mechanism(name)
    said = coordinate_labels(body)
    assert len(said["joint"]) == len(said["q_unit"]) == len(said["v_unit"]) == body.nq
    assert len(said["motor"]) == len(said["u_unit"]) == body.nu


def test_a_cart_slides_and_a_pole_turns() -> None:
    said = coordinate_labels(mechanism("cart-pole"))
    assert said["joint"] == ("cart", "pole")
    assert said["q_unit"] == ("m", "rad")
    assert said["u_unit"] == ("N",)


def test_states_and_controls_are_called_as_on_the_page() -> None:
    assert state_and_control_names(mechanism("pendulum")) == (("q", "v"), ("u",))
    x, u = state_and_control_names(mechanism("cart-pole"))
    assert x == ("the cart's q", "the pole's q", "the cart's v", "the pole's v")
    assert u == ("u",)
    x, u = state_and_control_names(mechanism("ur5"))
    assert (x[1], x[7], u[5]) == ("q_2", "v_2", "u_6")
