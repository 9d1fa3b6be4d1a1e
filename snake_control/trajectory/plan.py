"""From the poses that somebody asks for to a motion that begins where the head is."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.control.reference import Reference
from snake_control.errors import TrajectoryError
from snake_control.trajectory.motion_limits import PITCH_LIMIT_RAD
from snake_control.trajectory.waypoints import Waypoints, times_at_speed

Array = NDArray[np.float64]

_ROUNDING = 1.0 + 1e-6


class Plan:
    """A motion through poses, ready to be started.

    Attributes:
        duration: [s].
    """

    def __init__(
        self,
        config: TrajectoryGeneratorConfig,
        start: Reference,
        poses: ArrayLike,
        times: Sequence[float] = (),
        speed: float = 0.0,
        turning_speed: float = 0.0,
    ) -> None:
        """Plan a motion.

        Args:
            config: speeds.
            start: where it begins, and with which rate.
            poses: [x, y, z, R, P, Y] to go through, (k, 6) [m, rad], one or more.
            times: when to be there, counted from the start, rising [s]; none for ``speed``.
            speed, turning_speed: mean speeds without times [m/s, rad/s]; 0 for the configured ones.

        Raises:
            TrajectoryError: what cannot be, and where.
        """
        w = np.array(poses, dtype=float)
        if w.ndim != 2 or w.shape[1:] != (6,) or not len(w):
            raise TrajectoryError("no poses: give one or more")
        if times and len(times) != len(w):
            raise TrajectoryError(f"{len(times)} times for {len(w)} poses: give one for each")
        for name, value in (("speed", speed), ("turning_speed", turning_speed)):
            if not 0.0 <= value < np.inf:
                raise TrajectoryError(f"{name} is {value}: give more than 0, or 0 for the default")
        self._poses = np.vstack((start.w_d, w))
        if times:
            if not times[0] > 0.0:
                raise TrajectoryError(f"pose 0 is to be reached at {times[0]} s: give more than 0")
            self._times = [0.0, *times]
        else:
            own = config
            self._times = times_at_speed(
                self._poses, speed or own.speed_m_s, turning_speed or own.turning_speed_rad_s
            )
        self._rate = start.w_d_dot * start.time_scale
        motion = self.made()(0.0)
        self.duration = motion.duration
        fastest, turning, pitch = motion.fastest()
        if fastest > config.max_linear_speed_m_s * _ROUNDING:
            raise TrajectoryError(
                f"the head would move at {fastest:.3g} m/s, allowed: max_linear_speed_m_s = "
                f"{config.max_linear_speed_m_s:g}"
            )
        if turning > config.max_angular_speed_rad_s * _ROUNDING:
            raise TrajectoryError(
                f"the head would turn at {turning:.3g} rad/s, allowed: max_angular_speed_rad_s = "
                f"{config.max_angular_speed_rad_s:g}"
            )
        if pitch > PITCH_LIMIT_RAD:
            raise TrajectoryError(
                f"between its poses the head would pitch by {pitch:.3g} rad, allowed: "
                f"+-{PITCH_LIMIT_RAD:.3g}"
            )

    def made(self) -> Callable[[float], Waypoints]:
        """Return what makes the motion for the time at which it starts [s]."""
        return lambda start: Waypoints(self._times, self._poses, start, self._rate)
