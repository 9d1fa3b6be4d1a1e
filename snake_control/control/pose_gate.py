"""Whether a measured pose of the head is believed, after what was measured before.

A pose further from the last good one than the head can have moved is an outlier. Outliers that
agree with each other are a robot that was carried, or a motion capture that has found another
origin: after a number of them in a row, over no less than the time-out, they are the new place.
By then whoever follows the head has come to rest, because the last good pose is too old.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from snake_control.control.head_filter import HeadEstimate, Reason, Rejection

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class JumpLimits:
    """What motion between two poses is believed.

    Attributes:
        speed_m_s, turning_rad_s: fastest motion of a head.
        tolerance_m, tolerance_rad: what is believed however short the time is.
        new_place_after: so many outliers in a row that agree are the new place,
        horizon_s: if they last for so long. The head is not taken to have moved on for longer.
    """

    speed_m_s: float
    turning_rad_s: float
    tolerance_m: float
    tolerance_rad: float
    new_place_after: int
    horizon_s: float


@dataclasses.dataclass(frozen=True)
class NewPlace:
    """Outliers that were believed at last.

    Attributes:
        distance_m, angle_rad: how far from where the head was.
        poses: how many agreed.
    """

    distance_m: float
    angle_rad: float
    poses: int

    def __str__(self) -> str:
        return (
            f"the head is at another place, {self.distance_m:.3f} m and {self.angle_rad:.2f} rad "
            f"away ({self.poses} poses agree): its speed starts anew, at rest"
        )


@dataclasses.dataclass(frozen=True)
class _Candidate:
    """The newest of some outliers that agree."""

    stamp_ns: int
    position: Array
    rotation: Rotation
    begun_ns: int
    poses: int


class JumpGate:
    """Holds each pose against the last good one, and outliers against each other."""

    def __init__(self, limits: JumpLimits) -> None:
        self._limits = limits
        self._candidate: _Candidate | None = None

    def judge(
        self, stamp_ns: int, position: Array, rotation: Rotation, last: HeadEstimate | None
    ) -> Rejection | NewPlace | None:
        """Return ``None`` for a pose that can be, why it cannot, or that it is a new place.

        Args:
            stamp_ns: time of capture [ns].
            position: of the tip in the world, (3,) [m].
            rotation: attitude of the head.
            last: the last good one.
        """
        if last is None:
            return None
        distance, angle = _apart(position, rotation, last.position, last.rotation)
        good = self._can_be(distance, angle, stamp_ns - last.stamp_ns)
        now = _Candidate(stamp_ns, position, rotation, stamp_ns, 1)
        if before := self._candidate:
            apart = _apart(position, rotation, before.position, before.rotation)
            if self._can_be(*apart, stamp_ns - before.stamp_ns):
                now = dataclasses.replace(now, begun_ns=before.begun_ns, poses=before.poses + 1)
                # An outlier that stays does not become believable by waiting.
                good = good and self._far(distance, angle) <= self._far(*apart)
        if good:
            self._candidate = None
            return None
        self._candidate = now
        lasted = (stamp_ns - now.begun_ns) * 1e-9
        if now.poses >= self._limits.new_place_after and lasted >= self._limits.horizon_s:
            self._candidate = None
            return NewPlace(distance, angle, now.poses)
        return Rejection(
            Reason.JUMP,
            f"pose is {distance:.3f} m and {angle:.2f} rad from the last good one, further than "
            f"the head can have moved ({now.poses} of {self._limits.new_place_after} that agree)",
        )

    def _far(self, distance: float, angle: float) -> float:
        """How far two poses are apart, as a share of what a head may move within the horizon."""
        limits = self._limits
        return max(
            distance / (limits.tolerance_m + limits.speed_m_s * limits.horizon_s),
            angle / (limits.tolerance_rad + limits.turning_rad_s * limits.horizon_s),
        )

    def _can_be(self, distance: float, angle: float, step_ns: int) -> bool:
        limits = self._limits
        dt = min(max(step_ns * 1e-9, 0.0), limits.horizon_s)
        return (
            distance <= limits.tolerance_m + limits.speed_m_s * dt
            and angle <= limits.tolerance_rad + limits.turning_rad_s * dt
        )


def _apart(
    position: Array, rotation: Rotation, other_position: Array, other_rotation: Rotation
) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses."""
    return (
        float(np.linalg.norm(position - other_position)),
        float((rotation * other_rotation.inv()).magnitude()),
    )
