"""Through poses at given times: a cubic spline, C2, at rest at its end."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from snake_control.control.reference import Reference
from snake_control.errors import TrajectoryError
from snake_control.model.rotation import wrap
from snake_control.trajectory.motion_limits import PITCH_LIMIT_RAD

Array = NDArray[np.float64]

_REST_S = 1e-3
_SAMPLES = 20


class Waypoints:
    """Position and attitude through poses, from the rate given to rest.

    The attitude is interpolated as roll, pitch and yaw, each by the shorter way round: the
    coordinates of the controller, which have no pole within the pitch limit.

    Attributes:
        duration: from the first to the last pose [s].
    """

    def __init__(
        self,
        times: Sequence[float],
        poses: ArrayLike,
        start: float = 0.0,
        rate: ArrayLike | None = None,
    ) -> None:
        """Define the motion.

        Args:
            times: of the poses, rising [s]; the first is when the motion starts.
            poses: [x, y, z, R, P, Y] of each, (k, 6) [m, rad], two or more.
            start: time of the clock at the first pose [s]; before it that is held, and the last one
                after the end.
            rate: of [x, y, z, R, P, Y] at the first pose, (6,) [m/s, rad/s]; 0 by default.

        Raises:
            TrajectoryError: names the pose that is wrong.
        """
        t, w = np.array(times, dtype=float), np.array(poses, dtype=float)
        _check(t, w)
        w[1:, 3:] = w[0, 3:] + np.cumsum(wrap(np.diff(w[:, 3:], axis=0)), axis=0)
        self.duration = float(t[-1] - t[0])
        self._start = start
        first = np.zeros(6) if rate is None else np.array(rate, dtype=float)
        self._spline = CubicSpline(t - t[0], w, bc_type=((1, first), (1, np.zeros(6))))

    def fastest(self) -> tuple[float, float, float]:
        """Return the largest speeds of the tip [m/s] and of R, P, Y [rad/s], and of |P| [rad]."""
        turns = self._spline.derivative().roots(extrapolate=False)[4]
        at = np.union1d(
            np.linspace(0.0, self.duration, _SAMPLES * len(self._spline.x)),
            turns[np.isfinite(turns)],
        )
        rates = self._spline(at, 1)
        pitch = float(np.abs(self._spline(at)[:, 4]).max())
        return (
            float(np.linalg.norm(rates[:, :3], axis=1).max()),
            float(np.abs(rates[:, 3:]).max()),
            pitch,
        )

    def sample(self, t: float) -> Reference:
        """Return pose, rate and acceleration at time ``t`` [s]."""
        at = t - self._start
        if not 0.0 <= at <= self.duration:
            at = min(max(at, 0.0), self.duration)
            return Reference(self._spline(at), np.zeros(6))
        return Reference(self._spline(at), self._spline(at, 1), self._spline(at, 2))


def times_at_speed(poses: ArrayLike, speed: float, turning_speed: float) -> list[float]:
    """Return times at which poses are reached at given mean speeds, the first at 0 [s].

    Args:
        poses: [x, y, z, R, P, Y] of each, (k, 6) [m, rad].
        speed: of the tip, > 0 [m/s].
        turning_speed: of each of R, P, Y, > 0 [rad/s]; the slower of both counts.
    """
    w = np.array(poses, dtype=float)
    way = np.diff(w, axis=0)
    lengths = np.linalg.norm(way[:, :3], axis=1)
    angles = np.abs(wrap(way[:, 3:])).max(axis=1, initial=0.0)
    legs = np.maximum(np.maximum(lengths / speed, angles / turning_speed), _REST_S)
    return [0.0, *np.cumsum(legs).tolist()]


def _check(t: Array, w: Array) -> None:
    if w.ndim != 2 or w.shape[1] != 6 or len(w) < 2 or t.shape != (len(w),):
        raise TrajectoryError(
            f"{len(t)} times and poses of shape {w.shape}: give a time and 6 numbers (x, y, z, R, "
            "P, Y) for each of two poses or more"
        )
    for i, (time, pose) in enumerate(zip(t.tolist(), w, strict=True)):
        if not (math.isfinite(time) and np.isfinite(pose).all()):
            raise TrajectoryError(f"pose {i} is not finite: t = {time}, {pose.tolist()}")
        if abs(pose[4]) > PITCH_LIMIT_RAD:
            raise TrajectoryError(
                f"pose {i}: pitch {pose[4]:.3g} rad, allowed: +-{PITCH_LIMIT_RAD:.3g}"
            )
    for i in np.flatnonzero(np.diff(t) <= 0.0).tolist():
        raise TrajectoryError(
            f"pose {i + 1} comes at {t[i + 1]:g} s, not after pose {i} at {t[i]:g} s"
        )
