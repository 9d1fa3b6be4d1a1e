"""How fast a commanded head may move, and how fast that may change."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PITCH_LIMIT_RAD = math.radians(80.0)
"""Commanded motion stops here: at 90 degrees of pitch, roll and yaw are no coordinates any more."""


@dataclasses.dataclass(frozen=True)
class MotionLimits:
    """Limits of a commanded motion of the head.

    Attributes:
        linear_speed: largest speed of the tip [m/s].
        angular_speed: largest angular speed that a command may ask for [rad/s].
        linear_acceleration: largest acceleration of the tip [m/s^2].
        angular_acceleration: largest rate of change of each of the rates of R, P, Y [rad/s^2].
    """

    linear_speed: float
    angular_speed: float
    linear_acceleration: float
    angular_acceleration: float

    def approach(self, rate: Array, wanted: Array, dt: float) -> Array:
        """Return ``rate`` moved towards ``wanted`` as far as ``dt`` allows.

        The velocity of the tip keeps to a straight line; R, P, Y are limited one by one.

        Args:
            rate: rates of [x, y, z, R, P, Y], shape (6,).
            wanted: the same, wanted.
            dt: time step [s].
        """
        change = wanted - rate
        # Where no limit bites the result is `wanted` to the last bit, so that rest is exactly 0.
        reached = wanted.copy()
        linear = shorten(change[:3], self.linear_acceleration * dt)
        if np.any(linear != change[:3]):
            reached[:3] = rate[:3] + linear
        largest = self.angular_acceleration * dt
        late = np.abs(change[3:]) > largest
        reached[3:][late] = rate[3:][late] + np.copysign(largest, change[3:][late])
        return reached

    def rate_to_stop_within(self, margin: float, rate: float, dt: float) -> float:
        """Return the largest rate of an angle after ``dt`` from which it still stops in time.

        Args:
            margin: how far the angle may still move [rad]; none left if not positive.
            rate: rate of the angle now [rad/s]; it changes evenly during ``dt``.
            dt: time step [s].
        """
        a = self.angular_acceleration
        # The last step before rest may need this much more than even braking.
        margin -= rate * dt / 2 + a * dt * dt / 8
        if margin <= 0:
            return 0.0
        # The root of v dt / 2 + v^2 / (2 a) = margin.
        return a * (math.sqrt(dt * dt / 4 + 2 * margin / a) - dt / 2)


def shorten(vector: Array, length: float) -> Array:
    """Return ``vector`` itself if it is no longer than ``length``, else scaled down to it."""
    norm = float(np.linalg.norm(vector))
    return vector if norm <= length else vector * (length / norm)
