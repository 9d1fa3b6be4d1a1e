"""What a servo's EEPROM says, and what about it does not fit the joint that it drives."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection

from snake_control.ax12 import control_table as ct
from snake_control.ax12.joint import JOINT_MODE, WHEEL_MODE, JointSetup
from snake_control.ax12.units import (
    ERROR_OVERHEATING,
    ERROR_OVERLOAD,
    MAX_RAW,
    MAX_TICKS,
    error_names,
    raw_to_volt,
    ticks_to_rad,
)

LENGTH = ct.ALARM_SHUTDOWN.end
"""Bytes from address 0 on that are looked at."""

_ALL_REPLIES = 2
_FACTORY_C = (70, 75, 85)
_NOMINAL_V = 11.1
_PROTECTION = ERROR_OVERHEATING | ERROR_OVERLOAD


@dataclasses.dataclass(frozen=True)
class Finding:
    """Something about a servo or the bus that is not as it should be.

    Attributes:
        text: what it is and what to do.
        error: whether the robot must not be driven so; else it is worth a warning.
        joint: whose servo it is about, ``None`` for the whole bus.
        advice: whether it works as it is, and could work better.
    """

    text: str
    error: bool
    joint: JointSetup | None = None
    advice: bool = False

    def __str__(self) -> str:
        return self.text if self.joint is None else f"{self.joint}: {self.text}"


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


def check(joint: JointSetup, block: bytes, accepted_models: Collection[int]) -> list[Finding]:
    """Return everything that does not fit.

    Args:
        joint: what the servo drives.
        block: the first ``LENGTH`` bytes of its control table.
        accepted_models: model numbers.
    """
    errors = [Finding(text, True, joint) for text in _errors(joint, block, accepted_models)]
    warnings = [Finding(text, False, joint) for text in _warnings(joint, block)]
    # Of a servo that cannot be used the rest does not matter yet.
    return errors or warnings


def _errors(joint: JointSetup, block: bytes, accepted_models: Collection[int]) -> list[str]:
    found = []
    model = ct.MODEL_NUMBER.decode(block, 0)
    if model not in accepted_models:
        expected = ", ".join(map(str, sorted(accepted_models)))
        found.append(f"is model {model}, accepted are {expected}")
    level = ct.STATUS_RETURN_LEVEL.decode(block, 0)
    if level != _ALL_REPLIES:
        found.append(
            f"does not acknowledge writes: {register_name(ct.STATUS_RETURN_LEVEL)} is {level}, "
            f"set it to {_ALL_REPLIES}"
        )
    if ct.MAX_TORQUE.decode(block, 0) == 0:
        found.append(
            f"{register_name(ct.MAX_TORQUE)} is 0, so it cannot hold anything: set it to 1023"
        )
    cw, ccw = _angle_limits(block)
    actual = WHEEL_MODE if cw == ccw == 0 else JOINT_MODE
    if actual != joint.mode:
        wanted = "both to 0" if joint.mode == WHEEL_MODE else f"to 0 and {MAX_TICKS}"
        found.append(
            f"is in {actual} mode but configured as {joint.mode}: set "
            f"{register_name(ct.CW_ANGLE_LIMIT)} and {register_name(ct.CCW_ANGLE_LIMIT)} {wanted} "
            "with torque off, or change servos.velocity_modes"
        )
    elif joint.mode == JOINT_MODE:
        lower, upper = _goal_range(joint, block)
        if lower >= upper:
            found.append(
                f"its angle limits {cw}..{ccw} and the joint's range {joint.range_ticks[0]}.."
                f"{joint.range_ticks[1]} have nothing in common"
            )
    return found


def _warnings(joint: JointSetup, block: bytes) -> list[str]:
    found = []
    narrowed = _narrowed(joint, servo_info(joint, block))
    if narrowed:
        found.append(narrowed)
    missing = _PROTECTION & ~ct.ALARM_SHUTDOWN.decode(block, 0)
    if missing:
        found.append(
            f"does not shut down by itself at: {', '.join(error_names(missing))}; set "
            f"{register_name(ct.ALARM_SHUTDOWN)} to 36"
        )
    max_torque = ct.MAX_TORQUE.decode(block, 0)
    if max_torque < joint.torque_limit_raw:
        found.append(
            f"{register_name(ct.MAX_TORQUE)} allows {100 * max_torque / MAX_RAW:.0f} % of its "
            f"torque, less than the {100 * joint.torque_limit:.0f} % configured"
        )
    low = raw_to_volt(ct.MIN_VOLTAGE_LIMIT.decode(block, 0))
    high = raw_to_volt(ct.MAX_VOLTAGE_LIMIT.decode(block, 0))
    if not low <= _NOMINAL_V <= high:
        found.append(
            f"its voltage limits {low:.1f} to {high:.1f} V do not hold the {_NOMINAL_V} V that it "
            f"is made for: see {register_name(ct.MIN_VOLTAGE_LIMIT)} and "
            f"{register_name(ct.MAX_VOLTAGE_LIMIT)}"
        )
    hottest = ct.TEMPERATURE_LIMIT.decode(block, 0)
    if hottest not in _FACTORY_C:
        found.append(
            f"{register_name(ct.TEMPERATURE_LIMIT)} is {hottest} degC, none that comes from the "
            "factory (70; AX-18A 75; AX-12 of 2006 85): the manual says not to change it"
        )
    return found


def servo_info(joint: JointSetup, block: bytes) -> ServoInfo:
    """Return what the driver needs to know, of the first ``LENGTH`` bytes of a control table."""
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


def effective_range(joint: JointSetup, servo: ServoInfo) -> tuple[float, float]:
    """Return the range [rad] of a joint within its servo's angle limits; all in wheel mode."""
    if joint.mode == WHEEL_MODE:
        return -math.inf, math.inf
    low, high = sorted(
        joint.to_joint(ticks_to_rad(t)) for t in (servo.lower_ticks, servo.upper_ticks)
    )
    return max(low, joint.lower), min(high, joint.upper)


def _narrowed(joint: JointSetup, servo: ServoInfo) -> str:
    if joint.mode == WHEEL_MODE or (servo.lower_ticks, servo.upper_ticks) == joint.range_ticks:
        return ""
    low, high = effective_range(joint, servo)
    return (
        f"the servo's angle limits narrow its range from {joint.lower:.3f}..{joint.upper:.3f} to "
        f"{low:.3f}..{high:.3f} rad"
    )


def register_name(register: ct.Register) -> str:
    """Return the name and the address of a register."""
    return f"{register.name} (address {register.address})"
