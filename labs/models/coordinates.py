"""The words for a mechanism's coordinates: what moves, and in which units."""

from collections.abc import Mapping

from labs.models.mechanisms import Mechanism

JOINT_NAMES: Mapping[str, tuple[str, ...]] = {"cart-pole": ("cart", "pole"), "mass": ("block",)}
"""Where the parts have names; else they have numbers."""


def state_and_control_names(mechanism: Mechanism) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What each state (nx,) and each control (nu,) is called: "q_2", "the cart's v", "u"."""
    words = coordinate_labels(mechanism)
    q, v, u = (
        tuple(_coordinate_name(symbol, name, len(names)) for name in names)
        for symbol, names in zip(
            "qvu", (words["joint"], words["joint"], words["motor"]), strict=True
        )
    )
    return q + v, u


def _coordinate_name(symbol: str, name: str, of: int) -> str:
    if of == 1:
        return symbol
    return f"{symbol}_{name}" if name.isdigit() else f"the {name}'s {symbol}"


def coordinate_labels(mechanism: Mechanism) -> dict[str, tuple[str, ...]]:
    """For `Lab.labels`: the names of the joints and of the motors, and the units of each joint's
    position, of its velocity, and of each motor's control."""
    kinds = [joint.shortname() for joint in list(mechanism.model.joints)[1:]]
    slides = ["JointModelP" in kind for kind in kinds]
    names = JOINT_NAMES.get(mechanism.name, tuple(str(i + 1) for i in range(mechanism.nq)))
    driven = mechanism.actuated_joints
    numbered = tuple(str(i + 1) for i in range(len(driven)))
    return {
        "joint": names,
        "motor": tuple(names[i] for i in driven) if mechanism.name in JOINT_NAMES else numbered,
        "q_unit": tuple("m" if slide else "rad" for slide in slides),
        "v_unit": tuple("m/s" if slide else "rad/s" for slide in slides),
        "u_unit": tuple("N" if slides[i] else "N·m" for i in driven),
    }
