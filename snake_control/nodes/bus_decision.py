"""What the driver does with commands in one cycle, and why: one rule after the other."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from snake_control.ax12.joint import JointSetup
from snake_control.nodes.bus_command import CommandBuffer
from snake_control.nodes.bus_snapshot import State

Velocities = tuple[float, ...] | None
"""One per joint [rad/s]; ``None`` to hold."""


@dataclasses.dataclass(frozen=True)
class Situation:
    """What the decision depends on.

    Attributes:
        active: the lifecycle's state.
        emergency: an emergency stop is latched.
        fault: why the robot was stopped; empty if it was not.
        port: what is wrong with the port, or that it works again after it was lost; else empty.
        dry_run: nothing may be written.
        armed: the servos were given torque here, and hold.
        torque_on: the joints with torque, whoever gave it.
        joints: how many there are.
        lowering: how far a lowering is, in words; empty without one.
        note: what else there is to say while the joints hold.
    """

    active: bool
    emergency: bool
    fault: str
    port: str
    dry_run: bool
    armed: bool
    torque_on: Sequence[JointSetup]
    joints: int
    lowering: str
    note: str = ""


def decide(now: Situation, commands: CommandBuffer, time: float) -> tuple[State, str, Velocities]:
    """Return state, text and velocities of a cycle at a monotonic time [s]."""
    state, text, velocities = _decide(now, commands, time)
    return state, text + commands.refusal(time), velocities


def _decide(now: Situation, commands: CommandBuffer, time: float) -> tuple[State, str, Velocities]:
    wrong = _joined(now.fault, now.port)
    if now.lowering:
        return State.LOWERING, now.lowering, None
    if not now.active:
        latched = "emergency stop is latched" if now.emergency else ""
        return State.INACTIVE, _joined(wrong or "not activated", latched), None
    if now.emergency:
        text = _joined("emergency stop: needs ~/reset_emergency_stop", wrong)
        return State.EMERGENCY_STOP, text, None
    if now.dry_run:
        velocities, text = commands.newest(time)
        on = f"torque is on at {named(now.torque_on)}" if now.torque_on else ""
        return State.DRY_RUN, _joined(f"dry run: {wrong or text}", on), velocities
    if now.fault:
        return State.STOPPED, _joined(wrong, "needs ~/recover"), None
    if not now.armed:
        return *_not_armed(now), None
    velocities, text = commands.newest(time)
    if velocities is None:
        return State.HOLDING, _joined(text, now.note), None
    return State.MOVING, text, velocities


def _not_armed(now: Situation) -> tuple[State, str]:
    if not now.torque_on:
        return State.TORQUE_OFF, "torque is off"
    return (
        State.HOLDING if len(now.torque_on) == now.joints else State.TORQUE_OFF,
        f"torque is still on at {named(now.torque_on)}; no command is taken before ~/set_torque",
    )


def named(joints: Sequence[JointSetup]) -> str:
    """Return the joints in one phrase."""
    return ", ".join(map(str, joints))


def _joined(*texts: str) -> str:
    return "; ".join(text for text in texts if text)
