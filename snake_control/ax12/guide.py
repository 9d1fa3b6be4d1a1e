"""Direction, zero offset and range of a joint, from positions that somebody turns it to by hand.

The servo's angle is counter-clockwise from position 512; a joint's positive direction is the
robot's: a pitch joint raises what is in front of it, a yaw joint bends the robot to the right, seen
from above.
"""

from __future__ import annotations

import dataclasses

from snake_control.ax12.joint import WHEEL_MODE, JointSetup
from snake_control.ax12.units import MAX_TICKS, ticks_to_rad

LEAST_TICKS = 30
"""Way that tells a direction, 8.8 degrees."""

POSITIVE = {
    "pitch": "so that the part in front of it rises",
    "yaw": "so that the robot bends to the right, seen from above",
}


@dataclasses.dataclass(frozen=True)
class Measured:
    """What was found about one joint.

    Attributes:
        direction: +1 or -1.
        zero_offset: servo angle at joint angle 0 [rad].
        lower, upper: ends of the joint's way [rad], as far as loads (compliance margin and slope)
            cannot move it past the end of the sensor.
        remarks: what is not as configured, or cannot be.
    """

    direction: int
    zero_offset: float
    lower: float
    upper: float
    remarks: tuple[str, ...]


def direction_of(straight: int, turned: int) -> int | None:
    """Return the direction from positions before and after a turn to the positive side.

    ``None`` if the turn was too small to tell, or a position does not exist.
    """
    if not (0 <= straight <= MAX_TICKS and 0 <= turned <= MAX_TICKS):
        return None
    way = turned - straight
    if abs(way) < LEAST_TICKS:
        return None
    return 1 if way > 0 else -1


def measure(joint: JointSetup, direction: int, straight: int, ends: tuple[int, int]) -> Measured:
    """Return what positions say about a joint, and how that differs from its configuration.

    Args:
        joint: as configured.
        direction: as found.
        straight: position at joint angle 0.
        ends: positions at both ends, in any order.
    """
    offset = ticks_to_rad(straight)
    seen = ends
    if joint.mode != WHEEL_MODE:
        # The sensor's middle is 512, a half beyond the middle of its ticks.
        first, last = joint.compliance_ticks + 1, MAX_TICKS - joint.compliance_ticks
        seen = (min(max(ends[0], first), last), min(max(ends[1], first), last))
    angles = sorted(direction * (ticks_to_rad(end) - offset) for end in seen)
    remarks = []
    if direction != joint.direction:
        remarks.append(f"servos.directions is {joint.direction:+d}, the joint turns {direction:+d}")
    tick = ticks_to_rad(513)
    if abs(offset - joint.zero_offset) > 3 * tick:
        remarks.append(
            f"servos.zero_offsets_rad is {joint.zero_offset:.3f}, straight is at {offset:.3f} rad"
        )
    if not min(ends) < straight < max(ends):
        remarks.append("straight does not lie between the ends: measure this joint again")
    if min(ends) <= 2 or max(ends) >= MAX_TICKS - 2:
        remarks.append(
            "an end lies at the edge of the servo's 300 degrees: mount the horn so that straight "
            "is near position 512"
        )
    lower, upper = angles
    if lower > joint.lower + tick or upper < joint.upper - tick:
        remarks.append(
            f"robot.joint_limits_rad allows {joint.lower:.3f} to {joint.upper:.3f}, it can do "
            f"{lower:.3f} to {upper:.3f} rad"
        )
    return Measured(direction, offset, lower, upper, tuple(remarks))
