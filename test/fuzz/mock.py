"""Any bytes against the mock servos, in memory."""

from __future__ import annotations

import random

from fuzz.generate import anything, frames
from snake_control.mock.bus import Bus
from snake_control.mock.control_table import BY_NAME, TABLE
from snake_control.mock.servo import Servo

RESET_EVERY = 400
MBAUD = 1_000_000
_FIXED = [BY_NAME[name] for name in ("model_number", "firmware_version", "down_calibration")]


class MockFuzz:
    """Sends packets to mock servos and checks what holds after each of them.

    Attributes:
        packets, replies, refused: how many were sent, answered, and answered with an error.
    """

    def __init__(self, seed: int) -> None:
        self._rng = random.Random(seed)
        self.packets = self.replies = self.refused = 0
        self._fresh()

    def _fresh(self) -> None:
        rng = self._rng
        wheel = {"cw_angle_limit": 0, "ccw_angle_limit": 0}
        self._servos = [
            Servo(1, angle_rad=rng.uniform(-2, 2)),
            Servo(2, eeprom=wheel, angle_rad=rng.uniform(-3, 3)),
            Servo(3, eeprom={"status_return_level": rng.randrange(3)}),
        ]
        self._bus = Bus(self._servos)
        self._now = 0.0

    def step(self) -> None:
        """Send something, perhaps in pieces, and check everything.

        Raises:
            AssertionError: something does not hold; what the servos raise passes, too.
        """
        rng = self._rng
        if self.packets % RESET_EVERY == 0:
            self._fresh()
        self.packets += 1
        data = anything(rng)
        good = bool(frames(data))
        before = self._settings()
        # A pause in front: no rest of the packet before makes a good one of this.
        self._now += 0.03
        replies = []
        cut = rng.randrange(len(data) + 1) if rng.random() < 0.2 else len(data)
        for piece in filter(None, (data[:cut], data[cut:])):
            replies += self._bus.receive(piece, self._now, MBAUD)
            self._now += 0.001
        if not good:
            assert self._settings() == before, f"executed without a checksum: {data.hex(' ')}"
        ids = [servo.id for servo in self._servos]
        for reply in replies:
            self.replies += 1
            assert reply.at >= self._now - 0.002
            if len(set(ids)) == len(ids):
                found = frames(reply.data)
                whole = len(found) >= 1 and len(reply.data) == 6 + len(found[0][2])
                assert whole, f"no packet: {reply.data.hex(' ')} to {data.hex(' ')}"
                self.refused += found[0][1] != 0
        for servo in self._servos:
            servo.step(0.005, rng.choice((0.0, 0.3)))
            self._check(servo)

    def _settings(self) -> list[bytes]:
        """All registers but those of measured values and Torque Limit, of all servos.

        Torque Limit becomes 0 where Alarm Shutdown asks for that at a bad checksum.
        """
        return [s.registers.read(0, 34) + s.registers.read(47, 3) for s in self._servos]

    def _check(self, servo: Servo) -> None:
        registers = servo.registers
        for register in TABLE:
            value = registers[register.name]
            # Torque Limit is 0 after an alarm, and a lock once set is 1.
            low = 0 if register.name == "lock" else register.low
            assert low <= value <= register.high, f"{register.name} = {value}"
        if not servo.wheel_mode:
            assert registers["moving_speed"] <= 2047
        for register in _FIXED:
            assert registers[register.name] == register.default
