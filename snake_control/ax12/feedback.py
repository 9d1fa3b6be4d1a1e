"""What one servo reports, checked before anybody believes it."""

from __future__ import annotations

import math

from snake_control.ax12 import control_table as ct
from snake_control.ax12.gate import PositionGate
from snake_control.ax12.units import (
    JOINT_NO_LOAD_RAD_S,
    MAX_RAW,
    MAX_SIGNED_RAW,
    MAX_TICKS,
    RAD_S_PER_SPEED_UNIT,
    decode_signed,
    load_to_fraction,
    raw_to_volt,
    ticks_to_rad,
)

_MAX_SHARE = 1.15


class Feedback:
    """Last good state of one servo, in the servo's frame, with the time it was read.

    Attributes:
        angle: servo angle [rad]; NaN before the first good reply.
        rate: its velocity [rad/s] as the servo reports it, positive counter-clockwise; no larger
            than the servo can turn.
        load: fraction of the maximum output, inferred by the servo from its own output.
        voltage: [V].
        temperature: [degC].
        error_bits: of the last reply, good or not.
        read_at: time of the last good reply [s]; minus infinity before the first.
        slow_read_at: the same for voltage and temperature.
        invalid_values: how many replies were not believed.
    """

    def __init__(
        self,
        no_load_speed: float = JOINT_NO_LOAD_RAD_S[12],
        wheel: bool = False,
        period: float = 0.02,
    ) -> None:
        """Start without any reply.

        Args:
            no_load_speed: of the servo [rad/s]; a faster change is a misreading.
            wheel: whether it is in wheel mode, where units of Present Speed are shares of the
                speed without load (e-manual).
            period: nominal time between two replies [s].
        """
        self._speed_unit = no_load_speed / MAX_RAW if wheel else RAD_S_PER_SPEED_UNIT
        self._max_rate = _MAX_SHARE * no_load_speed
        self.angle = math.nan
        self.rate = math.nan
        self.load = math.nan
        self.voltage = math.nan
        self.temperature = math.nan
        self.error_bits = 0
        self.read_at = self.slow_read_at = -math.inf
        self.invalid_values = 0
        self._gate = PositionGate(self._max_rate, wheel, period)

    def start(self, angle: float | None, now: float) -> None:
        """Judge the next replies by an angle that is known [rad], or by nothing if ``None``.

        What was read before is old from now on.
        """
        self.read_at = -math.inf
        self._gate.open()
        if angle is not None:
            self._gate.start(angle, now)

    def take(self, block: bytes, error_bits: int, now: float) -> bool:
        """Take 6 or 8 bytes from Present Position on; return whether they were believed.

        Position and speed are refused together when one is out of its range, when the speed is
        more than the servo can turn, or when the position contradicts the earlier ones (see
        ``PositionGate``): readings in the dead zone of the sensor (300 to 360 degrees) are of this
        kind. Voltage and temperature, of 8 bytes the last two, do not depend on that.
        """
        self.error_bits = error_bits
        at = ct.PRESENT_POSITION.address
        if at + len(block) >= ct.PRESENT_TEMPERATURE.end:
            self.voltage = raw_to_volt(ct.PRESENT_VOLTAGE.decode(block, at))
            self.temperature = float(ct.PRESENT_TEMPERATURE.decode(block, at))
            self.slow_read_at = now
        position = ct.PRESENT_POSITION.decode(block, at)
        speed = ct.PRESENT_SPEED.decode(block, at)
        rate = decode_signed(speed) * self._speed_unit
        if (
            position > MAX_TICKS
            or speed > MAX_SIGNED_RAW
            or abs(rate) > self._max_rate
            or not self._gate.takes(ticks_to_rad(position), now)
        ):
            self.invalid_values += 1
            return False
        self.angle = ticks_to_rad(position)
        self.rate = rate
        self.load = load_to_fraction(ct.PRESENT_LOAD.decode(block, at))
        self.read_at = now
        return True
