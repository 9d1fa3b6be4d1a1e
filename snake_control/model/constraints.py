"""The velocity constraints (1)-(3): wheels do not slide sideways, the base stays on the floor.

Rows G(q) q_dot = 0: sideways velocity of each wheeled base link's centre (ascending), then the
vertical velocity of the first base link's centre and the x and y components of its angular
velocity. A planar snake has the wheel rows only: it moves on the floor by itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from snake_control.model.geometry import Geometry, PlanarBase

Array = NDArray[np.float64]


def lateral_map(g: PlanarBase) -> Array:
    """Return the sideways velocity of each wheeled link per planar velocity of the base frame.

    Returns:
        Shape (n_b - m_b, 3): per linear velocity x, y and angular velocity z of the base frame, in
        base coordinates.
    """
    wheeled = g.s.wheeled
    forward = g.forward[..., wheeled]
    rows = np.empty((*forward.shape, 3))
    rows[..., 0] = -forward.imag
    rows[..., 1] = forward.real
    rows[..., 2] = (forward.conj() * g.middles[..., wheeled]).real
    return rows


def lateral_velocities(g: PlanarBase, base_velocities: Array) -> Array:
    """Return the sideways velocity of each wheeled link for a first base link at rest.

    Args:
        g: the base part.
        base_velocities: of the base joints, (n_b - 1,) [rad/s].

    Returns:
        ``lateral_joint_map`` times ``base_velocities``, (n_b - m_b,) [m/s].
    """
    s = g.s
    turning = np.zeros(g.links.shape)
    np.add.accumulate(base_velocities, axis=-1, out=turning[..., 1:])
    # A link that turns about its front end moves its rear end sideways.
    front = np.zeros(g.links.shape, dtype=complex)
    moved = g.links[..., :-1] * (-1j * turning[..., :-1])
    np.add.accumulate(moved, axis=-1, out=front[..., 1:])
    velocities: Array = (g.forward.conj() * front).imag - s.robot.half_length_m * turning
    return velocities[..., s.wheeled]


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
