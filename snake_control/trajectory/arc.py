"""The head moves along a horizontal arc and turns with it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from snake_control.control.reference import Reference


class Arc:
    """The head's path turns at a constant rate, and the head with it.

    At ``t = 0`` the head is at the start pose and moves along its yaw; roll, pitch and height stay.
    """

    def __init__(self, start_pose: ArrayLike, speed: float, radius: float) -> None:
        """Define the arc.

        Args:
            start_pose: w_d at t = 0, [x, y, z, R, P, Y], shape (6,) [m, rad].
            speed: along the arc, > 0 [m/s].
            radius: of the arc, not 0; > 0 turns left [m].
        """
        self._start = np.array(start_pose, dtype=float)
        self._speed = speed
        self._radius = radius

    def sample(self, t: float) -> Reference:
        """Return pose and rate at time ``t`` [s]."""
        turn = self._speed / self._radius
        first, now = self._start[5], self._start[5] + turn * t
        w_d = self._start.copy()
        w_d[0] += self._radius * (np.sin(now) - np.sin(first))
        w_d[1] -= self._radius * (np.cos(now) - np.cos(first))
        w_d[5] = now
        rate = np.array([self._speed * np.cos(now), self._speed * np.sin(now), 0, 0, 0, turn])
        return Reference(w_d, rate)
