"""The handshake: everything that is missing or wrong on the bus, in one message.

It only reads. In particular it writes no EEPROM: a servo that is set up otherwise than configured
is reported with what to set.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence

from snake_control.ax12 import control_table as ct
from snake_control.ax12.bus import Bus
from snake_control.ax12.joint import JOINT_MODE, WHEEL_MODE, JointSetup
from snake_control.ax12.units import MAX_TICKS, ticks_to_rad
from snake_control.errors import ServoError

_ALL_REPLIES = 2
_STATUS_BYTES = 14
_BITS_PER_BYTE = 10


@dataclasses.dataclass(frozen=True)
class ServoInfo:
    """What a servo's EEPROM says.

    Attributes:
        model: 12 (AX-12A), 18 (AX-18A) or 300 (AX-12W).
        firmware: version.
        return_delay: how long it waits before it replies [s].
        angle_limits_ticks: goals the servo accepts (CW and CCW Angle Limit).
        lower_ticks, upper_ticks: goals meant: joint range and angle limits intersected.
        max_torque_raw: cap of the torque limit.
        shutdown_bits: error bits that switch its torque off.
    """

    model: int
    firmware: int
    return_delay: float
    angle_limits_ticks: tuple[int, int]
    lower_ticks: int
    upper_ticks: int
    max_torque_raw: int
    shutdown_bits: int

    def goal_allowed(self, ticks: int) -> bool:
        """Whether the servo accepts a goal."""
        return self.angle_limits_ticks[0] <= ticks <= self.angle_limits_ticks[1]


@dataclasses.dataclass(frozen=True)
class Handshake:
    """Result of a successful handshake: one info per joint, and what is worth a warning."""

    servos: tuple[ServoInfo, ...]
    warnings: tuple[str, ...]


def handshake(
    bus: Bus, joints: Sequence[JointSetup], accepted_models: Collection[int]
) -> Handshake:
    """Ping every servo and check what its control table says; nothing is written.

    Raises:
        ServoError: lists all findings about all servos.
        BusError: the port failed.
    """
    with bus.patient():
        return _handshake(bus, joints, accepted_models)


def _handshake(
    bus: Bus, joints: Sequence[JointSetup], accepted_models: Collection[int]
) -> Handshake:
    findings: list[str] = []
    warnings: list[str] = []
    servos: list[ServoInfo] = []
    silent = 0
    for joint in joints:
        block = _read_eeprom(bus, joint, findings)
        if block is None:
            silent += 1
            continue
        found = _check(joint, block, accepted_models)
        findings.extend(f"{joint}: {text}" for text in found)
        if not found:
            servos.append(_info(joint, block))
            narrowed = _narrowed(joint, servos[-1])
            if narrowed:
                warnings.append(f"{joint}: {narrowed}")
    if bus.echoes:
        findings.append(
            "the adapter returns what is sent to the servos (echo): use one that switches the "
            "direction of the half-duplex line, or switch its local echo off"
        )
    if silent == len(joints):
        findings.append(
            "none of the servos answers as it should: check their power, the cable, and that the "
            "baud rate configured is the servos' own"
        )
    if findings:
        raise ServoError(findings)
    return Handshake(tuple(servos), tuple(warnings))


def cycle_duration(servos: Sequence[ServoInfo], baud_rate: int) -> float:
    """Return the shortest time of one bus cycle [s]: one SYNC_WRITE and a READ of each servo."""
    sync_write = 8 + 5 * len(servos)
    bytes_on_wire = sync_write + len(servos) * (8 + _STATUS_BYTES)
    return bytes_on_wire * _BITS_PER_BYTE / baud_rate + sum(s.return_delay for s in servos)


def _read_eeprom(bus: Bus, joint: JointSetup, findings: list[str]) -> bytes | None:
    servo_id = joint.servo_id
    if bus.ping(servo_id) is None:
        corrupt = bus.counters[servo_id].corrupt_replies
        findings.append(
            f"{joint}: does not answer"
            + (" legibly: do two servos share this id?" if corrupt > 1 else "")
        )
        return None
    length = ct.ALARM_SHUTDOWN.end
    reply = bus.read(servo_id, 0, length)
    if reply is not None:
        return reply.data
    if bus.counters[servo_id].corrupt_replies > 1:
        why = "its replies are corrupt (two servos with this id, an echo, or a bad cable?)"
    else:
        why = (
            f"it answers pings but not reads: set {_register(ct.STATUS_RETURN_LEVEL)} to "
            f"{_ALL_REPLIES}"
        )
    findings.append(f"{joint}: {why}")
    return None


def _check(joint: JointSetup, block: bytes, accepted_models: Collection[int]) -> list[str]:
    found = []
    model = ct.MODEL_NUMBER.decode(block, 0)
    if model not in accepted_models:
        expected = ", ".join(map(str, sorted(accepted_models)))
        found.append(f"is model {model}, accepted are {expected}")
    level = ct.STATUS_RETURN_LEVEL.decode(block, 0)
    if level != _ALL_REPLIES:
        found.append(
            f"does not acknowledge writes: {_register(ct.STATUS_RETURN_LEVEL)} is {level}, set it "
            f"to {_ALL_REPLIES}"
        )
    if ct.MAX_TORQUE.decode(block, 0) == 0:
        found.append(f"{_register(ct.MAX_TORQUE)} is 0, so it cannot hold anything: set it to 1023")
    cw, ccw = _angle_limits(block)
    actual = WHEEL_MODE if cw == ccw == 0 else JOINT_MODE
    if actual != joint.mode:
        wanted = "both to 0" if joint.mode == WHEEL_MODE else f"to 0 and {MAX_TICKS}"
        found.append(
            f"is in {actual} mode but configured as {joint.mode}: set "
            f"{_register(ct.CW_ANGLE_LIMIT)} and {_register(ct.CCW_ANGLE_LIMIT)} {wanted} with "
            "torque off, or change servos.velocity_modes"
        )
    elif joint.mode == JOINT_MODE:
        lower, upper = _goal_range(joint, block)
        if lower >= upper:
            found.append(
                f"its angle limits {cw}..{ccw} and the joint's range {joint.range_ticks[0]}.."
                f"{joint.range_ticks[1]} have nothing in common"
            )
    return found


def _info(joint: JointSetup, block: bytes) -> ServoInfo:
    lower, upper = _goal_range(joint, block)
    return ServoInfo(
        model=ct.MODEL_NUMBER.decode(block, 0),
        firmware=ct.FIRMWARE_VERSION.decode(block, 0),
        return_delay=2e-6 * ct.RETURN_DELAY_TIME.decode(block, 0),
        angle_limits_ticks=_angle_limits(block),
        lower_ticks=lower,
        upper_ticks=upper,
        max_torque_raw=ct.MAX_TORQUE.decode(block, 0),
        shutdown_bits=ct.ALARM_SHUTDOWN.decode(block, 0),
    )


def _angle_limits(block: bytes) -> tuple[int, int]:
    return ct.CW_ANGLE_LIMIT.decode(block, 0), ct.CCW_ANGLE_LIMIT.decode(block, 0)


def _goal_range(joint: JointSetup, block: bytes) -> tuple[int, int]:
    cw, ccw = _angle_limits(block)
    if joint.mode == WHEEL_MODE:
        return 0, MAX_TICKS
    return max(cw, joint.range_ticks[0]), min(ccw, joint.range_ticks[1])


def _narrowed(joint: JointSetup, servo: ServoInfo) -> str:
    if joint.mode == WHEEL_MODE or (servo.lower_ticks, servo.upper_ticks) == joint.range_ticks:
        return ""
    ends = sorted(joint.to_joint(ticks_to_rad(t)) for t in (servo.lower_ticks, servo.upper_ticks))
    return (
        f"the servo's angle limits narrow its range from {joint.lower:.3f}..{joint.upper:.3f} to "
        f"{ends[0]:.3f}..{ends[1]:.3f} rad"
    )


def _register(register: ct.Register) -> str:
    return f"{register.name} (address {register.address})"
