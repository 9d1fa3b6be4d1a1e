"""From markers to the head, against plain matrices and against sampled errors."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from snake_control.control.pose_mount import MarkerMount

NONE = np.zeros((6, 6))
vectors = st.tuples(*[st.floats(-2.0, 2.0)] * 3)
angles = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))


def matrix(position, rpy):
    """Homogeneous transform, Rz(Y) Ry(P) Rx(R) written out by elementary rotations."""
    (r, p, y), found = rpy, np.eye(4)
    x = [[1, 0, 0], [0, math.cos(r), -math.sin(r)], [0, math.sin(r), math.cos(r)]]
    yy = [[math.cos(p), 0, math.sin(p)], [0, 1, 0], [-math.sin(p), 0, math.cos(p)]]
    z = [[math.cos(y), -math.sin(y), 0], [math.sin(y), math.cos(y), 0], [0, 0, 1]]
    found[:3, :3] = np.array(z) @ np.array(yy) @ np.array(x)
    found[:3, 3] = position
    return found


def pose(homogeneous):
    return homogeneous[:3, 3], Rotation.from_matrix(homogeneous[:3, :3])


@given(head=vectors, head_rpy=angles, marker=vectors, marker_rpy=angles)
@settings(max_examples=100, deadline=None)
def test_the_head_is_found_from_where_its_markers_are(head, head_rpy, marker, marker_rpy):
    head_in_world = matrix(head, head_rpy)
    measured = pose(head_in_world @ matrix(marker, marker_rpy))
    position, rotation, _ = MarkerMount(marker, marker_rpy).head(*measured, NONE)
    np.testing.assert_allclose(position, head, atol=1e-9)
    np.testing.assert_allclose(rotation.as_matrix(), head_in_world[:3, :3], atol=1e-9)


def test_a_head_that_turns_about_its_tip_stays_where_it_is():
    mount = MarkerMount([-0.05, 0.01, 0.04], [0.1, -0.2, 1.5])
    on_head = matrix([-0.05, 0.01, 0.04], [0.1, -0.2, 1.5])
    for yaw in np.linspace(-3, 3, 25):
        measured = pose(matrix([0.4, -0.3, 0.2], [0.2, 0.3, yaw]) @ on_head)
        position, _, _ = mount.head(*measured, NONE)
        np.testing.assert_allclose(position, [0.4, -0.3, 0.2], atol=1e-12)


@pytest.mark.parametrize(
    ("in_y_up", "in_z_up"),
    [
        # Ahead stays ahead, up is up, and y-up's z points to the right.
        (([1, 0, 0], [0, 0, 0]), ([1, 0, 0], [0, 0, 0])),
        (([0, 1, 0], [0, 0, 0]), ([0, 0, 1], [0, 0, 0])),
        (([0, 0, 1], [0, 0, 0]), ([0, -1, 0], [0, 0, 0])),
        # Turns about the vertical are yaw, about what points to the right negative pitch.
        (([0, 0, 0], [0, 0.3, 0]), ([0, 0, 0], [0, 0, 0.3])),
        (([0, 0, 0], [0, 0, 0.3]), ([0, 0, 0], [0, -0.3, 0])),
        (([0, 0, 0], [0.3, 0, 0]), ([0, 0, 0], [0.3, 0, 0])),
    ],
)
def test_y_up_becomes_z_up(in_y_up, in_z_up):
    mount = MarkerMount(np.zeros(3), np.zeros(3), y_up=True)
    position, rotation, _ = mount.head(*pose(matrix(*in_y_up)), NONE)
    expected = matrix(*in_z_up)
    np.testing.assert_allclose(position, expected[:3, 3], atol=1e-12)
    np.testing.assert_allclose(rotation.as_matrix(), expected[:3, :3], atol=1e-12)


@pytest.mark.parametrize("y_up", [False, True])
def test_errors_reach_the_head_over_the_lever(y_up):
    rng = np.random.default_rng(3)
    root = rng.normal(0.0, 1e-3, (6, 6))
    covariance = root @ root.T
    mount = MarkerMount([-0.2, 0.1, 0.3], [0.4, 0.2, -1.0], y_up)
    measured_at, attitude = np.array([0.5, 1.0, -0.4]), Rotation.from_rotvec([0.3, 1.0, -0.7])
    true_at, true_attitude, predicted = mount.head(measured_at, attitude, covariance)
    errors = []
    for error in rng.multivariate_normal(np.zeros(6), covariance, 4000):
        at, turned, _ = mount.head(
            measured_at + error[:3], Rotation.from_rotvec(error[3:]) * attitude, NONE
        )
        errors.append([*(at - true_at), *(turned * true_attitude.inv()).as_rotvec()])
    np.testing.assert_allclose(np.cov(np.transpose(errors)), predicted, atol=0.1 * predicted.max())
