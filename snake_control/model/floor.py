"""The robot standing level on the floor: the head pose follows from base pose and joint angles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.errors import ModelError
from snake_control.model.geometry import Geometry, checked_posture
from snake_control.model.head_chain import HeadChain, head_chain
from snake_control.model.rotation import rpy_from_rotation, rpy_rates
from snake_control.model.structure import structure
from snake_control.model.vector import ZERO, Twist, Vector, along, cross, dot, through

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
    s = structure(robot)
    chain = head_chain(s, np.asarray(phi, dtype=float)[: s.n_h].tolist())
    return chain_pose_on_floor(robot, chain, np.asarray(base, dtype=float))


def chain_pose_on_floor(robot: RobotConfig, chain: HeadChain, base: Array) -> Array:
    """Return w as ``head_pose_on_floor`` does, of a head part that is worked out already."""
    x, y, yaw = base.tolist()
    c, s = math.cos(yaw), math.sin(yaw)

    def turned(v: Vector) -> Vector:
        return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]

    tip = along((x, y, robot.wheel_radius_m), 1.0, turned(chain.tip))
    forward, left, up = map(turned, chain.frame)
    rpy = rpy_from_rotation(tuple(zip(forward, left, up, strict=True)))
    return np.array((*tip, *rpy.tolist()))


def geometry_on_floor(robot: RobotConfig, phi: ArrayLike) -> Geometry:
    """Return the geometry of a robot whose base stands level at wheel height, at the origin.

    Args:
        robot: the robot.
        phi: joint angles, (n-1,) [rad].

    Raises:
        ModelError: phi has the wrong shape, is not finite, or beyond +-1e6.
    """
    s = structure(robot)
    angles = np.asarray(phi, dtype=float)
    if angles.shape != (s.n - 1,):
        raise ModelError(f"phi has shape {angles.shape}; expected ({s.n - 1},) for {s.n} links")
    angles = checked_posture(s, np.concatenate((np.zeros(6), angles)))[6:]
    chain = head_chain(s, angles[: s.n_h].tolist())
    w = chain_pose_on_floor(robot, chain, np.zeros(3))
    return Geometry(s, np.concatenate((w, angles)), chain)


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
    x_dot, y_dot, yaw_dot = np.asarray(base_rate, dtype=float).tolist()
    velocities = np.asarray(phi_dot, dtype=float)[: g.s.n_h].tolist()
    turning = along(ZERO, yaw_dot, g.rows[2])
    linear, angular = tip_twist(g.chain, (ZERO, turning), velocities)
    x, y, z = through(g.rows, linear)
    rates = rpy_rates(g.q[3:6], through(g.rows, angular))
    return np.array((x + x_dot, y + y_dot, z, *rates.tolist()))


def tip_twist(chain: HeadChain, base: Twist, velocities: list[float]) -> Twist:
    """Return linear velocity of the tip and angular velocity of the head, in base coordinates.

    Args:
        chain: the head part.
        base: twist of the base frame at its origin, in base coordinates.
        velocities: of the head joints, n_h numbers [rad/s].
    """
    linear, angular = base
    # Head joint i turns all in front of it backwards.
    for velocity, (by_origin, axis) in zip(velocities, chain.twists, strict=True):
        linear = along(linear, -velocity, by_origin)
        angular = along(angular, -velocity, axis)
    return along(linear, 1.0, cross(angular, chain.tip)), angular


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
    chain, up = g.chain, g.rows[2]
    in_front, moment = 0.0, ZERO
    efforts = np.zeros(g.s.n - 1)
    for joint, ((_, axis), pivot) in enumerate(zip(chain.twists, chain.pivots, strict=True)):
        mass = g.s.robot.link_mass_kg[joint]
        in_front += mass
        moment = along(moment, mass, chain.centers[joint])
        arm = along(moment, -in_front, pivot)
        efforts[joint] = -GRAVITY_M_S2 * dot(up, cross(axis, arm))
    return efforts
