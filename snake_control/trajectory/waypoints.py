"""Through poses at given times, smooth up to the acceleration, and at rest at its end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline, PPoly

from snake_control.control.reference import Reference
from snake_control.errors import TrajectoryError
from snake_control.model.rotation import wrap
from snake_control.trajectory.motion_limits import PITCH_LIMIT_RAD

Array = NDArray[np.float64]

_REST_S = 1e-3
_SAMPLES = 20
_MOST_MOMENTS = 4000


class Waypoints:
    """Position and attitude through poses, from rest to rest.

    Between two poses each coordinate is the polynomial of degree 5 that has pose, rate and
    acceleration of both. Where rates are not given, both are those of the cubic spline through the
    poses; so inside it is this spline, and at both ends the acceleration is 0.

    The attitude is interpolated as roll, pitch and yaw, each by the shorter way round: the
    coordinates of the controller, which have no pole within the pitch limit.

    Attributes:
        duration: from the first to the last pose [s].
        ramp: 0.
    """

    def __init__(
        self,
        times: Sequence[float],
        poses: ArrayLike,
        start: float = 0.0,
        rates: ArrayLike | None = None,
        names: Sequence[str] = (),
    ) -> None:
        """Define the motion.

        Args:
            times: of the poses, rising [s]; the first is when the motion starts.
            poses: [x, y, z, R, P, Y] of each, (k, 6) [m, rad], two or more.
            start: time of the clock at the first pose [s]; before it that is held, and the last one
                after the end.
            rates: of [x, y, z, R, P, Y] at each pose, (k, 6) [m/s, rad/s]; those of the first and
                the last do not count.
            names: what to call each pose in errors; ``pose 0``, ... by default.

        Raises:
            TrajectoryError: names the pose that is wrong.
        """
        t, w = np.array(times, dtype=float), np.array(poses, dtype=float)
        _check(t, w, names or [f"pose {i}" for i in range(len(w))])
        w = unwrapped(w)
        self.duration = float(t[-1] - t[0])
        self.ramp = 0.0
        self._start = start
        t -= t[0]
        if rates is None:
            rates = CubicSpline(t, w, bc_type="clamped")(t, 1)
        given = np.array(rates, dtype=float)
        given[[0, -1]] = 0.0
        self._spline = _quintic(t, w, given)

    def moments(self) -> Array:
        """Return times at and between the poses, (k,) [s]."""
        x = self._spline.x
        each = max(2, min(_SAMPLES, _MOST_MOMENTS // len(x)))
        between = np.linspace(x[:-1], x[1:], each, endpoint=False).ravel()
        return np.union1d(between, x)

    def many(self, t: Array) -> Array:
        """Return pose, rate and acceleration at times (k,) since its start, (3, k, 6)."""
        return np.array([self._spline(t, order) for order in (0, 1, 2)])

    def sample(self, t: float) -> Reference:
        """Return pose, rate and acceleration at time ``t`` [s]."""
        at = t - self._start
        if not 0.0 <= at <= self.duration:
            at = min(max(at, 0.0), self.duration)
            return Reference(self._spline(at), np.zeros(6))
        return Reference(self._spline(at), self._spline(at, 1), self._spline(at, 2))


def unwrapped(poses: ArrayLike) -> Array:
    """Return poses, (k, 6), with whole turns added to R, P, Y: each by the shorter way."""
    w = np.array(poses, dtype=float)
    w[1:, 3:] = w[0, 3:] + np.cumsum(wrap(np.diff(w[:, 3:], axis=0)), axis=0)
    return w


def lengths_at_speed(poses: ArrayLike, speed: float, turning_speed: float) -> Array:
    """Return how long the way between poses is, turning included, (k-1,) [m].

    Where turning takes longer than moving, it is the way of the tip in that time.

    Args:
        poses: [x, y, z, R, P, Y] of each, (k, 6) [m, rad].
        speed: of the tip, > 0 [m/s].
        turning_speed: of each of R, P, Y, > 0 [rad/s].
    """
    way = np.diff(np.array(poses, dtype=float), axis=0)
    lengths = np.linalg.norm(way[:, :3], axis=1)
    angles = np.abs(wrap(way[:, 3:])).max(axis=1, initial=0.0)
    return np.maximum(lengths, angles * (speed / turning_speed))


def times_at_speed(poses: ArrayLike, speed: float, turning_speed: float) -> list[float]:
    """Return times at which poses are reached at given mean speeds, the first at 0 [s].

    Args:
        poses: [x, y, z, R, P, Y] of each, (k, 6) [m, rad].
        speed: of the tip, > 0 [m/s].
        turning_speed: of each of R, P, Y, > 0 [rad/s]; the slower of both counts.
    """
    legs = np.maximum(lengths_at_speed(poses, speed, turning_speed) / speed, _REST_S)
    return [0.0, *np.cumsum(legs).tolist()]


def _quintic(t: Array, w: Array, rates: Array) -> PPoly:
    """Return polynomials of degree 5 through values and rates, at rest at both ends.

    The acceleration at a pose is the mean of those of the two polynomials of degree 3 that meet
    there; at both ends it is 0.
    """
    h = np.diff(t)[:, None]
    way = np.diff(w, axis=0)
    v0, v1 = rates[:-1] * h, rates[1:] * h
    begin, end = (6 * way - 4 * v0 - 2 * v1) / h**2, (2 * v0 + 4 * v1 - 6 * way) / h**2
    accelerations = np.zeros_like(w)
    accelerations[1:-1] = (end[:-1] + begin[1:]) / 2
    a0, a1 = accelerations[:-1] * h**2, accelerations[1:] * h**2
    c = [
        (12 * way - 6 * (v0 + v1) + a1 - a0) / (2 * h**5),
        (-30 * way + 16 * v0 + 14 * v1 + 3 * a0 - 2 * a1) / (2 * h**4),
        (20 * way - 12 * v0 - 8 * v1 - 3 * a0 + a1) / (2 * h**3),
        accelerations[:-1] / 2,
        rates[:-1],
        w[:-1],
    ]
    return PPoly(np.array(c), t)


def _check(t: Array, w: Array, names: Sequence[str]) -> None:
    if w.ndim != 2 or w.shape[1] != 6 or len(w) < 2 or t.shape != (len(w),):
        raise TrajectoryError(
            f"{len(t)} times and poses of shape {w.shape}: give a time and 6 numbers (x, y, z, R, "
            "P, Y) for each of two poses or more"
        )
    check_poses(w, names)
    for i in np.flatnonzero(~np.isfinite(t)).tolist():
        raise TrajectoryError(f"{names[i]} is not finite: t = {t[i]}, {w[i].tolist()}")
    for i in np.flatnonzero(np.diff(t) <= 0.0).tolist():
        raise TrajectoryError(
            f"{names[i + 1]} comes at {t[i + 1]:g} s, not after {names[i]} at {t[i]:g} s"
        )


def check_poses(w: Array, names: Sequence[str]) -> None:
    """Raise ``TrajectoryError`` naming the pose of (k, 6) that is not finite or too steep."""
    for i in np.flatnonzero(~np.isfinite(w).all(axis=1)).tolist():
        raise TrajectoryError(f"{names[i]} is not finite: {w[i].tolist()}")
    for i in np.flatnonzero(np.abs(w[:, 4]) > PITCH_LIMIT_RAD).tolist():
        raise TrajectoryError(
            f"{names[i]}: pitch {w[i, 4]:.3g} rad, allowed: +-{PITCH_LIMIT_RAD:.3g}"
        )
