"""Where every link, joint and wheel of the robot is, for one posture q.

All joints of the base part turn about the same axis (Assumption 2), so it is planar in the frame
of its first link, ``base``, level or not. Its origin is the front end of link n_h + 1, where joint
n_h turns. The head part is a spatial chain in the same frame. So only the three rows of
``base_rows`` know how the robot lies in the world; everything else follows from joint angles.

A planar snake is a base part alone, its frame that of link 1. It lies on the floor, so z, R and P
in its q stand for nothing and are not read.
"""

from __future__ import annotations

import copy
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.errors import ModelError
from snake_control.model.head_chain import HeadChain, base_rows, head_chain
from snake_control.model.lazy import lazy
from snake_control.model.structure import Structure, structure
from snake_control.model.vector import ZERO, Rows, Vector, cross, dot

Array = NDArray[np.float64]
Plane = NDArray[np.complex128]
"""Vectors or points of the base plane: x + i y in base coordinates."""

_LARGEST = 1e6


class PlanarBase:
    """The base part in the frame of its first link; depends on the base joints alone.

    Angles of shape (..., n_b - 1) make many of them at once, with those axes in front of all that
    is said here; so take them ``lateral_map``, ``lateral_velocities`` and ``model.rolling``.

    Attributes:
        s: index sets of the robot.
        forward: direction of each base link, (n_b,), in the plane x + i y as the next three.
        links: vector from rear to front end of each base link, (n_b,) [m].
        fronts: front end of each base link; but for the first, where its joint turns, (n_b,) [m].
        middles: centre of each base link, (n_b,) [m].
    """

    def __init__(self, s: Structure, base_angles: Array) -> None:
        """Work out the base part for the angles of joints n_h+1 .. n-1, (n_b - 1,) [rad]."""
        half = s.robot.half_length_m
        heading = np.zeros((*base_angles.shape[:-1], s.n_b))
        np.add.accumulate(base_angles, axis=-1, out=heading[..., 1:])
        self.s = s
        self.forward = np.exp(1j * heading)
        self.links = self.forward * (2 * half)
        behind: Plane = np.add.accumulate(self.links, axis=-1)
        self.fronts = self.links - behind
        self.middles = self.fronts - self.links * 0.5

    @property
    def x(self) -> Array:
        """Forward direction of each base link in base coordinates, (n_b, 2)."""
        return in_plane(self.forward)

    @property
    def y(self) -> Array:
        """Left direction of each base link in base coordinates, (n_b, 2)."""
        return in_plane(1j * self.forward)

    @property
    def centers(self) -> Array:
        """Link centres of the base part in base coordinates, (n_b, 2) [m]."""
        return in_plane(self.middles)

    @property
    def hitches(self) -> Array:
        """Where base joints n_h+1 .. n-1 turn, in base coordinates, (n_b - 1, 2) [m]."""
        return in_plane(self.fronts[1:])


