"""Mock servos, the real SDK and the driver's bus in one thread, in simulated time.

``MemoryPort`` stands where a serial port would: the SDK writes packets to it and reads bytes from
it. Waiting for a reply moves the clock on, and with it the servos.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence

from dynamixel_sdk import PortHandler

from snake_control.mock.bus import Bus as MockBus
from snake_control.mock.servo import Servo

STEP_S = 0.005


class World:
    """Servos on a line, the load of each, and the time.

    Attributes:
        now: simulated time [s].
        loads: torque that holding each joint takes [N m].
    """

    def __init__(self, servos: Sequence[Servo], wire_time: bool = True) -> None:
        self.servos = tuple(servos)
        self.line = MockBus(servos, wire_time=wire_time)
        self.loads = [0.0] * len(servos)
        self.now = 1000.0
        self._stepped_until = self.now

    def pass_until(self, time: float) -> None:
        """Let time pass; servos move in steps of 5 ms."""
        self.now = max(self.now, time)
        while self._stepped_until + STEP_S <= self.now:
            self._stepped_until += STEP_S
            for servo, load in zip(self.servos, self.loads, strict=True):
                servo.step(STEP_S, load)

    def angles(self) -> list[float]:
        """Angles of the shafts [rad]."""
        return [servo.motion.angle_rad for servo in self.servos]


class MemoryPort(PortHandler):
    """The host's end of the line.

    Attributes:
        reply_timeout_s: beyond the time on the wire, as ``ax12.port.SerialPort`` has it.
        received: what was read since somebody emptied it.
        sent: the packet written last.
        alter: makes something else of the bytes that arrive (they are as a list of time, bytes).
    """

    def __init__(self, world: World, reply_timeout_s: float = 0.015) -> None:
        super().__init__("memory")
        self.reply_timeout_s = reply_timeout_s
        self.alter: Callable[[list[tuple[float, bytes]]], list[tuple[float, bytes]]] | None = None
        self.received = self.sent = b""
        self.is_open = True
        self._world = world
        self._coming: list[tuple[float, bytes]] = []
        self._unread = b""
        self._deadline = 0.0
        self._byte_time = 10.0 / self.baudrate

    def close(self) -> None:
        self.is_open = False

    def closePort(self) -> None:
        self.close()

    def clearPort(self) -> None:
        self._arrive()
        self._unread = b""

    def writePort(self, packet: list[int]) -> int:
        now = self._world.now
        self.sent = bytes(packet)
        replies = self._world.line.receive(bytes(packet), now, self.baudrate)
        arriving = [(reply.at, reply.data) for reply in replies]
        if self.alter is not None:
            arriving = self.alter(arriving)
        for at, data in arriving:
            heapq.heappush(self._coming, (at, data))
        return len(packet)

    def readPort(self, length: int) -> bytes:
        self._arrive()
        if not self._unread:
            at = self._coming[0][0] if self._coming else self._deadline
            self._world.pass_until(min(at, self._deadline))
            self._arrive()
        data, self._unread = self._unread[:length], self._unread[length:]
        self.received += data
        return data

    def setPacketTimeout(self, packet_length: int) -> None:
        self._deadline = (
            self._world.now + (packet_length + 64) * self._byte_time + self.reply_timeout_s
        )

    def setPacketTimeoutMillis(self, msec: float) -> None:
        self._deadline = self._world.now + msec / 1000.0

    def isPacketTimeout(self) -> bool:
        return not self._unread and self._world.now >= self._deadline

    def _arrive(self) -> None:
        while self._coming and self._coming[0][0] <= self._world.now:
            self._unread += heapq.heappop(self._coming)[1]
