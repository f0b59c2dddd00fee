"""What differential-kinematics draws: columns, ellipsoids and the warning, as they are."""

import numpy as np
import pytest

from labs.params import Value
from labs.reactive_control.differential_kinematics.lab import SINGULARITY_WARNING
from labs.reactive_control.differential_kinematics.picture import (
    COLUMN,
    FORCE_ELLIPSOID_SCALE,
    VELOCITY_ELLIPSOID_SCALE,
)
from tests.labs.reactive_control.differential_kinematics.runs import (
    LAB,
    Arrows,
    fields,
    sigma_min,
)


def test_columns_are_drawn_as_they_are() -> None:
    for robot, n in (("ur5", 6), ("panda", 7), ("scara", 4)):
        drawn, found = Arrows({}, robot=robot), fields({}, robot=robot)["geometric"]
        assert sum(name.startswith("axis") for name in drawn.vectors) == n
        for name, (tail, head) in drawn.vectors.items():
            if name.startswith("column"):
                column = found[:3, int(name.split()[1]) - 1]
                np.testing.assert_allclose(head - tail, COLUMN * column, atol=1e-14)
    single = Arrows({}, columns="2")
    assert {"axis 2", "column 2", "lever"} <= set(single.names)
    assert "axis 1" not in single.names
    of_elbow = Arrows({}, frame="joint-3")
    assert {"axis 1", "axis 2", "axis 3"} <= set(of_elbow.names)
    assert "axis 4" not in of_elbow.names


def test_ellipsoids_hold_all_velocities_and_forces_of_unit_effort() -> None:
    drawn, linear = Arrows({}, ellipsoid="both"), fields({})["geometric"][:3]
    rng = np.random.default_rng(4)
    for _ in range(100):
        rates = rng.normal(size=6)
        velocity = VELOCITY_ELLIPSOID_SCALE * linear @ (rates / np.linalg.norm(rates))
        assert np.linalg.norm(np.linalg.solve(drawn.axes["velocities"], velocity)) <= 1 + 1e-12
        force = rng.normal(size=3)
        force *= FORCE_ELLIPSOID_SCALE / np.linalg.norm(linear.T @ force)
        on = np.linalg.norm(np.linalg.solve(drawn.axes["forces"], force))
        assert on == pytest.approx(1.0, rel=1e-12)


def test_the_warning_stands_where_the_distance_is_small() -> None:
    for q4 in np.linspace(-2.0, 1.0, 16):
        setting: dict[str, Value] = {"q2": 0.7, "q3": -1.55, "q4": round(float(q4), 2)}
        near = sigma_min(setting) < SINGULARITY_WARNING
        assert ("warning" in Arrows(setting).names) == near


def test_a_wrist_aligned_is_singular_for_poses_only() -> None:
    preset = LAB.presets["Wrist of the UR5 aligned"]
    assert sigma_min(preset) < 1e-3
    assert sigma_min(preset, task="position") > 0.2
