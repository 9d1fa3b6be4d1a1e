"""Link frames agree with the geometry, and with the joints that lead from one to the next."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snake_control.model.geometry import geometry, link_centers, link_points
from snake_control.model.link_frames import joint_quaternions, link_frames
from support.robots import ROBOTS


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_frames_are_where_the_geometry_has_the_links(robot):
    rng = np.random.default_rng(1)
    for _ in range(5):
        w = rng.uniform(-1.0, 1.0, 6)
        if robot.planar:
            w[2:5] = (robot.wheel_radius_m, 0.0, 0.0)
        q = np.concatenate((w, rng.uniform(-1.5, 1.5, robot.joints)))
        origins, quaternions = link_frames(robot, q)
        rotations = Rotation.from_quat(quaternions)
        np.testing.assert_allclose(origins, link_points(robot, q)[:-1], atol=1e-12)
        centers = origins + rotations.apply([-robot.half_length_m, 0.0, 0.0])
        np.testing.assert_allclose(centers, link_centers(geometry(robot, q)), atol=1e-12)
        turns = Rotation.from_quat(joint_quaternions(robot, q[6:]))
        step = rotations[1:] * (rotations[:-1] * turns).inv()
        assert step.magnitude() == pytest.approx(0.0, abs=1e-12)


def test_a_positive_angle_turns_about_the_joints_axis():
    robot = ROBOTS["paper"]
    turns = Rotation.from_quat(joint_quaternions(robot, np.full(robot.joints, 0.5)))
    assert robot.joint_axes[:2] == ("pitch", "yaw")
    np.testing.assert_allclose(turns.as_rotvec()[:2], [[0, 0.5, 0], [0, 0, 0.5]], atol=1e-12)
