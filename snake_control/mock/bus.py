"""Several servos on one wire: who answers, in what order, and when the bytes have passed."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Protocol

from snake_control.mock.firmware import execute
from snake_control.mock.protocol import BROADCAST_ID, InstructionPacket, Parser
from snake_control.mock.servo import Servo

BITS_PER_BYTE = 10
"""On the wire: a start bit, eight data bits, a stop bit."""

RATE_TOLERANCE = 0.03
"""Relative difference of two baud rates at which a byte is still read; the AX-12's own 117647 for
115200 is 2.1 % off."""

GAP_S = 0.02
"""A packet is given up when its next byte has not come for this long [s]."""


@dataclasses.dataclass(frozen=True, slots=True)
class Reply:
    """Bytes of a reply, and when the last of them has passed the wire.

    Attributes:
        at: time by the clock of ``Bus.receive`` [s].
        data: the bytes.
    """

    at: float
    data: bytes


class Filter(Protocol):
    """What a disturbed line does to packets."""

    @property
    def frozen(self) -> bool:
        """Whether nothing passes."""

    def passes(self, servo: Servo) -> bool:
        """Whether an instruction reaches a servo."""

    def spoil(self, servo: Servo, reply: bytes) -> tuple[bytes, float]:
        """Return what becomes of a servo's reply, and by how much it is late [s]."""

    def echo(self, sent: bytes, at: float) -> Reply | None:
        """Return what comes back of the host's own bytes, sent until ``at``."""


class Bus:
    """A half-duplex wire with servos on it; reads no clock.

    Attributes:
        servos: all servos, also such that share an id.
        filter: what disturbs the line, if something does.
    """

    def __init__(self, servos: Sequence[Servo], *, wire_time: bool = True) -> None:
        """Connect servos.

        Args:
            servos: any number, in any state.
            wire_time: whether bytes take their time; if not, only return delays count.
        """
        self.servos = tuple(servos)
        self.filter: Filter | None = None
        self._wire_time = wire_time
        self._parser = Parser()
        self._baud_rate = 0.0
        self._heard_at = float("-inf")
        # The host's bytes and the servos' bytes each queue up behind their own kind.
        self._sent_until = float("-inf")
        self._replied_until = float("-inf")

    def receive(self, data: bytes, now: float, baud_rate: float) -> list[Reply]:
        """Take bytes that the host wrote and return the replies to come, in order.

        Instructions act at once; their replies follow after the instruction's time on the wire,
        the servo's return delay and the reply's own time on the wire.

        Args:
            data: any bytes.
            now: when the host wrote them [s].
            baud_rate: rate of the host's port [bit/s]; servos set to another one hear nothing.
        """
        if baud_rate != self._baud_rate or now - self._heard_at > GAP_S:
            self._parser.reset()
        self._baud_rate, self._heard_at = baud_rate, now
        if baud_rate <= 0 or (self.filter is not None and self.filter.frozen):
            return []
        byte_time = BITS_PER_BYTE / baud_rate if self._wire_time else 0.0
        start = max(now, self._sent_until)
        self._sent_until = start + len(data) * byte_time
        replies = []
        echo = None if self.filter is None else self.filter.echo(data, self._sent_until)
        if echo is not None:
            replies.append(echo)
        for end, packet in self._parser.feed(data):
            reply = self._answer(packet, start + end * byte_time, byte_time)
            if reply is not None:
                replies.append(reply)
        return replies

    def _answer(self, packet: InstructionPacket, at: float, byte_time: float) -> Reply | None:
        answers = []
        late = 0.0
        disturbed = self.filter
        for servo in self.servos:
            if packet.id not in (servo.id, BROADCAST_ID) or not _hears(servo, self._baud_rate):
                continue
            if disturbed is not None and not disturbed.passes(servo):
                continue
            delay = servo.return_delay_s
            status = execute(servo, packet)
            if status is None:
                continue
            data = status.to_bytes()
            if disturbed is not None:
                data, delayed = disturbed.spoil(servo, data)
                late = max(late, delayed)
            if data:
                answers.append((delay, data))
        if not answers:
            return None
        data = answers[0][1]
        for _, other in answers[1:]:
            data = _collide(data, other)
        start = max(at + min(delay for delay, _ in answers), self._replied_until)
        self._replied_until = start + len(data) * byte_time
        # A late reply does not keep the line: others may speak meanwhile.
        return Reply(self._replied_until + late, data)


def _hears(servo: Servo, baud_rate: float) -> bool:
    return servo.powered and abs(servo.baud_rate - baud_rate) <= RATE_TOLERANCE * servo.baud_rate


def _collide(first: bytes, second: bytes) -> bytes:
    """Return what is read when two servos drive the wire: the low level wins.

    Two servos never start within the same bit, so that the second one is a bit late.
    """
    length = max(len(first), len(second))
    idle = b"\xff"
    pairs = zip(first.ljust(length, idle), second.ljust(length, idle), strict=True)
    return bytes(a & (b << 1 | 1) & 0xFF for a, b in pairs)
