"""Where every link, joint and wheel of the robot is, for one posture q.

The head part is a spatial chain. All joints of the base part turn about the same axis
(Assumption 2), so the base part is planar in the frame of its first link, ``base``, level or not.
Its origin is the front end of link n_h + 1, where joint n_h turns.

A planar snake is a base part alone, its frame that of link 1. It lies on the floor, so z, R and P
in its q stand for nothing and are not read.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.errors import ModelError
from snake_control.model.rotation import cross, rotation_from_rpy, rpy_rate_map
from snake_control.model.structure import Structure, structure

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class PlanarBase:
    """The base part in the frame of its first link; depends on the base joints alone.

    Attributes:
        s: index sets of the robot.
        x, y: directions of each base link, forward and left, in base coordinates, (n_b, 2).
        centers: link centres of the base part in base coordinates, (n_b, 2).
        hitches: where base joints n_h+1 .. n-1 turn, in base coordinates, (n_b - 1, 2).
    """

    s: Structure
    x: Array
    y: Array
    centers: Array
    hitches: Array


@dataclasses.dataclass(frozen=True, eq=False)
class Geometry(PlanarBase):
    """A posture, worked out once and read by every model quantity.

    Attributes:
        q: [w, phi], (n+5,).
        base_rotation: columns are the axes of the base frame in the world, (3, 3).
        base_origin: front end of link n_h + 1 in the world, (3,).
        head_points: front ends of links 1 .. n_h+1 in the world, (n_h+1, 3).
        head_centers: centres of links 1 .. n_h in the world, (n_h, 3).
        head_axes: axis of each head joint in the world, (n_h, 3).
        twists: how the base frame moves for each of [w, phi_1 .. phi_(n_h)]: linear velocity at its
            origin and angular velocity, in base coordinates, (6, 6 + n_h).
    """

    q: Array
    base_rotation: Array
    base_origin: Array
    head_points: Array
    head_centers: Array
    head_axes: Array
    twists: Array

    def to_world(self, points: Array) -> Array:
        """Return points given in base coordinates, (..., 2), in the world, (..., 3)."""
        return self.base_origin + points @ self.base_rotation[:, :2].T


def geometry(robot: RobotConfig, q: ArrayLike) -> Geometry:
    """Work out the geometry of one posture.

    Args:
        robot: the robot.
        q: [x_h, y_h, z_h, R, P, Y, phi_1 .. phi_(n-1)], (n+5,) [m, rad].

    Raises:
        ModelError: wrong shape, or not finite.
    """
    s = structure(robot)
    q = np.asarray(q, dtype=float)
    if q.shape != (s.n + 5,):
        raise ModelError(f"q has shape {q.shape}; expected ({s.n + 5},) for {s.n} links")
    if not np.isfinite(q).all():
        bad = [i for i in range(len(q)) if not np.isfinite(q[i])]
        raise ModelError(f"q is not finite at index {bad}")
    half = robot.half_length_m
    rpy, point = q[3:6], q[:3]
    if robot.planar:
        rpy = np.array([0.0, 0.0, q[5]])
        point = np.array([q[0], q[1], robot.wheel_radius_m])
    rotation = rotation_from_rpy(rpy)
    points, centers, axes = [point], [], []
    for joint in range(s.n_h):
        forward = rotation[:, 0]
        centers.append(point - half * forward)
        point = point - 2 * half * forward
        points.append(point)
        axes.append(rotation @ s.axes[joint])
        rotation = rotation @ _joint_rotation(s.axes[joint], q[6 + joint])
    head_points, head_axes = np.array(points), np.reshape(axes, (s.n_h, 3))
    twists = _twists(rpy, rotation, head_points, head_axes)
    if robot.planar:
        twists[:, 2:5] = 0.0

    base = planar_base(s, q[6 + s.n_h :])
    return Geometry(
        s=s,
        x=base.x,
        y=base.y,
        centers=base.centers,
        hitches=base.hitches,
        q=q,
        base_rotation=rotation,
        base_origin=point,
        head_points=head_points,
        head_centers=np.reshape(centers, (s.n_h, 3)),
        head_axes=head_axes,
        twists=twists,
    )


def planar_base(s: Structure, base_angles: Array) -> PlanarBase:
    """Return the base part for the angles of joints n_h+1 .. n-1, (n_b - 1,) [rad]."""
    half = s.robot.half_length_m
    heading = np.concatenate(([0.0], np.cumsum(base_angles)))
    x = np.stack((np.cos(heading), np.sin(heading)), axis=1)
    y = np.stack((-x[:, 1], x[:, 0]), axis=1)
    ends = -2 * half * np.cumsum(x, axis=0)
    return PlanarBase(s=s, x=x, y=y, centers=ends + half * x, hitches=ends[:-1])


def _joint_rotation(axis: Array, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    if axis[1]:
        return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _twists(rpy: Array, base_rotation: Array, points: Array, axes: Array) -> Array:
    turning = np.hstack((rpy_rate_map(rpy), axes.T))
    # R, P, Y turn about the tip; joint i turns about the front end of link i + 1.
    pivots = points[[0, 0, 0, *range(1, len(points))]]
    twists = np.zeros((6, 3 + turning.shape[1]))
    twists[:3, :3] = base_rotation.T
    twists[:3, 3:] = base_rotation.T @ cross(turning, (points[-1] - pivots).T)
    twists[3:, 3:] = base_rotation.T @ turning
    return twists


def link_points(robot: RobotConfig, q: ArrayLike) -> Array:
    """Return the front ends of links 1 .. n and the tail's end in the world, (n+1, 3) [m]."""
    g = geometry(robot, q)
    tail = g.centers[-1] - robot.half_length_m * g.x[-1]
    return np.vstack((g.head_points, g.to_world(np.vstack((g.hitches, tail)))))


def link_centers(g: Geometry) -> Array:
    """Return the centres of links 1 .. n in the world, (n, 3) [m]."""
    return np.vstack((g.head_centers, g.to_world(g.centers)))


def wheel_contacts(g: Geometry) -> Array:
    """Return where the wheels touch the floor, seen from above, (n_b - m_b, 2, 2) [m].

    First index: wheeled base links; second: left, right wheel; third: x, y in the world.
    """
    s = g.s
    side = s.robot.wheel_offset_m * g.y[s.wheeled]
    centers = g.centers[s.wheeled]
    return g.to_world(np.stack((centers + side, centers - side), axis=1))[..., :2]
