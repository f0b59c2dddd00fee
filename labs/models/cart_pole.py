"""A pole on a cart: a uniform rod hinged to a cart that slides along the world's y axis.

    q = (p, theta):  p [m] of the cart, theta [rad] of the pole, 0 hanging, pi upright

With the cart's mass M, the rod's mass m, l the distance to its centre of mass, I its inertia
there, and the force u [N] on the cart,

    (M + m) p'' + m l theta'' cos(theta) - m l theta'^2 sin(theta) = u
    m l p'' cos(theta) + (I + m l^2) theta'' + m g l sin(theta) = 0
"""

from functools import cache

import numpy as np
import pinocchio as pin

from labs.models.arms import Arm
from labs.shapes import (
    BLUE,
    DARK_GRAY,
    LIGHT_GRAY,
    ORANGE,
    Box,
    Cylinder,
    Sphere,
    primitive,
    translation,
)

CART_MASS, POLE_MASS, POLE_LENGTH, POLE_RADIUS = 1.0, 0.3, 0.6, 0.015
"""Masses of cart and rod [kg], length and radius of the rod [m]."""
HINGE_HEIGHT, HALF_RAIL_LENGTH = 0.75, 1.5
"""Of the hinge over the floor; half the rail's length [m]. The rail has no end stops."""


@cache
def cart_pole() -> Arm:
    """The cart with its pole, its tip the pole's free end."""
    model = pin.Model()
    model.name = "cart_pole"
    cart = model.addJoint(0, pin.JointModelPY(), translation(0.0, 0.0, HINGE_HEIGHT), "cart")
    hinge = model.addJoint(cart, pin.JointModelRX(), pin.SE3.Identity(), "hinge")
    middle, end = translation(0.0, 0.0, -POLE_LENGTH / 2), translation(0.0, 0.0, -POLE_LENGTH)
    box, below = (0.16, 0.24, 0.1), translation(-0.1, 0.0, 0.0)
    model.appendBodyToJoint(cart, pin.Inertia.FromBox(CART_MASS, *box), below)
    model.appendBodyToJoint(
        hinge, pin.Inertia.FromCylinder(POLE_MASS, POLE_RADIUS, POLE_LENGTH), middle
    )
    tip = model.addFrame(pin.Frame("tip", hinge, end, pin.FrameType.OP_FRAME))
    along = pin.SE3(pin.rpy.rpyToMatrix(-np.pi / 2, 0.0, 0.0), np.array([-0.1, 0.0, HINGE_HEIGHT]))
    axle = pin.SE3(pin.rpy.rpyToMatrix(0.0, np.pi / 2, 0.0), np.array([-0.02, 0.0, 0.0]))
    post = Box((0.05, 0.05, HINGE_HEIGHT))
    visuals = (
        primitive(0, along, Cylinder(0.018, 2 * HALF_RAIL_LENGTH), LIGHT_GRAY),
        *(
            primitive(0, translation(-0.1, y, HINGE_HEIGHT / 2), post, DARK_GRAY)
            for y in (-HALF_RAIL_LENGTH, HALF_RAIL_LENGTH)
        ),
        primitive(cart, below, Box(box), BLUE),
        primitive(cart, axle, Cylinder(0.02, 0.1), DARK_GRAY),
        primitive(hinge, middle, Cylinder(POLE_RADIUS, POLE_LENGTH), ORANGE),
        primitive(hinge, end, Sphere(2.2 * POLE_RADIUS), ORANGE),
    )
    return Arm(
        name="cart-pole",
        title="Cart-pole",
        model=model,
        home=np.zeros(2),
        torque_limit=np.array([20.0, np.inf]),
        tip=tip,
        visuals=visuals,
        collisions=visuals,
        camera=((3.4, 0.7, 1.4), (0.0, 0.0, 0.75)),
    )
