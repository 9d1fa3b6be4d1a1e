"""Messages to arrays and back, and what is refused."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import TwistStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from snake_control.control.head_filter import HeadEstimate
from snake_control.control.reference import Reference
from snake_control.nodes import conversions as c

NAMES = ("joint_1", "joint_2", "joint_3")
rpys = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
vectors = st.tuples(*[st.floats(-2.0, 2.0)] * 3)


def attitude(rpy):
    """Rz(Y) Ry(P) Rx(R) as scipy builds it."""
    return Rotation.from_euler("ZYX", [rpy[2], rpy[1], rpy[0]])


@given(rpy=rpys, rates=vectors)
@settings(max_examples=100, deadline=None)
def test_angular_velocity_of_rpy_rates_against_finite_differences(rpy, rates):
    dt = 1e-6
    rpy, rates = np.array(rpy), np.array(rates)
    before, after = attitude(rpy - rates * dt), attitude(rpy + rates * dt)
    omega = (after * before.inv()).as_rotvec() / (2 * dt)
    message = c.reference_message(
        Reference(np.concatenate([[1, 2, 3], rpy]), np.concatenate([[4, 5, 6], rates])), 0, "world"
    )
    np.testing.assert_allclose(c.array(message.twist.angular), omega, atol=1e-7)
    back = c.reference_from(message, "world")
    np.testing.assert_allclose(back.w_d_dot, [4, 5, 6, *rates], atol=1e-9)
    np.testing.assert_allclose(back.w_d, [1, 2, 3, *rpy], atol=1e-9)


@given(rpy=rpys, velocity=vectors, omega=vectors)
@settings(max_examples=100, deadline=None)
def test_odometry_twist_is_in_the_head_frame(rpy, velocity, omega):
    rotation = attitude(rpy)
    estimate = HeadEstimate(5, np.array([1.0, 2, 3]), rotation, np.array(velocity), np.array(omega))
    message = c.odometry_message(estimate, "world", "link_1")
    assert (message.header.frame_id, message.child_frame_id) == ("world", "link_1")
    assert c.stamp_ns(message) == 5
    matrix = rotation.as_matrix()
    np.testing.assert_allclose(c.array(message.twist.twist.linear), matrix.T @ velocity, atol=1e-12)
    np.testing.assert_allclose(c.array(message.twist.twist.angular), matrix.T @ omega, atol=1e-12)

    w, w_dot = c.head_motion(message, "world")
    np.testing.assert_allclose(w, [1, 2, 3, *rpy], atol=1e-9)
    np.testing.assert_allclose(w_dot[:3], velocity, atol=1e-9)
    dt = 1e-6
    turned = (Rotation.from_rotvec(np.array(omega) * dt) * rotation).as_euler("ZYX")[::-1]
    rates = (np.array(turned) - w[3:] + math.pi) % (2 * math.pi) - math.pi
    np.testing.assert_allclose(w_dot[3:], rates / dt, atol=1e-3 / math.cos(rpy[1]) ** 2)


def test_rates_at_a_pitch_of_90_degrees_are_refused():
    with pytest.raises(c.MessageError, match="pitch"):
        c.rpy_rates(np.array([0.0, math.pi / 2, 0.0]), np.ones(3))


@pytest.mark.parametrize("stamp", [0, 1, 999_999_999, 1_000_000_000, 1_795_401_446_954_348_310])
def test_stamps_keep_every_nanosecond(stamp):
    assert c.stamp_ns(Odometry(header=c.header(stamp))) == stamp


def odometry(**changes):
    message = Odometry(header=c.header(0, "world"))
    message.pose.pose.orientation.w = 1.0
    for path, value in changes.items():
        *owners, field = path.split("__")
        target = message
        for owner in owners:
            target = getattr(target, owner)
        setattr(target, field, value)
    return message


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"pose__pose__position__x": math.nan}, "position"),
        ({"pose__pose__orientation__z": math.inf}, "orientation"),
        ({"pose__pose__orientation__w": 0.9}, "quaternion"),
        ({"pose__pose__orientation__w": 0.0}, "quaternion"),
        ({"twist__twist__linear__y": math.nan}, "twist"),
        ({"twist__twist__angular__y": math.nan}, "twist"),
        ({"header__frame_id": "map"}, "map"),
        ({"header__frame_id": ""}, "world"),
    ],
)
def test_a_bad_head_pose_is_refused(changes, text):
    c.head_motion(odometry(), "world")
    with pytest.raises(c.MessageError, match=text):
        c.head_motion(odometry(**changes), "world")


def test_joints_are_matched_by_name():
    message = JointState(
        name=["joint_3", "gripper", "joint_1", "joint_2"],
        position=[3.0, 9.0, 1.0, 2.0],
        velocity=[0.3, 0.9, 0.1, 0.2],
    )
    phi, phi_dot = c.joint_motion(message, NAMES)
    np.testing.assert_array_equal(phi, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(phi_dot, [0.1, 0.2, 0.3])


def test_absent_velocities_are_zero():
    _, phi_dot = c.joint_motion(JointState(name=list(NAMES), position=[1.0, 2.0, 3.0]), NAMES)
    np.testing.assert_array_equal(phi_dot, np.zeros(3))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"name": ["joint_1", "joint_2", "other"]}, "joint_3 missing"),
        ({"name": ["joint_1", "joint_2", "joint_3", "joint_1"], "position": [0.0] * 4}, "twice"),
        ({"name": ["joint_1"]}, "1 names but 3 positions"),
        ({"velocity": [0.0]}, "1 velocities"),
        ({"position": [0.0, math.nan, 0.0]}, "position of joint_2 is nan"),
        ({"velocity": [0.0, 0.0, math.inf]}, "velocity of joint_3 is inf"),
    ],
)
def test_bad_joint_states_are_refused(changes, text):
    good = {"name": list(NAMES), "position": [0.0] * 3}
    c.joint_motion(JointState(**good), NAMES)
    with pytest.raises(c.MessageError, match=text):
        c.joint_motion(JointState(**(good | changes)), NAMES)


@pytest.mark.parametrize(("frame", "heading"), [("", False), ("world", False), ("link_1", True)])
def test_frame_of_cmd_vel(frame, heading):
    message = TwistStamped(header=c.header(0, frame))
    message.twist.linear.x = 0.1
    message.twist.angular.z = 0.2
    command = c.head_velocity_command(message, "world")
    assert command.in_heading_frame is heading
    np.testing.assert_array_equal(command.linear, [0.1, 0, 0])
    np.testing.assert_array_equal(command.angular, [0, 0, 0.2])


def test_bad_cmd_vel_is_refused():
    with pytest.raises(c.MessageError, match="'base_link'"):
        c.head_velocity_command(TwistStamped(header=c.header(0, "base_link")), "world")
    message = TwistStamped()
    message.twist.linear.z = math.nan
    with pytest.raises(c.MessageError, match="not finite"):
        c.head_velocity_command(message, "world")
