"""A mass on a line, the double integrator m p'' = u: regulated by LQR and by MPC."""

from functools import cache

import numpy as np
import pinocchio as pin

from labs.models.arms import Arm
from labs.models.cart_pole import HALF_RAIL_LENGTH
from labs.shapes import BLUE, DARK_GRAY, LIGHT_GRAY, Box, Cylinder, Vector3, primitive, translation

BLOCK_MASS = 1.0
"""[kg]"""


@cache
def mass_on_a_line(place: float = 0.0, color: Vector3 = BLUE) -> Arm:
    """A block of 1 kg that slides along the world's y axis, or along a line at x = `place` [m],
    without friction, driven by a force."""
    height, post, ends = 0.6, 0.48, (-HALF_RAIL_LENGTH, HALF_RAIL_LENGTH)
    model = pin.Model()
    model.name = "mass"
    block = model.addJoint(0, pin.JointModelPY(), translation(place, 0.0, height), "slide")
    size = (0.2, 0.2, 0.2)
    model.appendBodyToJoint(block, pin.Inertia.FromBox(BLOCK_MASS, *size), pin.SE3.Identity())
    tip = model.addFrame(pin.Frame("tip", block, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    along = pin.SE3(pin.rpy.rpyToMatrix(-np.pi / 2, 0.0, 0.0), np.array([place, 0.0, post]))
    visuals = (
        primitive(0, along, Cylinder(0.02, 2 * HALF_RAIL_LENGTH), LIGHT_GRAY),
        *(
            primitive(0, translation(place, y, post / 2), Box((0.05, 0.05, post)), DARK_GRAY)
            for y in ends
        ),
        primitive(block, pin.SE3.Identity(), Box(size), color),
    )
    return Arm(
        name="mass",
        title="Mass on a line",
        model=model,
        home=np.zeros(1),
        torque_limit=np.array([20.0]),
        tip=tip,
        visuals=visuals,
        collisions=visuals,
        camera=((2.2, 0.45, 1.1), (0.0, 0.0, 0.6)),
    )
