"""Curves that the head can follow, by their length, and motion along them from rest to rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.special import ellipj, ellipk

from snake_control.control.reference import Reference
from snake_control.trajectory.rest_to_rest import RestToRest

Array = NDArray[np.float64]

_SAMPLES = 10
_MOST_MOMENTS = 2000


class PathPoint(NamedTuple):
    """Where a curve is, and how it goes on.

    Attributes:
        w: [x, y, z, R, P, Y], (6,) [m, rad].
        by_s, by_s2: first and second derivative by the length, (6,) [1, rad/m, 1/m, rad/m^2].
    """

    w: Array
    by_s: Array
    by_s2: Array


class Path(Protocol):
    """A curve in space with an attitude at each of its points.

    Attributes:
        length: of the curve on the floor plan [m]; turning may count, too.
        pieces: of how many the curve consists.
    """

    length: float
    pieces: int

    def at(self, s: float) -> PathPoint:
        """Return the point after the length ``s`` [m], 0 .. ``length``."""


class Circle:
    """A horizontal circle through the start, ahead of the head; the head turns with it."""

    def __init__(self, start_pose: ArrayLike, radius: float, turns: float = 1.0) -> None:
        """Define the circle.

        Args:
            start_pose: [x, y, z, R, P, Y], (6,) [m, rad]; the circle leaves it along its yaw.
            radius: not 0; positive turns left [m].
            turns: how often round, > 0.
        """
        self._start = np.array(start_pose, dtype=float)
        self._radius = radius
        self.length = math.tau * abs(radius) * turns
        self.pieces = max(1, math.ceil(4.0 * turns))

    def at(self, s: float) -> PathPoint:
        """Return the point after the length ``s`` [m]."""
        turn = 1.0 / self._radius
        first, now = self._start[5], self._start[5] + turn * s
        w = self._start.copy()
        w[0] += self._radius * (math.sin(now) - math.sin(first))
        w[1] -= self._radius * (math.cos(now) - math.cos(first))
        w[5] = now
        c, t = math.cos(now), math.sin(now)
        return PathPoint(
            w,
            np.array([c, t, 0.0, 0.0, 0.0, turn]),
            np.array([-turn * t, turn * c, 0.0, 0.0, 0.0, 0.0]),
        )


class FigureEight:
    """A horizontal eight: Bernoulli's lemniscate, from its crossing; the head turns with it.

    With s/a = t the curve is at distance a sl(t) from the crossing, in the direction of
    -arctan cl(t) from its axis, and its curvature is 3 sl(t) / a (lemniscate sine and cosine), so
    that the sharpest radius, at the far ends, is a / 3.
    """

    def __init__(self, start_pose: ArrayLike, radius: float, rounds: float = 1.0) -> None:
        """Define the eight.

        Args:
            start_pose: the crossing, [x, y, z, R, P, Y], (6,) [m, rad]; the curve leaves it along
                its yaw.
            radius: smallest radius of the curve, not 0; positive turns left first [m].
            rounds: how often round, > 0; a half is one loop.
        """
        self._start = np.array(start_pose, dtype=float)
        self._side = math.copysign(1.0, radius)
        self._a = 3.0 * abs(radius)
        self.length = 4.0 * _QUARTER * self._a * rounds
        self.pieces = max(1, math.ceil(8.0 * rounds))

    def at(self, s: float) -> PathPoint:
        """Return the point after the length ``s`` [m]."""
        a, side = self._a, self._side
        sn, cn, dn, _ = map(float, ellipj(math.sqrt(2.0) * s / a, 0.5))
        sl = sn / (math.sqrt(2.0) * dn)
        # From the axis of the eight, which lies 45 degrees to the side of the start.
        direction = -math.atan(cn)
        turned = 3.0 * (direction + math.pi / 4)
        axis = self._start[5] + side * math.pi / 4
        now = self._start[5] + side * turned
        w = self._start.copy()
        w[0] += a * sl * math.cos(axis + side * direction)
        w[1] += a * sl * math.sin(axis + side * direction)
        w[5] = now
        c, t = math.cos(now), math.sin(now)
        curvature = 3.0 * side * sl / a
        # d sl = cl (1 + sl^2) dt.
        change = 3.0 * side * cn * (1.0 + sl * sl) / a**2
        return PathPoint(
            w,
            np.array([c, t, 0.0, 0.0, 0.0, curvature]),
            np.array([-curvature * t, curvature * c, 0.0, 0.0, 0.0, change]),
        )


class Straight:
    """From one pose to another; each coordinate changes evenly."""

    def __init__(self, start_pose: ArrayLike, by: ArrayLike, length: float) -> None:
        """Define the path.

        Args:
            start_pose: [x, y, z, R, P, Y], (6,) [m, rad].
            by: by how much they change, (6,) [m, rad].
            length: what counts as its length, >= 0 [m].
        """
        self._start = np.array(start_pose, dtype=float)
        self._by = np.array(by, dtype=float)
        self.length = length
        self.pieces = 1

    def at(self, s: float) -> PathPoint:
        """Return the point after the length ``s`` [m]."""
        slope = self._by / self.length
        return PathPoint(self._start + s * slope, slope, np.zeros(6))


class Through:
    """Through poses: the cubic spline by the length of the straight ways between them."""

    def __init__(self, poses: ArrayLike, lengths: ArrayLike, names: Sequence[str] = ()) -> None:
        """Define the path.

        Args:
            poses: [x, y, z, R, P, Y], no whole turns between two of them, (k, 6) [m, rad].
            lengths: of the ways between them, > 0, (k-1,) [m].
            names: what to call each pose.
        """
        self._names = list(names)
        self._knots = np.concatenate(([0.0], np.cumsum(np.asarray(lengths, dtype=float))))
        self.length = float(self._knots[-1])
        self.pieces = len(self._knots) - 1
        self._spline = CubicSpline(self._knots, np.asarray(poses, dtype=float), bc_type="natural")

    def name(self, s: float) -> str:
        """Return the name of the pose that comes next after the length ``s`` [m]."""
        i = min(int(np.searchsorted(self._knots, s)), self.pieces)
        return self._names[i] if self._names else ""

    def at(self, s: float) -> PathPoint:
        """Return the point after the length ``s`` [m]."""
        return PathPoint(self._spline(s), self._spline(s, 1), self._spline(s, 2))


_QUARTER = float(ellipk(0.5)) / math.sqrt(2.0)
"""Length of a quarter of the lemniscate with a = 1: half of the lemniscate constant, 1.3110."""


class Along:
    """Follows a path: speeds up evenly, keeps a speed, slows down evenly, and holds the end.

    The acceleration itself grows and shrinks as sin^2, so the motion is smooth up to it.

    Attributes:
        path: the curve.
        duration: [s].
        ramp: how long it speeds up, and slows down [s].
    """

    def __init__(self, path: Path, speed: float, acceleration: float, start: float = 0.0) -> None:
        """Define the motion.

        Args:
            path: the curve.
            speed: along it, > 0 [m/s]; not reached on a path that is too short.
            acceleration: largest acceleration along it, > 0 [m/s^2].
            start: time at which it starts [s]; before it the start is held.
        """
        self.path = path
        self._start = start
        self._profile = RestToRest(path.length, speed, acceleration)
        self.ramp, self.duration = self._profile.ramp, self._profile.duration

    def sample(self, t: float) -> Reference:
        """Return pose, rate and acceleration at time ``t`` [s]."""
        s, rate, acceleration = self._profile.at(t - self._start)
        point = self.path.at(s)
        return Reference(
            point.w, rate * point.by_s, acceleration * point.by_s + rate**2 * point.by_s2
        )

    def progress(self, t: float) -> float:
        """Return the length that is behind it at time ``t`` since its start [m]."""
        return self._profile.at(t).s

    def moments(self) -> Array:
        """Return times from begin to end, (k,) [s]."""
        samples = min(_MOST_MOMENTS, _SAMPLES * self.path.pieces)
        cruise = np.linspace(self.ramp, self.duration - self.ramp, samples)
        ramp = np.linspace(0.0, self.ramp, _SAMPLES)
        return np.concatenate((ramp, cruise, self.duration - ramp[::-1]))
