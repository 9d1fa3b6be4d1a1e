"""Switching torque on without a jump: goal = where the joint is, settings, then torque.

The RAM area is lost at a power cycle: torque off, Moving Speed 0 (full speed), compliance at its
defaults. So everything that matters is written each time, and read back, before torque is on. A
free joint may move while the others get their settings: right before its torque its goal is set
once more to where it is.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

from snake_control.ax12 import control_table as ct
from snake_control.ax12.bus import Bus
from snake_control.ax12.compliance import Compliance
from snake_control.ax12.eeprom import ServoInfo
from snake_control.ax12.joint import WHEEL_MODE, JointSetup
from snake_control.ax12.units import MAX_TICKS, decode_signed, ticks_to_rad
from snake_control.ax12.velocity import SEED_SPEED_RAW
from snake_control.errors import ServoError

_RAM = ct.TORQUE_ENABLE.address
_TORQUE_AND_LED = b"\x01\x01"
"""The LED is lit while a servo is armed. After a power failure it is not, whatever a servo makes of
the goals that it gets then: all other settings may be those of the factory."""
_RAM_LENGTH = ct.TABLE_END - _RAM
_WATCHED = ct.TORQUE_LIMIT.end - _RAM

_STILL_TICKS = 6
_SETTLE_TRIES = 4
_STEADY_READINGS, _STEADY_TRIES = 4, 16
_UNSTEADY = (
    "it does not stand still, or its readings jump, as they do beyond the end of its sensor (+-150 "
    "degrees; turn it back by hand)"
)


@dataclasses.dataclass(frozen=True)
class Seed:
    """Where one joint starts to be held.

    Attributes:
        goal_ticks: goal written; 0 in wheel mode, where none is.
        angle: the same as servo angle [rad].
        measured: servo angle that was read [rad]; a held joint hangs a droop away from its goal.
        had_torque: whether it was held before.
    """

    goal_ticks: int
    angle: float
    measured: float
    had_torque: bool


class _Before(NamedTuple):
    """A servo's RAM before anything is written, and whether it holds its joint."""

    ram: bytes
    holds: bool


def arm(bus: Bus, joints: Sequence[JointSetup], servos: Sequence[ServoInfo]) -> tuple[Seed, ...]:
    """Seed every goal from the present position, write the RAM settings, switch torque on.

    Torque goes on only when all servos took their settings; if one refuses torque, it is taken
    again from those that it was given to here. A servo that held before goes on holding.

    Raises:
        ServoError: all findings; no torque was switched on, or it is off again.
        BusError: the port failed.
    """
    with bus.patient():
        return _arm(bus, joints, servos)


def _arm(bus: Bus, joints: Sequence[JointSetup], servos: Sequence[ServoInfo]) -> tuple[Seed, ...]:
    findings: list[str] = []
    seeds: list[Seed] = []
    free: list[JointSetup] = []
    for joint, servo in zip(joints, servos, strict=True):
        try:
            before = _look(bus, joint, servo)
            if not before.holds:
                free.append(joint)
            seeds.append(_seed(bus, joint, servo, before))
        except ServoError as error:
            findings.extend(f"{joint}: {text}" for text in error.findings)
    if not findings:
        for i, (joint, servo) in enumerate(zip(joints, servos, strict=True)):
            try:
                seeds[i] = _settle(bus, joint, servo, seeds[i])
                bus.write_verified(joint.servo_id, ct.TORQUE_ENABLE.address, _TORQUE_AND_LED)
            except ServoError as error:
                findings.extend(f"{joint}: no torque: {text}" for text in error.findings)
    if findings:
        # Also where torque was not asked for yet: a servo may take a goal or a speed as such.
        if free:
            disarm(bus, free)
        raise ServoError(findings)
    return tuple(seeds)


def disarm(bus: Bus, joints: Sequence[JointSetup]) -> None:
    """Take the torque from all servos: twice by SYNC_WRITE, which needs no reply.

    Wheel-mode servos are stopped before: they may turn by Moving Speed alone.
    """
    wheels = {joint.servo_id: b"\x00\x00" for joint in joints if joint.mode == WHEEL_MODE}
    for _ in range(2):
        if wheels:
            bus.sync_write(ct.MOVING_SPEED.address, wheels)
        off = {joint.servo_id: b"\x00\x00" for joint in joints}
        bus.sync_write(ct.TORQUE_ENABLE.address, off)


def disarm_confirmed(bus: Bus, joints: Sequence[JointSetup]) -> tuple[bool | None, ...]:
    """Disarm; return what ``read_torque`` finds for each joint afterwards."""
    disarm(bus, joints)
    return tuple(read_torque(bus, joint) for joint in joints)


