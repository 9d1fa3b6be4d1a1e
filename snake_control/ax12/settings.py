"""What a servo's EEPROM has to be for a joint, and the way from what it is.

EEPROM can be written only while torque is off (e-manual), and not while Lock is 1 (manual p. 18).
"""

from __future__ import annotations

import dataclasses

from snake_control.ax12 import control_table as ct
from snake_control.ax12 import eeprom
from snake_control.ax12.bus import Bus
from snake_control.ax12.joint import WHEEL_MODE, JointSetup
from snake_control.ax12.units import ERROR_OVERHEATING, ERROR_OVERLOAD, MAX_TICKS
from snake_control.errors import ServoError

_ALL_REPLIES = 2


@dataclasses.dataclass(frozen=True)
class Change:
    """One register that is to be written."""

    register: ct.Register
    now: int
    wanted: int
    why: str


def changes(
    joint: JointSetup, block: bytes, *, return_delay: int | None = None, range_too: bool = False
) -> list[Change]:
    """Return what has to be written, in the order in which it can be.

    Args:
        joint: what the servo is to drive.
        block: the first ``eeprom.LENGTH`` bytes of its control table.
        return_delay: wanted Return Delay Time [2 us]; ``None`` to leave it.
        range_too: narrow the servo's angle limits to the joint's range, so that it keeps to it
            whatever the host does.
    """
    found: list[Change] = []

    def want(register: ct.Register, value: int, why: str) -> None:
        now = register.decode(block, 0)
        if now != value:
            found.append(Change(register, now, value, why))

    want(ct.STATUS_RETURN_LEVEL, _ALL_REPLIES, "the driver checks what it writes")
    alarms = ct.ALARM_SHUTDOWN.decode(block, 0)
    want(
        ct.ALARM_SHUTDOWN,
        alarms | ERROR_OVERHEATING | ERROR_OVERLOAD,
        "shuts down by itself at overload and overheating",
    )
    if ct.MAX_TORQUE.decode(block, 0) < joint.torque_limit_raw:
        want(ct.MAX_TORQUE, joint.torque_limit_raw, "servos.torque_limit asks for more")
    cw, ccw = _limits(joint, block, range_too)
    why = "servos.velocity_modes says wheel" if joint.mode == WHEEL_MODE else "range of the joint"
    want(ct.CW_ANGLE_LIMIT, cw, why)
    want(ct.CCW_ANGLE_LIMIT, ccw, why)
    if return_delay is not None:
        want(ct.RETURN_DELAY_TIME, return_delay, "as asked for")
    return found


def _limits(joint: JointSetup, block: bytes, range_too: bool) -> tuple[int, int]:
    if joint.mode == WHEEL_MODE:
        return 0, 0
    lower = min(max(joint.range_ticks[0], 0), MAX_TICKS)
    upper = min(max(joint.range_ticks[1], 0), MAX_TICKS)
    if range_too:
        return lower, upper
    cw, ccw = ct.CW_ANGLE_LIMIT.decode(block, 0), ct.CCW_ANGLE_LIMIT.decode(block, 0)
    if cw == ccw == 0:
        return 0, MAX_TICKS
    # Wider than the joint's range does no harm, narrower would stop it short.
    return min(cw, lower), max(ccw, upper)


def rate_change(block: bytes, rate: int) -> list[Change]:
    """Return what has to be written for a servo to listen at a rate [bit/s], last of all."""
    now, wanted = ct.BAUD_RATE.decode(block, 0), round(2_000_000 / rate) - 1
    return [Change(ct.BAUD_RATE, now, wanted, f"{rate} bit/s")] if now != wanted else []


def write_rate(bus: Bus, servo_id: int, change: Change) -> None:
    """Have a servo listen at another rate, from now on; whether it does, only that rate tells.

    Raises:
        ServoError: it has torque, is locked, or does not answer.
        BusError: the port failed.
    """
    write(bus, servo_id, [])
    # The acknowledgement comes at the old rate or at the new one.
    bus.write(servo_id, change.register.address, change.register.encode(change.wanted))


def write(bus: Bus, servo_id: int, wanted: list[Change]) -> None:
    """Write and read back; registers that hold the value already are left alone.

    Raises:
        ServoError: torque is on, the servo is locked, or it does not take a value.
        BusError: the port failed.
    """
    with bus.patient():
        ram = bus.read(servo_id, ct.TORQUE_ENABLE.address, ct.TABLE_END - ct.TORQUE_ENABLE.address)
        if ram is None:
            raise ServoError([f"servo id {servo_id} does not answer"])
        start = ct.TORQUE_ENABLE.address
        if ct.TORQUE_ENABLE.decode(ram.data, start):
            raise ServoError([f"servo id {servo_id} has torque; its EEPROM takes nothing then"])
        if ct.LOCK.decode(ram.data, start):
            raise ServoError(
                [f"servo id {servo_id} is locked: switch its power off and on, then try again"]
            )
        for change in wanted:
            data = change.register.encode(change.wanted)
            bus.write_verified(servo_id, change.register.address, data)


def read_block(bus: Bus, servo_id: int) -> bytes:
    """Return the first ``eeprom.LENGTH`` bytes of a servo's control table.

    Raises:
        ServoError: it does not answer.
    """
    with bus.patient():
        reply = bus.read(servo_id, 0, eeprom.LENGTH)
    if reply is None:
        raise ServoError([f"servo id {servo_id} does not answer"])
    return reply.data
