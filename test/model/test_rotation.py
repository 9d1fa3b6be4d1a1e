from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from snake_control.model.rotation import (
    quaternion_from_rpy,
    rotation_from_rpy,
    rpy_from_quaternion,
    rpy_from_rotation,
    rpy_rate_drift,
    rpy_rate_map,
    rpy_rates,
    unwrap_near,
    wrap,
)

angle = st.floats(-3.1, 3.1)
pitch = st.floats(-1.55, 1.55)


@given(angle, pitch, angle)
def test_against_scipy(roll, tilt, yaw):
    rpy = np.array([roll, tilt, yaw])
    expected = Rotation.from_euler("ZYX", [yaw, tilt, roll])
    np.testing.assert_allclose(rotation_from_rpy(rpy), expected.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rpy_from_rotation(rotation_from_rpy(rpy)), rpy, atol=1e-9)
    np.testing.assert_allclose(rpy_from_quaternion(quaternion_from_rpy(rpy)), rpy, atol=1e-9)


@given(angle, pitch, angle, st.tuples(*[st.floats(-2, 2)] * 3))
def test_rate_map_is_the_derivative(roll, tilt, yaw, rate):
    rpy, rate = np.array([roll, tilt, yaw]), np.array(rate)
    h = 1e-6
    turn = rotation_from_rpy(rpy + h * rate) @ rotation_from_rpy(rpy - h * rate).T
    omega = Rotation.from_matrix(turn).as_rotvec() / (2 * h)
    np.testing.assert_allclose(rpy_rate_map(rpy) @ rate, omega, atol=1e-7)
    turned = [rpy_rate_map(rpy + side * h * rate) @ rate for side in (1, -1)]
    drift = (turned[0] - turned[1]) / (2 * h)
    np.testing.assert_allclose(rpy_rate_drift(rpy, rate), drift, atol=1e-7)
    np.testing.assert_allclose(rpy_rates(rpy, rpy_rate_map(rpy) @ rate), rate, atol=1e-11)


def test_rates_at_the_vertical_are_finite():
    assert np.isfinite(rpy_rates([0.3, np.pi / 2, 0.4], [0.1, 0.2, 0.3])).all()


def test_pitch_down_is_positive():
    forward = rotation_from_rpy((0.0, 0.3, 0.0))[:, 0]
    assert forward[2] < 0


def test_gimbal_lock_gives_a_rotation_back():
    rpy = rpy_from_rotation(rotation_from_rpy((0.4, np.pi / 2, 0.9)))
    np.testing.assert_allclose(
        rotation_from_rpy(rpy), rotation_from_rpy((0.4, np.pi / 2, 0.9)), atol=1e-9
    )


@given(st.floats(-50, 50), st.floats(-50, 50))
def test_unwrap_near(value, previous):
    found = float(unwrap_near(value, previous))
    assert abs(found - previous) <= np.pi + 1e-9
    assert np.cos(found - value) == pytest.approx(1.0)
    assert -np.pi <= wrap(value) < np.pi + 1e-12