def require_off(joints: Sequence[JointSetup], torque: Sequence[bool | None]) -> None:
    """Check what ``disarm_confirmed`` returned.

    Raises:
        ServoError: torque is on, or not known to be off; names the servos.
    """
    unsure = [joint for joint, on in zip(joints, torque, strict=True) if on is not False]
    if unsure:
        raise ServoError([f"{joint}: torque off is not confirmed" for joint in unsure])


def read_torque(bus: Bus, joint: JointSetup, retries: int | None = None) -> bool | None:
    """Return whether Torque Enable is set, ``None`` if the servo did not answer."""
    # One byte is never read alone: an error status without data could pass for it.
    reply = bus.read(joint.servo_id, _RAM, 2, retries)
    return None if reply is None else ct.TORQUE_ENABLE.decode(reply.data, _RAM) != 0


class Armed(NamedTuple):
    """What an armed servo's RAM says.

    Attributes:
        torque_on: Torque Enable.
        shut_down: whether its Torque Limit is 0, after an alarm.
        wrong: what is not as ``arm`` left it, empty if nothing.
    """

    torque_on: bool
    shut_down: bool
    wrong: str


def check_armed(bus: Bus, joint: JointSetup, servo: ServoInfo) -> Armed | None:
    """Return what became of an armed servo's RAM, ``None`` if it did not answer.

    A servo that lost power for a moment answers as before but has lost torque and settings; after
    an alarm its torque limit is 0.
    """
    reply = bus.read(joint.servo_id, _RAM, _WATCHED, retries=0)
    if reply is None:
        return None
    torque = ct.TORQUE_ENABLE.decode(reply.data, _RAM) != 0
    shut_down = ct.TORQUE_LIMIT.decode(reply.data, _RAM) == 0
    wrong = ""
    if shut_down:
        wrong = "torque limit is 0: it switched itself off after an alarm"
    elif not torque:
        wrong = "torque is off: an alarm, or its power failed for a moment"
    elif (
        ct.LED.decode(reply.data, _RAM) != 1
        or reply.data[2:6] != _compliance(joint)
        or ct.TORQUE_LIMIT.decode(reply.data, _RAM) != _torque_limit(joint, servo)
    ):
        wrong = "its settings are gone: did its power fail for a moment?"
    return Armed(torque, shut_down, wrong)


def _look(bus: Bus, joint: JointSetup, servo: ServoInfo) -> _Before:
    before = bus.read(joint.servo_id, _RAM, _RAM_LENGTH)
    if before is None:
        raise ServoError(["does not answer"])
    enabled = ct.TORQUE_ENABLE.decode(before.data, _RAM) != 0
    # After an alarm Torque Enable may still be set, while the joint is limp.
    limp = (
        ct.TORQUE_LIMIT.decode(before.data, _RAM) == 0
        or before.error_bits & servo.shutdown_bits != 0
    )
    if enabled and limp:
        # Else its torque would return with the torque limit, before the others are ready.
        bus.write_verified(joint.servo_id, ct.TORQUE_ENABLE.address, b"\x00")
    return _Before(before.data, enabled and not limp)


def _seed(bus: Bus, joint: JointSetup, servo: ServoInfo, before: _Before) -> Seed:
    torque_limit = ct.TORQUE_LIMIT.encode(_torque_limit(joint, servo))
    if joint.mode == WHEEL_MODE:
        seed = Seed(0, 0.0, 0.0, before.holds)
        motion = ct.MOVING_SPEED.encode(0) + torque_limit
        address = ct.MOVING_SPEED.address
        bus.write_verified(joint.servo_id, ct.CW_COMPLIANCE_MARGIN.address, _compliance(joint))
    else:
        position = ct.PRESENT_POSITION.decode(before.ram, _RAM)
        kept = _goal_to_keep(joint, servo, before, position)
        if before.holds and kept is None:
            position = _steady_position(bus, joint)
        goal = position if kept is None else kept
        _require_possible(joint, servo, position, goal)
        seed = Seed(goal, ticks_to_rad(goal), ticks_to_rad(position), before.holds)
        motion = _compliance(joint) + ct.GOAL_POSITION.encode(goal)
        motion += ct.MOVING_SPEED.encode(SEED_SPEED_RAW) + torque_limit
        address = ct.CW_COMPLIANCE_MARGIN.address
    # One packet: the goal must not be in force with a speed or a compliance not meant for it.
    bus.write_verified(joint.servo_id, address, motion)
    _set_punch(bus, joint, before.ram)
    return seed


def _set_punch(bus: Bus, joint: JointSetup, ram: bytes) -> None:
    # Of what is set here only the punch lies where Lock forbids it, whatever its value.
    if ct.LOCK.decode(ram, _RAM) == 0:
        bus.write_verified(joint.servo_id, ct.PUNCH.address, ct.PUNCH.encode(joint.punch_raw))
    elif ct.PUNCH.decode(ram, _RAM) != joint.punch_raw:
        raise ServoError(
            [
                "is locked (Lock, address 47), so that its punch cannot be set: switch its power "
                "off and on"
            ]
        )


