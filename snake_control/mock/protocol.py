"""Framing of Protocol 1.0: instruction packets out of a stream of bytes, status packets into bytes.

    instruction: FF FF ID LEN INSTRUCTION P1 .. PN CHECKSUM      LEN = N + 2
    status:      FF FF ID LEN ERROR       P1 .. PN CHECKSUM

Source: e-manual, "Protocol 1.0"; AX-12 User's Manual, page 10 f.
"""

from __future__ import annotations

import dataclasses
import enum

BROADCAST_ID = 0xFE
_HEADER = b"\xff\xff"
# Header, id, length; the rest is LEN bytes.
_PREFIX = 4


class Instruction(enum.IntEnum):
    """Instructions that an AX-12 knows."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04
    ACTION = 0x05
    FACTORY_RESET = 0x06
    SYNC_WRITE = 0x83


class ErrorBit(enum.IntFlag):
    """Bits of the error byte of a status packet."""

    NONE = 0
    INPUT_VOLTAGE = 1
    ANGLE_LIMIT = 2
    OVERHEATING = 4
    RANGE = 8
    CHECKSUM = 16
    OVERLOAD = 32
    INSTRUCTION = 64


CONDITIONS = int(ErrorBit.INPUT_VOLTAGE | ErrorBit.OVERHEATING | ErrorBit.OVERLOAD)
"""Error bits of what lasts; the others are about the instruction that a status answers."""


@dataclasses.dataclass(frozen=True)
class InstructionPacket:
    """One instruction as it came over the wire.

    Attributes:
        id: whom it is for, 0 to 253, or ``BROADCAST_ID``.
        instruction: the instruction byte; not necessarily a known one.
        parameters: the bytes behind it.
        checksum_ok: whether the checksum fitted.
    """

    id: int
    instruction: int
    parameters: bytes = b""
    checksum_ok: bool = True


@dataclasses.dataclass(frozen=True)
class StatusPacket:
    """One reply of a servo."""

    id: int
    error: ErrorBit = ErrorBit.NONE
    parameters: bytes = b""

    def to_bytes(self) -> bytes:
        """Return the packet with header, length and checksum."""
        body = bytes((self.id, len(self.parameters) + 2, int(self.error))) + self.parameters
        return _HEADER + body + bytes((checksum(body),))


def checksum(body: bytes) -> int:
    """Return the inverted low byte of the sum of everything between header and checksum."""
    return ~sum(body) & 0xFF


class Parser:
    """Finds instruction packets in a stream that arrives in pieces and may hold noise."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def reset(self) -> None:
        """Forget an unfinished packet."""
        self._buffer.clear()

    def feed(self, data: bytes) -> list[tuple[int, InstructionPacket]]:
        """Take bytes and return the packets that they complete.

        Args:
            data: any bytes.

        Returns:
            Pairs of the number of bytes of ``data`` up to the end of the packet, and the packet.
        """
        buffer = self._buffer
        consumed_before = -len(buffer)
        buffer += data
        start = 0
        packets = []
        while True:
            start = _find_header(buffer, start)
            if len(buffer) - start < _PREFIX:
                break
            length = buffer[start + 3]
            if length < 2:
                # No packet is that short: this was noise that looked like a header.
                start += 1
                continue
            end = start + _PREFIX + length
            if len(buffer) < end:
                break
            body = bytes(buffer[start + 2 : end - 1])
            packet = InstructionPacket(
                id=body[0],
                instruction=body[2],
                parameters=body[3:],
                checksum_ok=checksum(body) == buffer[end - 1],
            )
            packets.append((consumed_before + end, packet))
            start = end
        del buffer[:start]
        return packets


def _find_header(buffer: bytearray, start: int) -> int:
    """Return where the next packet can begin; up to there everything is noise."""
    found = buffer.find(_HEADER, start)
    if found < 0:
        return len(buffer) - 1 if len(buffer) > start and buffer[-1] == 0xFF else len(buffer)
    # An id is never FF: of a longer row of FF the last two are the header.
    while found + 2 < len(buffer) and buffer[found + 2] == 0xFF:
        found += 1
    return found
