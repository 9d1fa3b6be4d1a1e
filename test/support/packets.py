"""Protocol 1.0 packets for tests, built by hand."""

from __future__ import annotations

PING, READ, WRITE, REG_WRITE, ACTION, FACTORY_RESET, SYNC_WRITE = 1, 2, 3, 4, 5, 6, 0x83
BROADCAST = 0xFE


def instruction(servo_id: int, code: int, *parameters: int) -> bytes:
    body = bytes((servo_id, len(parameters) + 2, code, *parameters))
    return b"\xff\xff" + body + bytes((~sum(body) & 0xFF,))


def status(servo_id: int, error: int = 0, *parameters: int) -> bytes:
    return instruction(servo_id, error, *parameters)


def word(value: int) -> tuple[int, int]:
    return value & 0xFF, value >> 8
