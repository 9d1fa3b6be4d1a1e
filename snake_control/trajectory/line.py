"""The head moves along a line at constant rates: the trajectory of the paper's Table 1."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.control.reference import Reference

Array = NDArray[np.float64]


class Line:
    """w_d(t) = w_d(0) + velocity (t - start), and its end held if it has one.

    The rate steps to 0 at the end, as it steps from 0 at the start: the paper's reference does
    not accelerate. ``Teleop`` is the one that does.
    """

    def __init__(
        self, start_pose: ArrayLike, velocity: ArrayLike, start: float, duration: float = 0.0
    ) -> None:
        """Define the line.

        Args:
            start_pose: w_d at ``start``, [x, y, z, R, P, Y], shape (6,) [m, rad].
            velocity: rates of the same, shape (6,) [m/s, rad/s].
            start: time at which it starts [s]; before it the start pose is held.
            duration: after this long the end is held [s]; 0 for never.
        """
        self._start_pose = np.array(start_pose, dtype=float)
        self._velocity = np.array(velocity, dtype=float)
        self._start = start
        self._duration = duration

    def sample(self, t: float) -> Reference:
        """Return pose and rate at time ``t`` [s]."""
        elapsed = t - self._start
        moving = elapsed >= 0 and not self._is_over(elapsed)
        if not moving:
            elapsed = 0.0 if elapsed < 0 else self._duration
        return Reference(
            self._start_pose + self._velocity * elapsed,
            self._velocity if moving else np.zeros(6),
        )

    def path(self, points: int, endless_s: float) -> list[tuple[float, Array]]:
        """Return evenly spaced (time [s], pose (6,)) from the start to the end.

        Args:
            points: how many, at least 2.
            endless_s: how much of a line without an end to return [s].
        """
        length = self._duration if self._duration > 0 else endless_s
        return [
            (self._start + elapsed, self._start_pose + self._velocity * elapsed)
            for elapsed in np.linspace(0.0, length, points).tolist()
        ]

    def _is_over(self, elapsed: float) -> bool:
        return self._duration > 0 and elapsed >= self._duration
