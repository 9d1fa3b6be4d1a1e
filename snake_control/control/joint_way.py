"""A way through joint space: straight from corner to corner, all joints arriving together."""

from __future__ import annotations

import bisect
import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.trajectory.rest_to_rest import RestToRest

Array = NDArray[np.float64]

_NO_WAY_RAD = 1e-9


class WayPoint(NamedTuple):
    """Where the joints should be at one moment.

    Attributes:
        phi: angles, (k,) [rad].
        rate: velocities, (k,) [rad/s].
    """

    phi: Array
    rate: Array


class JointWay:
    """Goes straight from corner to corner, at rest in each of them; C2 in time.

    On each leg the joint that has the longest way, measured by its limits, moves at them; the
    others share its profile, so that all of them start and arrive together.

    Attributes:
        goal: the last corner, (k,) [rad].
        duration: of the whole way [s].
        top_speed: largest speed of any joint on it [rad/s].
    """

    def __init__(
        self, corners: Sequence[ArrayLike], speeds: ArrayLike, acceleration: float
    ) -> None:
        """Plan the way.

        Args:
            corners: the start, and where to go, one after the other, (k,) each [rad].
            speeds: largest speed of each joint, > 0, (k,) [rad/s].
            acceleration: largest acceleration of any joint, > 0 [rad/s^2].
        """
        points = [np.array(corner, dtype=float) for corner in corners]
        limits = np.asarray(speeds, dtype=float)
        self.goal = points[-1]
        self._legs: list[tuple[float, Array, Array, RestToRest]] = []
        self._begins: list[float] = []
        self.duration = self.top_speed = 0.0
        for start, end in itertools.pairwise(points):
            way = end - start
            longest = float(np.abs(way).max(initial=0.0))
            if longest <= _NO_WAY_RAD:
                continue
            # The profile's length is that of the joint with the longest way.
            speed = longest / float((np.abs(way) / limits).max())
            profile = RestToRest(longest, speed, acceleration)
            self._begins.append(self.duration)
            self._legs.append((self.duration, start, way / longest, profile))
            self.duration += profile.duration
            self.top_speed = max(self.top_speed, profile.speed)

    def at(self, t: float) -> WayPoint:
        """Return where to be at time ``t`` since the start [s]."""
        if not self._legs or t >= self.duration:
            return WayPoint(self.goal, np.zeros_like(self.goal))
        number = max(0, bisect.bisect_right(self._begins, t) - 1)
        begin, start, direction, profile = self._legs[number]
        done = profile.at(t - begin)
        return WayPoint(start + done.s * direction, done.rate * direction)
