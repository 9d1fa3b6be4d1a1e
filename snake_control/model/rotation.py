"""Rotations in the paper's roll-pitch-yaw convention: Rz(Y) Ry(P) Rx(R), P > 0 is nose down."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def rotation_from_rpy(rpy: ArrayLike) -> Array:
    """Return the rotation matrix of [R, P, Y].

    Args:
        rpy: roll, pitch, yaw [rad], shape (3,).

    Returns:
        Rz(Y) Ry(P) Rx(R), shape (3, 3): columns are the body axes in the world.
    """
    roll, pitch, yaw = (float(angle) for angle in np.asarray(rpy, dtype=float))
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_rotation(rotation: ArrayLike) -> Array:
    """Return [R, P, Y] of a rotation matrix, P in [-pi/2, pi/2], shape (3,) [rad].

    At P = +-pi/2 roll and yaw are one and the same rotation; roll is then 0.
    """
    (xx, yx, _), (xy, yy, _), (xz, yz, zz) = np.asarray(rotation, dtype=float).tolist()
    horizontal = math.hypot(xx, xy)
    pitch = math.atan2(-xz, horizontal)
    if horizontal < 1e-12:
        return np.array([0.0, pitch, math.atan2(-yx, yy)])
    return np.array([math.atan2(yz, zz), pitch, math.atan2(xy, xx)])


def rpy_rate_map(rpy: ArrayLike) -> Array:
    """Return the map from rates of [R, P, Y] to angular velocity in the world.

    Args:
        rpy: roll, pitch, yaw [rad], shape (3,).

    Returns:
        Shape (3, 3); singular at P = +-pi/2, where no inverse exists.
    """
    _, pitch, yaw = (float(angle) for angle in np.asarray(rpy, dtype=float))
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array([[cy * cp, -sy, 0.0], [sy * cp, cy, 0.0], [-sp, 0.0, 1.0]])


def quaternion_from_rpy(rpy: ArrayLike) -> Array:
    """Return the quaternion [x, y, z, w] of [R, P, Y]."""
    # Of half angles: scipy takes a hundred times as long for one rotation.
    roll, pitch, yaw = (0.5 * float(angle) for angle in np.asarray(rpy, dtype=float))
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )


def rpy_from_quaternion(quaternion: ArrayLike) -> Array:
    """Return [R, P, Y] of a quaternion [x, y, z, w] of any length but zero.

    Raises:
        ValueError: the quaternion has no length.
    """
    return rpy_from_rotation(Rotation.from_quat(np.asarray(quaternion, dtype=float)).as_matrix())


def rotation_vector(rotation: ArrayLike) -> Array:
    """Return the rotation vector of a rotation matrix, (3,), its length in [0, pi] [rad]."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.asarray(rotation, dtype=float).tolist()
    twice_sine = np.array([zy - yz, xz - zx, yx - xy])
    length = math.hypot(*twice_sine.tolist())
    twice_cosine = xx + yy + zz - 1.0
    if length < 1e-4 and twice_cosine < 0.0:
        # Near half a turn the sine has lost the axis.
        return Rotation.from_matrix(rotation).as_rotvec()
    angle = math.atan2(length, twice_cosine)
    # The angle over its sine is 1 + angle^2 / 6 at first.
    return twice_sine * (angle / length if length > 1e-8 else 0.5)


def rotation_from_vector(vector: ArrayLike) -> Array:
    """Return the rotation matrix of a rotation vector [rad], (3, 3)."""
    x, y, z = (float(component) for component in np.asarray(vector, dtype=float))
    angle = math.hypot(x, y, z)
    a = math.sin(angle) / angle if angle > 1e-8 else 1.0
    half = math.sin(0.5 * angle) / angle if angle > 1e-8 else 0.5
    b = 2.0 * half * half
    return np.array(
        [
            [1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)],
        ]
    )


def wrap(angle: ArrayLike) -> Array:
    """Return angles in [-pi, pi), elementwise [rad]."""
    return np.mod(np.asarray(angle, dtype=float) + math.pi, 2 * math.pi) - math.pi


def wrap_angle(angle: float) -> float:
    """Return one angle in [-pi, pi) [rad]."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def unwrap_near(rpy: ArrayLike, previous: ArrayLike) -> Array:
    """Return ``rpy`` with whole turns added so that it lies next to ``previous`` [rad]."""
    previous = np.asarray(previous, dtype=float)
    return previous + wrap(np.asarray(rpy, dtype=float) - previous)


def cross(a: Array, b: Array) -> Array:
    """Return the cross product of columns, (3, k) or (3, 1) each.

    numpy.cross takes ten times as long on the few columns of a snake.
    """
    return np.stack(
        (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    )


def rpy_rates(rpy: ArrayLike, angular: ArrayLike) -> Array:
    """Return the rates of [R, P, Y] at an angular velocity in the world, (3,) [rad/s].

    The inverse of ``rpy_rate_map``; at P = +-pi/2, where there is none, huge but finite numbers.

    Args:
        rpy: roll, pitch, yaw [rad], (3,).
        angular: angular velocity in the world, (3,) [rad/s].
    """
    _, pitch, yaw = (float(angle) for angle in np.asarray(rpy, dtype=float))
    x, y, z = (float(component) for component in np.asarray(angular, dtype=float))
    forward = math.cos(yaw) * x + math.sin(yaw) * y
    # The cosine of no double is 0.
    roll_rate = forward / math.cos(pitch)
    return np.array(
        [
            roll_rate,
            math.cos(yaw) * y - math.sin(yaw) * x,
            z + math.sin(pitch) * roll_rate,
        ]
    )


def rpy_rate_drift(rpy: ArrayLike, rates: ArrayLike) -> Array:
    """Return the angular acceleration in the world at even rates of [R, P, Y], (3,) [rad/s^2].

    The time derivative of ``rpy_rate_map`` times the rates.

    Args:
        rpy: roll, pitch, yaw [rad], (3,).
        rates: their rates [rad/s], (3,).
    """
    _, pitch, yaw = (float(angle) for angle in np.asarray(rpy, dtype=float))
    r, p, y = (float(rate) for rate in np.asarray(rates, dtype=float))
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            -r * (y * sy * cp + p * cy * sp) - p * y * cy,
            r * (y * cy * cp - p * sy * sp) - p * y * sy,
            -r * p * cp,
        ]
    )