def _goal_to_keep(
    joint: JointSetup, servo: ServoInfo, before: _Before, position: int
) -> int | None:
    speed = decode_signed(ct.PRESENT_SPEED.decode(before.ram, _RAM))
    ahead = ct.GOAL_POSITION.decode(before.ram, _RAM) - position
    # One that a load pushes away is to be held against it; one on its way is to stop.
    if not before.holds or speed * ahead > 0:
        return None
    return _goal_that_holds(joint, servo, before.ram, position)


def _goal_that_holds(joint: JointSetup, servo: ServoInfo, ram: bytes, position: int) -> int | None:
    """Return the goal with which a servo that holds goes on as it does, by the settings to come.

    It rests a droop away from its goal; with goal = position it would let go of that, and sag.
    ``None`` if where it rests does not tell its load, or that goal is not allowed.
    """
    goal = ct.GOAL_POSITION.decode(ram, _RAM)
    load = decode_signed(ct.PRESENT_LOAD.decode(ram, _RAM))
    side = 1 if (goal - position or load) > 0 else -1
    found = Compliance.found(ram, _RAM, side > 0)
    wanted = Compliance.configured(joint, _torque_limit(joint, servo))
    distance = abs(goal - position)
    if found == wanted:
        kept = goal if distance <= wanted.margin_ticks + wanted.slope_ticks else None
    else:
        kept = _same_output(found, wanted, goal, side, distance, side * load)
    return kept if kept is not None and servo.goal_allowed(kept) else None


def _same_output(
    found: Compliance, wanted: Compliance, goal: int, side: int, distance: int, load: int
) -> int | None:
    """Return the goal at which other settings give the same output, ``None`` if it is not known."""
    output = found.output_near(distance, load)
    if math.isnan(output):
        return None
    # Within half a tick the output tells where the joint is.
    exact = distance if output == 0 else found.distance_at(output)
    exact = min(max(exact, distance - 0.5), distance + 0.5)
    needed = wanted.distance_at(output)
    if output == 0:
        needed = min(exact, needed)
    return goal + round(side * (needed - exact))


def _torque_limit(joint: JointSetup, servo: ServoInfo) -> int:
    return min(joint.torque_limit_raw, servo.max_torque_raw)


def _require_possible(joint: JointSetup, servo: ServoInfo, position: int, goal: int) -> None:
    if position > MAX_TICKS:
        raise ServoError([f"reports position {position}, which does not exist"])
    if not servo.goal_allowed(goal):
        raise ServoError(
            [
                f"stands at {joint.to_joint(ticks_to_rad(goal)):.3f} rad, outside its servo's "
                "angle limits, where it cannot be held: turn it inside by hand with torque off"
            ]
        )


def _read_position(bus: Bus, joint: JointSetup) -> int:
    at = ct.PRESENT_POSITION.address
    reply = bus.read(joint.servo_id, at, ct.PRESENT_POSITION.size)
    if reply is None:
        raise ServoError(["does not answer"])
    return ct.PRESENT_POSITION.decode(reply.data, at)


def _steady_position(bus: Bus, joint: JointSetup) -> int:
    """Return where a joint is; nonsense that its sensor's dead zone gives hardly ever agrees."""
    position, agreeing = _read_position(bus, joint), 1
    for _ in range(_STEADY_TRIES):
        before, position = position, _read_position(bus, joint)
        agreeing = agreeing + 1 if abs(position - before) <= _STILL_TICKS else 1
        if agreeing == _STEADY_READINGS:
            return position
    raise ServoError([_UNSTEADY])


def _settle(bus: Bus, joint: JointSetup, servo: ServoInfo, seed: Seed) -> Seed:
    """Return the seed of a joint that is free until now, for where it is by now."""
    if seed.had_torque or joint.mode == WHEEL_MODE:
        return seed
    _steady_position(bus, joint)
    # It may be falling: from here on every moment counts.
    for _ in range(_SETTLE_TRIES):
        position = _read_position(bus, joint)
        _require_possible(joint, servo, position, position)
        if abs(position - seed.goal_ticks) <= _STILL_TICKS:
            return seed
        goal = ct.GOAL_POSITION.encode(position)
        bus.write_verified(joint.servo_id, ct.GOAL_POSITION.address, goal)
        angle = ticks_to_rad(position)
        seed = dataclasses.replace(seed, goal_ticks=position, angle=angle, measured=angle)
    raise ServoError([_UNSTEADY])


def _compliance(joint: JointSetup) -> bytes:
    margin, slope = joint.margin_ticks, joint.slope_raw
    return bytes((margin, margin, slope, slope))
