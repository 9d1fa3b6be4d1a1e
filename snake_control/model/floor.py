"""The robot standing level on the floor: the head pose follows from base pose and joint angles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.model.geometry import Geometry, geometry, link_centers
from snake_control.model.rotation import cross, rotation_from_rpy, rpy_from_rotation, rpy_rates

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.80665


def head_pose_on_floor(robot: RobotConfig, phi: ArrayLike, base: ArrayLike) -> Array:
    """Return the head pose w of a robot whose base stands level at wheel height.

    Args:
        robot: the robot.
        phi: joint angles, (n-1,) [rad].
        base: position and heading [x, y, yaw] of the front end of link n_h + 1, (3,) [m, rad].

    Returns:
        w = [x_h, y_h, z_h, R, P, Y], (6,) [m, rad].
    """
    x, y, yaw = np.asarray(base, dtype=float)
    at_origin = geometry(robot, np.concatenate((np.zeros(6), np.asarray(phi, dtype=float))))
    rotation = rotation_from_rpy((0.0, 0.0, yaw)) @ at_origin.base_rotation.T
    from_tip = at_origin.base_origin - at_origin.head_points[0]
    tip = np.array([x, y, robot.wheel_radius_m]) - rotation @ from_tip
    return np.concatenate((tip, rpy_from_rotation(rotation)))


def base_under_head(robot: RobotConfig, phi: ArrayLike, w: ArrayLike) -> Array:
    """Return where the base must stand for the head to have x_h, y_h and Y of ``w``.

    The inverse of ``head_pose_on_floor``; the floor decides the rest of the head pose.

    Args:
        robot: the robot.
        phi: joint angles, (n-1,) [rad].
        w: wanted head pose, (6,) [m, rad].

    Returns:
        [x, y, yaw] of the front end of link n_h + 1, (3,) [m, rad].
    """
    wanted = np.asarray(w, dtype=float)
    # Turn and shift a robot whose base stands at the origin.
    at_origin = head_pose_on_floor(robot, phi, np.zeros(3))
    yaw = wanted[5] - at_origin[5]
    c, s = math.cos(yaw), math.sin(yaw)
    x = wanted[0] - (c * at_origin[0] - s * at_origin[1])
    y = wanted[1] - (s * at_origin[0] + c * at_origin[1])
    return np.array([x, y, yaw])


def head_velocity(g: Geometry, base_rate: ArrayLike, phi_dot: ArrayLike) -> Array:
    """Return w_dot of a robot whose base glides on the floor, (6,) [m/s, rad/s].

    The rates of R and Y grow beyond all bounds towards P = +-pi/2.

    Args:
        g: the posture.
        base_rate: rate of [x, y, yaw] of the front end of link n_h + 1, (3,) [m/s, rad/s].
        phi_dot: joint velocities, (n-1,) [rad/s].
    """
    x_dot, y_dot, yaw_dot = np.asarray(base_rate, dtype=float)
    # Head joint i turns all in front of it backwards.
    turning = -g.head_axes.T * np.asarray(phi_dot, dtype=float)[: g.s.n_h]
    angular = turning.sum(axis=1) + np.array([0.0, 0.0, yaw_dot])
    tip = g.head_points[0]
    linear = np.array([x_dot, y_dot, 0.0])
    linear += cross(np.array([[0.0], [0.0], [yaw_dot]]), (tip - g.base_origin)[:, None])[:, 0]
    linear += cross(turning, (tip - g.head_points[1:]).T).sum(axis=1)
    return np.concatenate((linear, rpy_rates(g.q[3:6], angular)))


def base_pose(g: Geometry) -> Array:
    """Return [x, y, yaw] of the front end of link n_h + 1, (3,) [m, rad]."""
    forward = g.base_rotation[:, 0]
    return np.array([*g.base_origin[:2], math.atan2(forward[1], forward[0])])


def gravity_efforts(g: Geometry) -> Array:
    """Return the torque each joint applies to hold the robot still, (n-1,) [N m].

    The derivative of the potential energy by each joint angle with the base held by the floor:
    head joints carry the links in front of them; base joints turn about the vertical and carry
    nothing.
    """
    n_h = g.s.n_h
    masses = g.s.masses[:n_h]
    in_front = np.cumsum(masses)
    moment = np.cumsum(masses[:, None] * link_centers(g)[:n_h], axis=0)
    arms = moment - in_front[:, None] * g.head_points[1:]
    axes = g.head_axes
    efforts = np.zeros(g.s.n - 1)
    efforts[:n_h] = -GRAVITY_M_S2 * (axes[:, 0] * arms[:, 1] - axes[:, 1] * arms[:, 0])
    return efforts
