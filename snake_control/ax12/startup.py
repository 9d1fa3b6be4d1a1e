"""The handshake: everything that is missing or wrong on the bus, in one message.

It only reads. In particular it writes no EEPROM: a servo that is set up otherwise than configured
is reported with what to set.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence

from snake_control.ax12 import control_table as ct
from snake_control.ax12 import eeprom
from snake_control.ax12.bus import Bus
from snake_control.ax12.eeprom import Finding, ServoInfo
from snake_control.ax12.joint import JointSetup
from snake_control.errors import ServoError

_STATUS_BYTES = 14
_BITS_PER_BYTE = 10
_RETURN_DELAY_UNIT_S = 2e-6
_LONG_DELAYS_S = 1e-3


@dataclasses.dataclass(frozen=True)
class Inspection:
    """What was found on the bus.

    Attributes:
        blocks: the first ``eeprom.LENGTH`` bytes of each joint's servo, ``None`` of one that gave
            no answer.
        findings: about servos in joint order, then about the bus.
    """

    blocks: tuple[bytes | None, ...]
    findings: tuple[Finding, ...]


@dataclasses.dataclass(frozen=True)
class Handshake:
    """Result of a successful handshake: one info per joint, and what is worth a warning.

    Advice is left to those who ask for it with ``inspect``.
    """

    servos: tuple[ServoInfo, ...]
    warnings: tuple[str, ...]


def handshake(
    bus: Bus, joints: Sequence[JointSetup], accepted_models: Collection[int]
) -> Handshake:
    """Ping every servo and check what its control table says; nothing is written.

    Raises:
        ServoError: lists all findings about all servos that are errors.
        BusError: the port failed.
    """
    found = inspect(bus, joints, accepted_models)
    errors = [str(finding) for finding in found.findings if finding.error]
    if errors:
        raise ServoError(errors)
    servos = tuple(
        eeprom.servo_info(joint, block)
        for joint, block in zip(joints, found.blocks, strict=True)
        if block is not None
    )
    warnings = tuple(str(finding) for finding in found.findings if not finding.advice)
    return Handshake(servos, warnings)


def inspect(bus: Bus, joints: Sequence[JointSetup], accepted_models: Collection[int]) -> Inspection:
    """Ask every servo and check what it says, to the end whatever is found; nothing is written.

    Raises:
        BusError: the port failed.
    """
    findings: list[Finding] = []
    blocks: list[bytes | None] = []
    with bus.patient():
        for joint in joints:
            block = _read_eeprom(bus, joint, findings)
            blocks.append(block)
            if block is not None:
                findings += eeprom.check(joint, block, accepted_models)
    if bus.echoes:
        findings.append(
            Finding(
                "the adapter returns what is sent to the servos (echo): use one that switches the "
                "direction of the half-duplex line, or switch its local echo off",
                True,
            )
        )
    if not any(blocks):
        findings.append(
            Finding(
                "none of the servos answers as it should: check their power, the cable, and that "
                "the baud rate configured is the servos' own",
                True,
            )
        )
    findings += _on_return_delays(blocks)
    return Inspection(tuple(blocks), tuple(findings))


def _on_return_delays(blocks: Sequence[bytes | None]) -> list[Finding]:
    delays = [
        _RETURN_DELAY_UNIT_S * ct.RETURN_DELAY_TIME.decode(block, 0)
        for block in blocks
        if block is not None
    ]
    if sum(delays) <= _LONG_DELAYS_S:
        return []
    text = (
        f"the servos wait {1e3 * sum(delays):.1f} ms in each cycle before they reply: set "
        f"{eeprom.register_name(ct.RETURN_DELAY_TIME)} to 0, if the adapter is quick enough"
    )
    return [Finding(text, False, advice=True)]


def cycle_duration(servos: Sequence[ServoInfo], baud_rate: int) -> float:
    """Return the shortest time of one bus cycle [s]: one SYNC_WRITE and a READ of each servo."""
    sync_write = 8 + 5 * len(servos)
    bytes_on_wire = sync_write + len(servos) * (8 + _STATUS_BYTES)
    return bytes_on_wire * _BITS_PER_BYTE / baud_rate + sum(s.return_delay for s in servos)


def _read_eeprom(bus: Bus, joint: JointSetup, findings: list[Finding]) -> bytes | None:
    servo_id = joint.servo_id
    if bus.ping(servo_id) is None:
        garbled = bus.counters[servo_id].corrupt_replies > 1
        hint = " legibly: do two servos share this id?" if garbled else ""
        findings.append(Finding("does not answer" + hint, True, joint))
        return None
    reply = bus.read(servo_id, 0, eeprom.LENGTH)
    if reply is not None:
        return reply.data
    if bus.counters[servo_id].corrupt_replies > 1:
        why = "its replies are corrupt (two servos with this id, an echo, or a bad cable?)"
    else:
        why = (
            "it answers pings but not reads: set "
            f"{eeprom.register_name(ct.STATUS_RETURN_LEVEL)} to 2"
        )
    findings.append(Finding(why, True, joint))
    return None
