"""Geometry and constraints against first principles, and the structure that the paper claims."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snake_control.errors import ModelError
from snake_control.model.constraints import constraint_matrix
from snake_control.model.geometry import geometry, link_centers, link_points, wheel_contacts
from snake_control.model.redundancy import joint_velocities, kinematics
from snake_control.model.structure import structure
from support.robots import PAPER, ROBOTS, random_q

ALL = pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))


def frames(robot, q):
    """Rotation and front end of every link, straight from the conventions, with scipy."""
    rotation = Rotation.from_euler("ZYX", [q[5], q[4], q[3]])
    point = np.array(q[:3])
    found = [(rotation.as_matrix(), point)]
    for joint, axis in enumerate(robot.joint_axes):
        point = point - 2 * robot.half_length_m * rotation.as_matrix()[:, 0]
        rotation = rotation * Rotation.from_euler({"pitch": "y", "yaw": "z"}[axis], q[6 + joint])
        found.append((rotation.as_matrix(), point))
    return found


@ALL
def test_link_points_and_wheels(robot):
    q = random_q(robot, 7)
    expected = frames(robot, q)
    points = link_points(robot, q)
    np.testing.assert_allclose(points[:-1], [point for _, point in expected], atol=1e-12)
    centers = [point - robot.half_length_m * rotation[:, 0] for rotation, point in expected]
    np.testing.assert_allclose(link_centers(geometry(robot, q)), centers, atol=1e-12)
    contacts = wheel_contacts(geometry(robot, q))
    for row, link in zip(contacts, robot.wheeled_links, strict=True):
        side = robot.wheel_offset_m * expected[link - 1][0][:, 1]
        np.testing.assert_allclose(row[0], (centers[link - 1] + side)[:2], atol=1e-12)
        np.testing.assert_allclose(row[1], (centers[link - 1] - side)[:2], atol=1e-12)


@ALL
def test_constraint_rows_are_velocities(robot):
    """G q_dot equals sideways, vertical and angular velocities of moved links (differences)."""
    q = random_q(robot, 11)
    q_dot = np.random.default_rng(3).normal(size=len(q))
    if robot.planar:
        q_dot[2:5] = 0.0
    h = 1e-5
    before, after = frames(robot, q - h * q_dot), frames(robot, q + h * q_dot)
    now = frames(robot, q)
    half = robot.half_length_m

    def center_velocity(link):
        ends = [f[link - 1][1] - half * f[link - 1][0][:, 0] for f in (before, after)]
        return (ends[1] - ends[0]) / (2 * h)

    expected = [now[link - 1][0][:, 1] @ center_velocity(link) for link in robot.wheeled_links]
    if not robot.planar:
        first = robot.head_links + 1
        expected.append(center_velocity(first)[2])
        turn = after[first - 1][0] @ before[first - 1][0].T
        expected.extend(Rotation.from_matrix(turn).as_rotvec()[:2] / (2 * h))
    found = constraint_matrix(geometry(robot, q)) @ q_dot
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-8)


@ALL
def test_shapes_and_signs(robot):
    k = kinematics(geometry(robot, random_q(robot, 1)))
    s = structure(robot)
    wheels, w = len(robot.wheeled_links), 3 if robot.planar else 6
    rows = wheels if robot.planar else s.n_b - s.m_b + 3
    assert k.A_bar.shape == (rows, w)
    assert k.B_bar.shape == (rows, s.n - 1)
    assert k.A_tilde.shape == (rows, w + s.m)
    assert k.B_tilde.shape == (rows, rows) == (s.n - s.m - 1, s.n - s.m - 1)
    assert k.F_bar.shape == (s.n - s.m - 1, w + s.m)
    assert k.A_hat.shape == (s.n - 1, w + s.m)
    assert k.B_hat.shape == (s.n - 1, s.n - 1)
    # Equation (2): a wheeled link's own joint enters with half a link, floor rows with head joints.
    np.testing.assert_array_equal(k.B_bar[wheels:, s.n_h :], 0.0)
    for row, link in enumerate(robot.wheeled_links):
        if link > robot.head_links + 1:
            assert k.B_bar[row, link - 2] == pytest.approx(robot.half_length_m)
            np.testing.assert_array_equal(k.B_bar[row, link - 1 :], 0.0)


@pytest.mark.parametrize("name", [name for name in ROBOTS if name.startswith("planar")])
def test_B_tilde_of_a_planar_snake_is_lower_triangular(name):
    robot = ROBOTS[name]
    k = kinematics(geometry(robot, random_q(robot, 1)))
    np.testing.assert_array_equal(np.triu(k.B_tilde, 1), 0.0)
    np.testing.assert_allclose(np.diag(k.B_tilde), robot.half_length_m)


@pytest.mark.parametrize("name", [name for name in ROBOTS if name.startswith("planar")])
def test_a_planar_snake_does_not_read_z_roll_and_pitch(name):
    """Whatever a motion capture says of them: the robot lies on the floor."""
    robot = ROBOTS[name]
    q = random_q(robot, 1)
    tilted = q + np.eye(len(q))[2:5].sum(axis=0)
    np.testing.assert_array_equal(
        kinematics(geometry(robot, tilted)).G, kinematics(geometry(robot, q)).G
    )
    np.testing.assert_array_equal(link_points(robot, tilted), link_points(robot, q))


@ALL
def test_F_bar_solves_7_and_has_the_zero_block_of_10(robot):
    k = kinematics(geometry(robot, random_q(robot, 2)))
    s = k.s
    np.testing.assert_allclose(
        k.B_tilde @ k.F_bar, k.A_tilde, atol=1e-9 * max(1.0, np.abs(k.F_bar).max())
    )
    w = len(s.w)
    np.testing.assert_array_equal(k.F_bar[: len(s.theta_h), w + s.m_h :], 0.0)
    if s.m_b:
        assert np.abs(k.F_bar[len(s.theta_h) :, w + s.m_h :]).max() > 0.1


@ALL
def test_B_scps_never_move_joints_in_front(robot):
    """Fig. 3 and (6): a B-SCP moves itself and wheeled joints behind it only."""
    k = kinematics(geometry(robot, random_q(robot, 4)))
    s = k.s
    for column, joint in enumerate(s.scp_b):
        moved = s.theta[np.abs(k.F_bar[:, len(s.w) + s.m_h + column]) > 1e-12]
        assert (moved > joint).all()
        assert len(moved) > 0


@ALL
def test_control_input_fulfils_11(robot):
    k = kinematics(geometry(robot, random_q(robot, 5)))
    rng = np.random.default_rng(0)
    w_dot, phi_tilde_dot = rng.normal(size=len(k.s.w)), rng.normal(size=k.s.m)
    u = joint_velocities(k, w_dot, phi_tilde_dot)
    w_tilde_dot = np.concatenate((w_dot, phi_tilde_dot))
    scale = np.abs(u).max()
    np.testing.assert_allclose(k.B_hat @ u, k.A_hat @ w_tilde_dot, atol=1e-10 * scale)
    np.testing.assert_allclose(k.A_bar @ w_dot, k.B_bar @ u, atol=1e-10 * scale)


def test_long_robot_keeps_F_bar():
    """With every second link wheelless F_bar spans ten orders of magnitude: rows stay exact."""
    n = 48
    robot = PAPER.__class__(
        links=n,
        wheelless_links=tuple(range(7, n, 2)),
        joint_axes=("pitch", "yaw", "pitch", "yaw", "pitch") + ("yaw",) * (n - 6),
        start_joint_angles_rad=(0.0,),
    )
    phi = np.concatenate((PAPER.start_joint_angles_rad, 0.3 * np.sin(0.7 * np.arange(12, n))))
    q = np.concatenate((random_q(PAPER, 1)[:6], phi))
    k = kinematics(geometry(robot, q))
    residual = np.abs(k.B_tilde @ k.F_bar - k.A_tilde)
    scale = np.abs(k.B_tilde) @ np.abs(k.F_bar) + np.abs(k.A_tilde)
    assert np.abs(k.F_bar).max() > 1e8
    base = k.s.base_rows
    assert (residual[base] <= 1e-13 * scale[base]).all()
    assert residual.max() < 1e-14 * np.abs(k.F_bar).max()


@pytest.mark.parametrize(
    ("q", "message"),
    [
        (np.zeros(16), r"shape \(16,\); expected \(17,\)"),
        (np.where(np.arange(17) == 4, np.nan, 0.1), r"^q\[4\] = nan: give finite values"),
        (np.where(np.arange(17) == 0, 1e308, 0.1), r"^q\[0\] = 1e\+308: .* within \+-1e\+06"),
        (np.where(np.arange(17) > 14, -1.1e6, 0.1), r"^q\[15\] = -1.1e\+06, q\[16\] = -1.1e\+06: "),
    ],
)
@pytest.mark.filterwarnings("error")
def test_bad_posture(q, message):
    with pytest.raises(ModelError, match=message):
        geometry(PAPER, q)


def test_a_large_posture_is_a_posture():
    """Whole turns and a world of some hundred kilometres are nothing wrong."""
    q = random_q(PAPER, 1)
    far = q + np.where(np.arange(17) < 3, 9e5, 0.0)
    np.testing.assert_allclose(
        kinematics(geometry(PAPER, far)).F_bar, kinematics(geometry(PAPER, q)).F_bar
    )
