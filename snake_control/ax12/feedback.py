"""What one servo reports, checked before anybody believes it."""

from __future__ import annotations

import math

from snake_control.ax12 import control_table as ct
from snake_control.ax12.units import (
    MAX_RAW,
    MAX_SIGNED_RAW,
    MAX_TICKS,
    RAD_PER_TICK,
    decode_signed,
    load_to_fraction,
    raw_to_volt,
    speed_to_rad_s,
    ticks_to_rad,
)

MAX_RATE_RAD_S = 7.0
"""No AX-12 turns faster (6.2 rad/s without load at 12 V): a faster change is a misreading."""

_SLACK_TICKS = 4


class Feedback:
    """Last good state of one servo, in the servo's frame, with the time it was read.

    Attributes:
        angle: servo angle [rad]; NaN before the first good reply.
        rate: its velocity [rad/s] as the servo reports it, positive counter-clockwise.
        load: fraction of the maximum output, inferred by the servo from its own output.
        voltage: [V].
        temperature: [degC].
        error_bits: of the last reply, good or not.
        read_at: time of the last good reply [s]; minus infinity before the first.
        invalid_values: how many replies were not believed.
    """

    def __init__(self, wheel_speed_unit: float | None = None, max_rate: float = MAX_RATE_RAD_S):
        """Start without any reply.

        Args:
            wheel_speed_unit: rad/s for each unit of Present Speed in wheel mode; None: joint mode.
            max_rate: largest believable change of angle [rad/s].
        """
        self._wheel_speed_unit = wheel_speed_unit
        self._max_rate = max_rate
        self.angle = math.nan
        self.rate = math.nan
        self.load = math.nan
        self.voltage = math.nan
        self.temperature = math.nan
        self.error_bits = 0
        self.read_at = -math.inf
        self.invalid_values = 0

    def forget(self) -> None:
        """Believe the next reply whatever was read before."""
        self.read_at = -math.inf

    def take(self, block: bytes, error_bits: int, now: float) -> bool:
        """Take the 8 bytes from Present Position on; return whether they were believed.

        Position and speed are refused together when one is out of its range or when the position
        changed faster than a servo can turn: readings in the dead zone of a wheel-mode servo
        (300 to 360 degrees) are of this kind.
        """
        self.error_bits = error_bits
        at = ct.PRESENT_POSITION.address
        position = ct.PRESENT_POSITION.decode(block, at)
        speed = ct.PRESENT_SPEED.decode(block, at)
        if position > MAX_TICKS or speed > MAX_SIGNED_RAW:
            self.invalid_values += 1
            return False
        angle = ticks_to_rad(position)
        reach = self._max_rate * (now - self.read_at) + _SLACK_TICKS * RAD_PER_TICK
        if abs(angle - self.angle) > reach:  # false while the angle is NaN
            self.invalid_values += 1
            return False
        self.angle = angle
        if self._wheel_speed_unit is None:
            self.rate = speed_to_rad_s(speed)
        else:
            self.rate = decode_signed(speed) * self._wheel_speed_unit
        self.load = load_to_fraction(ct.PRESENT_LOAD.decode(block, at))
        self.voltage = raw_to_volt(ct.PRESENT_VOLTAGE.decode(block, at))
        self.temperature = float(ct.PRESENT_TEMPERATURE.decode(block, at))
        self.read_at = now
        return True


def wheel_speed_unit(no_load_speed: float) -> float:
    """Return rad/s for each unit of speed in wheel mode, where units are output (e-manual)."""
    return no_load_speed / MAX_RAW
