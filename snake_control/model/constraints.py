"""The velocity constraints (1)-(3): wheels do not slide sideways, the base stays on the floor.

Rows G(q) q_dot = 0: sideways velocity of each wheeled base link's centre (ascending), then the
vertical velocity of the first base link's centre and the x and y components of its angular
velocity. A planar snake has the wheel rows only: it moves on the floor by itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from snake_control.model.geometry import Geometry, PlanarBase
from snake_control.model.rotation import cross

Array = NDArray[np.float64]


def lateral_map(g: PlanarBase) -> Array:
    """Return the sideways velocity of each wheeled link per planar velocity of the base frame.

    Returns:
        Shape (n_b - m_b, 3): per linear velocity x, y and angular velocity z of the base frame, in
        base coordinates.
    """
    wheeled = g.s.wheeled
    x, y = g.x[wheeled], g.y[wheeled]
    return np.column_stack((y, np.sum(x * g.centers[wheeled], axis=1)))


def lateral_joint_map(g: PlanarBase) -> Array:
    """Return the sideways velocity of each wheeled link per base joint velocity.

    Returns:
        Shape (n_b - m_b, n_b - 1); zero where the joint lies behind the link.
    """
    wheeled = g.s.wheeled
    x = g.x[wheeled]
    to_centers = np.sum(x * g.centers[wheeled], axis=1)
    return g.s.behind * (to_centers[:, None] - x @ g.hitches.T)


def floor_map(g: Geometry) -> Array:
    """Return the three floor rows per twist of the base frame in base coordinates, (3, 6)."""
    rotation = g.base_rotation
    up = rotation[2]
    rows = np.zeros((3, 6))
    rows[0, :3] = up
    # The centre of the first base link lies half a link behind the origin: (-l, 0, 0).
    half = g.s.robot.half_length_m
    rows[0, 4] = half * up[2]
    rows[0, 5] = -half * up[1]
    rows[1:, 3:] = rotation[:2]
    return rows


def constraint_matrix(g: Geometry) -> Array:
    """Return G(q) with G q_dot = 0, equations (1)-(3).

    Returns:
        Shape (wheels + floor_rows, n + 5); wheel rows in m/s, floor rows in m/s, rad/s, rad/s.
    """
    s = g.s
    wheels = len(s.wheeled)
    moved_by_head = 6 + s.n_h
    matrix = np.zeros((wheels + s.floor_rows, s.n + 5))
    matrix[:wheels, :moved_by_head] = lateral_map(g) @ g.twists[[0, 1, 5]]
    matrix[:wheels, moved_by_head:] = lateral_joint_map(g)
    if s.floor_rows:
        matrix[wheels:, :moved_by_head] = floor_map(g) @ g.twists
    return matrix


def contracted_gradient(g: Geometry, weights: Array) -> Array:
    """Return the gradient of sum(weights * G(q)) with the weights held constant.

    This is all that cost functions of G need: one contraction, no third-order tensor.

    Args:
        g: the posture.
        weights: shape of G, (wheels + floor_rows, n + 5).

    Returns:
        Derivative by each component of q, (n + 5,).
    """
    s = g.s
    wheels = len(s.wheeled)
    moved_by_head = 6 + s.n_h
    on_twists = weights[:wheels, :moved_by_head]
    gradient = np.empty(s.n + 5)
    gradient[moved_by_head:] = _base_gradient(
        g, on_twists @ g.twists[[0, 1, 5]].T, weights[:wheels, moved_by_head:]
    )
    on_floor = weights[wheels:, :moved_by_head] if s.floor_rows else np.zeros((3, moved_by_head))
    gradient[:moved_by_head] = _head_gradient(g, lateral_map(g).T @ on_twists, on_floor)
    return gradient


def _base_gradient(g: Geometry, on_planar: Array, on_joints: Array) -> Array:
    """Part of the base joints: they turn the links behind them about their hitch.

    Args:
        on_planar: weights of each wheeled link's lateral_map row, (n_b - m_b, 3).
        on_joints: weights of lateral_joint_map, (n_b - m_b, n_b - 1).
    """
    s = g.s
    x, y = g.x[s.wheeled], g.y[s.wheeled]
    on_joints = s.behind * on_joints
    # A joint's column changes only under joints behind it (ahead of the link).
    ahead = np.cumsum(on_joints, axis=1) - on_joints
    moment = on_joints[:, :, None] * g.hitches[None, :, :]
    moment = np.cumsum(moment, axis=1) - moment
    terms = (
        -np.sum(x * on_planar[:, :2], axis=1)[:, None]
        + (y @ g.hitches.T) * (on_planar[:, 2:] + ahead)
        - np.einsum("kc,kac->ka", y, moment)
    )
    return np.sum(s.behind * terms, axis=0)


def _head_gradient(g: Geometry, on_planar: Array, on_floor: Array) -> Array:
    """Part of w and the head joints: they move the base frame and change each other's twists.

    Args:
        on_planar: weights of the planar rows of the twists, (3, 6 + n_h).
        on_floor: weights of the floor rows, (3, 6 + n_h).
    """
    linear, angular = g.twists[:3], g.twists[3:]
    rotation = g.base_rotation
    center = np.array([[-g.s.robot.half_length_m], [0.0], [0.0]])

    # The floor rows turn with the base frame itself.
    force = np.outer(rotation[2], on_floor[0])
    torque = rotation[:2].T @ on_floor[1:]
    velocity = linear + cross(angular, center)
    turning = np.sum(cross(velocity, force) + cross(angular, torque), axis=1)

    # Wrench conjugate to each twist, at the origin of the base frame.
    torque += cross(center, force)
    force[:2] += on_planar[:2]
    torque[2] += on_planar[2]

    # Twist j changes by -ad(twist i) twist j when coordinate i lies behind j in the chain; the sum
    # over all such j is a running sum of two vectors.
    order = _chain_order(g.s.n_h)
    f, t = force[:, order], torque[:, order]
    v, w = linear[:, order], angular[:, order]
    by_angular = cross(v, f) + cross(w, t)
    by_linear = cross(w, f)
    by_angular = np.cumsum(by_angular, axis=1) - by_angular
    by_linear = np.cumsum(by_linear, axis=1) - by_linear
    in_chain = -(np.sum(w * by_angular, axis=0) + np.sum(v * by_linear, axis=0))
    gradient = np.empty(len(order))
    gradient[order] = in_chain
    return gradient + turning @ angular


def _chain_order(n_h: int) -> list[int]:
    """Order in which [w, head joints] act from the world to the base: x, y, z, Y, P, R, phi."""
    return [0, 1, 2, 5, 4, 3, *range(6, 6 + n_h)]