class Geometry(PlanarBase):
    """A posture, worked out once and read by every model quantity.

    Attributes:
        q: [w, phi], (n+5,).
        chain: the head part in base coordinates.
        rows: rotation matrix of the base frame in the world by rows; row 2 is "up".
        attitude_axes: axes about which R, P and Y turn the robot, in base coordinates; 0 for R and
            P of a planar snake.
        pitch: P [rad]; 0 of a planar snake.
    """

    def __init__(self, s: Structure, q: Array, chain: HeadChain) -> None:
        """Work out the base part; ``chain`` belongs to the head joints of q."""
        super().__init__(s, q[6 + s.n_h :])
        self.chain = chain
        self._place(q)

    def _place(self, q: Array) -> None:
        chain, planar = self.chain, self.s.robot.planar
        _, _, _, roll, self.pitch, yaw = q[:6].tolist()
        if planar:
            roll = self.pitch = 0.0
        self.q = q
        self.rows, pitching = base_rows(chain.frame, roll, self.pitch, yaw)
        self.attitude_axes: Rows = chain.frame[0], pitching, self.rows[2]
        if planar:
            self.attitude_axes = ZERO, ZERO, self.rows[2]

    def moved(self, w: ArrayLike) -> Geometry:
        """Return the same joint angles with the head at another pose, (6,) [m, rad].

        Raises:
            ModelError: wrong shape, not finite, or beyond +-1e6.
        """
        q = checked_posture(self.s, np.concatenate((w, self.q[6:])))
        other = copy.copy(self)
        for of_the_pose in ("twists", "base_rotation", "base_origin"):
            other.__dict__.pop(of_the_pose, None)
        other._place(q)
        return other

    @lazy
    def twists(self) -> Array:
        """How the base frame moves for each of [w, phi_1 .. phi_(n_h)], (6, 6 + n_h).

        Linear velocity at its origin and angular velocity, in base coordinates. Nothing for z, R
        and P of a planar snake.
        """
        shifting = [(row, ZERO) for row in self.rows]
        if self.s.robot.planar:
            shifting[2] = (ZERO, ZERO)
        turning = [(cross(self.chain.tip, axis), axis) for axis in self.attitude_axes]
        everything = (*shifting, *turning, *self.chain.twists)
        return np.array([(*linear, *angular) for linear, angular in everything]).T

    @lazy
    def base_rotation(self) -> Array:
        """Columns are the axes of the base frame in the world, (3, 3)."""
        return np.array(self.rows)

    @lazy
    def base_origin(self) -> Array:
        """Front end of link n_h + 1 in the world, (3,)."""
        x, y, z = self.q[:3].tolist()
        if self.s.robot.planar:
            z = self.s.robot.wheel_radius_m
        tip = self.chain.tip
        a, b, c = self.rows
        return np.array([x - dot(a, tip), y - dot(b, tip), z - dot(c, tip)])

    @property
    def head_points(self) -> Array:
        """Front ends of links 1 .. n_h+1 in the world, (n_h+1, 3)."""
        return self._in_world([self.chain.tip, *self.chain.pivots])

    @property
    def head_centers(self) -> Array:
        """Centres of links 1 .. n_h in the world, (n_h, 3)."""
        return self._in_world(self.chain.centers)

    @property
    def head_axes(self) -> Array:
        """Axis of each head joint in the world, (n_h, 3)."""
        axes = np.reshape([axis for _, axis in self.chain.twists], (self.s.n_h, 3))
        return axes @ self.base_rotation.T

    def _in_world(self, points: list[Vector]) -> Array:
        return self.base_origin + np.reshape(points, (len(points), 3)) @ self.base_rotation.T

    def to_world(self, points: Array) -> Array:
        """Return points given in base coordinates, (..., 2), in the world, (..., 3)."""
        return self.base_origin + points @ self.base_rotation[:, :2].T


def geometry(robot: RobotConfig, q: ArrayLike) -> Geometry:
    """Work out the geometry of one posture.

    Args:
        robot: the robot.
        q: [x_h, y_h, z_h, R, P, Y, phi_1 .. phi_(n-1)], (n+5,) [m, rad].

    Raises:
        ModelError: wrong shape, not finite, or beyond +-1e6: no robot is 1000 km away, and an angle
            of that size has lost the digits that place the links.
    """
    s = structure(robot)
    q = checked_posture(s, q)
    return Geometry(s, q, head_chain(s, q[6 : 6 + s.n_h].tolist()))


def checked_posture(s: Structure, q: ArrayLike) -> Array:
    """Return q as an array, (n+5,).

    Raises:
        ModelError: see ``geometry``.
    """
    q = np.asarray(q, dtype=float)
    if q.shape != (s.n + 5,):
        raise ModelError(f"q has shape {q.shape}; expected ({s.n + 5},) for {s.n} links")
    # The norm is quicker, and silent where squares overflow; if large, look at every component.
    if not math.hypot(*q.tolist()) < _LARGEST:
        bad = [f"q[{i}] = {value:g}" for i, value in enumerate(q) if not abs(value) <= _LARGEST]
        if bad:
            raise ModelError(f"{', '.join(bad)}: give finite values, within +-{_LARGEST:g}")
    return q


def planar_base(s: Structure, base_angles: Array) -> PlanarBase:
    """Return the base part for the angles of joints n_h+1 .. n-1, (n_b - 1,) [rad]."""
    return PlanarBase(s, base_angles)


def in_plane(points: Plane) -> Array:
    """Return x + i y as pairs (x, y), (..., 2)."""
    return points.view(float).reshape(*points.shape, 2)


def link_points(robot: RobotConfig, q: ArrayLike) -> Array:
    """Return the front ends of links 1 .. n and the tail's end in the world, (n+1, 3) [m]."""
    g = geometry(robot, q)
    tail = in_plane(g.fronts[-1:] - g.links[-1:])
    return np.vstack((g.head_points, g.to_world(g.hitches), g.to_world(tail)))


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
