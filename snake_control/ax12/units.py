"""Register values <-> SI units (e-manual AX-12A; user's manual 2006-06-14, p. 16-18).

Convention for positions: 512 is the centre, angle 0; one tick is 300/1023 degree;
counter-clockwise, seen from the horn, is positive. (Some tools take 511.5 as the centre: half a
tick of difference.)
"""

from __future__ import annotations

import math

CENTRE_TICKS = 512
MAX_TICKS = 1023
RAD_PER_TICK = math.radians(300.0 / 1023.0)

RAD_S_PER_SPEED_UNIT = 0.111 * 2.0 * math.pi / 60.0
"""Moving Speed (joint mode) and Present Speed: 0.111 rpm for each unit, 0.0116 rad/s."""

MAX_RAW = 1023
SIGN_BIT = 0x400
"""Bit 10 of speed and load: set for clockwise."""

MAX_SIGNED_RAW = 2047

_RPM = 2.0 * math.pi / 60.0
WHEEL_NO_LOAD_RAD_S = {12: 59.0 * _RPM, 18: 97.0 * _RPM, 300: 470.0 * _RPM}
"""Speed without load at full output by model number; wheel mode commands output, not speed."""

JOINT_NO_LOAD_RAD_S = WHEEL_NO_LOAD_RAD_S | {300: 54.0 * _RPM}
"""The same in joint mode."""

ERROR_NAMES: tuple[str, ...] = (
    "input voltage",
    "angle limit",
    "overheating",
    "range",
    "checksum",
    "overload",
    "instruction",
)
"""Names of the status error bits 0 to 6."""

ERROR_VOLTAGE, ERROR_ANGLE_LIMIT, ERROR_OVERHEATING, ERROR_RANGE = 1, 2, 4, 8
ERROR_CHECKSUM, ERROR_OVERLOAD, ERROR_INSTRUCTION = 16, 32, 64
REFUSED_BITS = ERROR_ANGLE_LIMIT | ERROR_RANGE | ERROR_CHECKSUM | ERROR_INSTRUCTION
"""Error bits that mean: this instruction was not carried out. The others report a condition."""


def ticks_to_rad(ticks: float) -> float:
    """Return the servo angle of a position value [rad], 0 at the centre."""
    return (ticks - CENTRE_TICKS) * RAD_PER_TICK


def rad_to_ticks(angle: float) -> float:
    """Return the position value of a servo angle, not rounded and not limited to 0..1023."""
    return CENTRE_TICKS + angle / RAD_PER_TICK


def decode_signed(raw: int) -> int:
    """Return a speed or load value with its sign: bit 10 set means clockwise, negative."""
    magnitude = raw & (SIGN_BIT - 1)
    return -magnitude if raw & SIGN_BIT else magnitude


def encode_signed(value: int) -> int:
    """Return the register value of a signed speed, the inverse of ``decode_signed``.

    Raises:
        ValueError: magnitude above 1023.
    """
    if abs(value) > MAX_RAW:
        raise ValueError(f"magnitude above {MAX_RAW}: {value}")
    return SIGN_BIT - value if value < 0 else value


def load_to_fraction(raw: int) -> float:
    """Return Present Load as fraction of the maximum, positive counter-clockwise."""
    return decode_signed(raw) / MAX_RAW


def raw_to_volt(raw: int) -> float:
    """Return Present Voltage in volt."""
    return raw / 10.0


def compliance_step(slope: int) -> int:
    """Return the ticks over which the output rises: the servo knows seven steps (manual p. 17)."""
    step = 2
    while step < 128 and slope >= 2 * step:
        step *= 2
    return step


def error_names(bits: int) -> tuple[str, ...]:
    """Return the names of all error bits that are set."""
    return tuple(name for bit, name in enumerate(ERROR_NAMES) if bits & (1 << bit))
