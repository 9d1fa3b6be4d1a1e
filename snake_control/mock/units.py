"""Register units of an AX-12 in SI, and the one convention for angles in this room.

The servo angle is counted counter-clockwise (seen from the horn) from position 512:
``angle = (ticks - 512) * 300/1023 degrees``. The manual leaves open whether 511, 511.5 or 512 is
the centre; the choices differ by less than one tick.
"""

from __future__ import annotations

import math

CENTRE_TICKS = 512
MAX_TICKS = 1023
TICK_RAD = math.radians(300 / 1023)
"""One unit of Goal Position, Present Position, compliance margin and slope [rad]."""

SPEED_UNIT_RAD_S = 0.111 * 2 * math.pi / 60
"""One unit of Moving Speed in joint mode and of Present Speed, 0.111 rpm [rad/s]."""

OUTPUT_STEPS = 1023
"""Units of torque limit, punch, wheel speed and load in the full output."""

DIRECTION_BIT = 1 << 10
"""Set for clockwise in Moving Speed (wheel mode), Present Speed and Present Load."""


def angle_from_ticks(ticks: float) -> float:
    """Servo angle [rad] of a position."""
    return (ticks - CENTRE_TICKS) * TICK_RAD


def ticks_from_angle(angle_rad: float) -> float:
    """Position of a servo angle, neither rounded nor limited to the sensor's range."""
    return CENTRE_TICKS + angle_rad / TICK_RAD


def in_sensor_range(angle_rad: float) -> bool:
    """Whether the position sensor sees an angle; full turns do not count."""
    ticks = ticks_from_angle(math.remainder(angle_rad, 2 * math.pi))
    return -0.5 <= ticks <= MAX_TICKS + 0.5


def signed_magnitude(value: float, largest: int = 1023) -> int:
    """Round to a magnitude of 10 bits, with the direction bit for negative (clockwise) values."""
    magnitude = min(round(abs(value)), largest)
    return magnitude | DIRECTION_BIT if value < 0 and magnitude else magnitude
