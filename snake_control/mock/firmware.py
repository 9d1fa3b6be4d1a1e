"""What instructions do to a servo: access, ranges, lock, errors, and who gets a reply.

Source: AX-12 User's Manual (2006), pages 10 ff. and 19 ff.; e-manual, "Protocol 1.0". Where they
differ, ``ServoParameters`` chooses. Where they are silent this firmware refuses, so that a program
that gets along with it relies on nothing that a servo might not do:

* a wrong number of parameters is an instruction error; a write to what is read-only, locked, or
  beyond the table is a range error; so is a read of nothing or beyond the table, without data;
* a write, also of several registers, is done wholly or not at all;
* an EEPROM write to a servo that is driven is a range error;
* Moving Speed beyond 1023 in joint mode is a range error; one left over from wheel mode counts
  without its direction;
* angle limits are for goals that are written while they hold: a goal from before stays, and so does
  the goal that power-on takes from the shaft;
* a registered write is checked when it comes and once more when it is carried out; a later one
  takes its place.
"""

from __future__ import annotations

from snake_control.mock.control_table import BY_NAME, LOCK_WRITABLE, Register, registers_in
from snake_control.mock.protocol import (
    BROADCAST_ID,
    ErrorBit,
    Instruction,
    InstructionPacket,
    StatusPacket,
)
from snake_control.mock.servo import Servo
from snake_control.mock.volatile import RegisteredWrite

_MEASURED = range(BY_NAME["present_position"].address, BY_NAME["moving"].end)


def execute(servo: Servo, packet: InstructionPacket) -> StatusPacket | None:
    """Carry out an instruction and return the reply, ``None`` if the servo stays silent.

    Id and Status Return Level of before count: a write that changes them is still answered under
    the old id and by the old level (manual, examples 4 and 14).
    """
    if packet.id not in (servo.id, BROADCAST_ID) or not servo.powered:
        return None
    own_id, level = servo.id, servo.registers["status_return_level"]
    error, data = _carry_out(servo, packet)
    if error:
        servo.alarm(error)
    if packet.id == BROADCAST_ID and not _answers_all(servo, packet):
        return None
    if level < _reply_level(packet.instruction):
        return None
    # Flags are slow to join, and mostly there are none.
    if servo.error:
        error |= servo.error
    return StatusPacket(own_id, error, data)


def _answers_all(servo: Servo, packet: InstructionPacket) -> bool:
    return servo.parameters.answers_broadcast_ping and packet.instruction == Instruction.PING


def _reply_level(instruction: int) -> int:
    """Return the lowest Status Return Level at which an instruction is answered."""
    if instruction == Instruction.PING:
        return 0
    return 1 if instruction == Instruction.READ else 2


def _carry_out(servo: Servo, packet: InstructionPacket) -> tuple[ErrorBit, bytes]:
    nothing = b""
    if not packet.checksum_ok:
        return ErrorBit.CHECKSUM, nothing
    p = packet.parameters
    match packet.instruction:
        case Instruction.PING if not p:
            return ErrorBit.NONE, nothing
        case Instruction.READ if len(p) == 2:
            return _read(servo, p[0], p[1])
        case Instruction.WRITE if len(p) >= 2:
            return _write(servo, p[0], p[1:]), nothing
        case Instruction.REG_WRITE if len(p) >= 2:
            return _register_write(servo, p[0], p[1:]), nothing
        case Instruction.ACTION if not p:
            return _action(servo), nothing
        case Instruction.SYNC_WRITE if packet.id == BROADCAST_ID:
            return _sync_write(servo, p), nothing
        case Instruction.FACTORY_RESET if not p and servo.parameters.has_factory_reset:
            return _factory_reset(servo), nothing
    # Also BULK_READ, which no AX knows.
    return ErrorBit.INSTRUCTION, nothing


def _read(servo: Servo, address: int, size: int) -> tuple[ErrorBit, bytes]:
    try:
        registers_in(address, size)
    except IndexError:
        return ErrorBit.RANGE, b""
    if address < _MEASURED.stop and address + size > _MEASURED.start:
        servo.measure()
    return ErrorBit.NONE, servo.registers.read(address, size)


def _write(servo: Servo, address: int, data: bytes) -> ErrorBit:
    error = _check_write(servo, address, data)
    if not error:
        servo.store_bytes(address, data)
    return error


def _register_write(servo: Servo, address: int, data: bytes) -> ErrorBit:
    error = _check_write(servo, address, data)
    if not error:
        servo.waiting = RegisteredWrite(address, data)
    return error


def _action(servo: Servo) -> ErrorBit:
    write = servo.waiting
    if write is None:
        return ErrorBit.INSTRUCTION
    servo.waiting = None
    # Torque, lock or angle limits may have changed since it was checked.
    return _write(servo, write.address, write.data)


def _factory_reset(servo: Servo) -> ErrorBit:
    """Reset, where a write of the EEPROM would be possible; the manuals give no rule."""
    driven = servo.driven and servo.parameters.eeprom_needs_torque_off
    if driven or servo.registers["lock"]:
        return ErrorBit.RANGE
    servo.factory_reset()
    return ErrorBit.NONE


def _sync_write(servo: Servo, parameters: bytes) -> ErrorBit:
    if len(parameters) < 2:
        return ErrorBit.INSTRUCTION
    address, size = parameters[0], parameters[1]
    entries = parameters[2:]
    if len(entries) % (size + 1):
        return ErrorBit.INSTRUCTION
    error = ErrorBit.NONE
    own_id = servo.id
    for start in range(0, len(entries), size + 1):
        if entries[start] == own_id:
            refused = _write(servo, address, entries[start + 1 : start + 1 + size])
            if refused:
                error |= refused
    return error


def _check_write(servo: Servo, address: int, data: bytes) -> ErrorBit:
    """Return why a write is refused; it is carried out wholly or not at all."""
    try:
        touched = registers_in(address, len(data))
    except IndexError:
        return ErrorBit.RANGE
    end = address + len(data)
    if touched[0].address < address or touched[-1].end > end:
        # Items of two bytes must be written in one packet.
        return ErrorBit.RANGE
    locked = servo.registers["lock"]
    if locked and not (address in LOCK_WRITABLE and end - 1 in LOCK_WRITABLE):
        return ErrorBit.RANGE
    error = ErrorBit.NONE
    for register in touched:
        offset = register.address - address
        value = int.from_bytes(data[offset : offset + register.size], "little")
        wrong = _check_value(servo, register, value)
        if wrong:
            error |= wrong
    return error


def _check_value(servo: Servo, register: Register, value: int) -> ErrorBit:
    needs_torque_off = register.eeprom and servo.parameters.eeprom_needs_torque_off
    if not register.writable or (needs_torque_off and servo.driven):
        return ErrorBit.RANGE
    high = register.high
    if register.name == "moving_speed" and not servo.wheel_mode:
        high = 1023
    if not register.low <= value <= high:
        return ErrorBit.RANGE
    if register.name == "goal_position":
        r = servo.registers
        if not r["cw_angle_limit"] <= value <= r["ccw_angle_limit"]:
            return ErrorBit.ANGLE_LIMIT
    return ErrorBit.NONE
