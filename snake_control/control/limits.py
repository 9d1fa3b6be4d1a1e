"""Joint speed and joint range limits on a whole velocity vector."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from snake_control.config import RobotConfig

Array = NDArray[np.float64]

# Six ticks of an AX-12. Friction stops a servo up to four ticks short of a goal at the end of the
# range; with a smaller margin a joint would stand there, pushed outwards, and nobody would know.
RANGE_MARGIN_RAD = 0.0307


class Limited(NamedTuple):
    """A velocity vector within limits, and what had to be done to it.

    Attributes:
        u: joint velocities, (n-1,) [rad/s].
        speed_scale: factor the whole vector was scaled down with, 0..1.
        speed_limited: joints whose speed limit set that factor, counted from 1.
        range_limited: joints at an end of their range that lost an outward velocity, from 1.
    """

    u: Array
    speed_scale: float
    speed_limited: tuple[int, ...]
    range_limited: tuple[int, ...]


class JointLimits:
    """The limits of one robot.

    Attributes:
        speeds: largest speed of each joint, (n-1,) [rad/s].
        lower, upper: ends of the joints' ranges, less what is kept of them, (n-1,) [rad].
    """

    def __init__(self, robot: RobotConfig) -> None:
        self.speeds = np.array(robot.joint_speed_limits_rad_s)
        bounds = np.array(robot.joint_limits_rad).reshape(-1, 2)
        self.lower = bounds[:, 0] + RANGE_MARGIN_RAD
        self.upper = bounds[:, 1] - RANGE_MARGIN_RAD

    def apply(self, phi: Array, u: Array) -> Limited:
        """Limit joint velocities.

        A joint at the end of its range gets no velocity outwards (its wheels then slip). Then the
        whole vector is scaled, never a single joint: all wheel constraints are linear in the
        joint velocities and stay fulfilled.

        Args:
            phi: joint angles, (n-1,) [rad].
            u: wanted joint velocities, finite, (n-1,) [rad/s].
        """
        range_limited: tuple[int, ...] = ()
        # The largest of a list is quicker than numpy's of a few numbers.
        if max(np.maximum(phi - self.upper, self.lower - phi).tolist()) >= 0.0:
            outward = ((phi >= self.upper) & (u > 0)) | ((phi <= self.lower) & (u < 0))
            range_limited = _joints(outward)
            u = np.where(outward, 0.0, u)
        excess = np.abs(u) / self.speeds
        worst = max(excess.tolist())
        if worst <= 1.0:
            return Limited(u, 1.0, (), range_limited)
        # Only the joint that is furthest beyond its limit determines the scale.
        return Limited(u / worst, 1.0 / worst, _joints(excess >= worst), range_limited)


def _joints(chosen: NDArray[np.bool_]) -> tuple[int, ...]:
    return tuple((chosen.nonzero()[0] + 1).tolist())
