"""Motion of one servo: motor, gear friction and the position control that the manual draws.

Torques and angles are positive counter-clockwise. ``load`` is the torque that the servo has to
apply to hold its joint; outputs are fractions of the motor's full voltage, -1 to 1.
"""

from __future__ import annotations

import dataclasses
import functools
import math

from snake_control.mock.units import TICK_RAD


@dataclasses.dataclass(frozen=True, slots=True)
class MotorParameters:
    """A geared DC motor.

    Attributes:
        stall_torque_nm: torque at full output and rest, at the rated voltage [N m].
        no_load_speed_rad_s: speed at full output without load, at the rated voltage [rad/s].
        acceleration_rad_s2: largest acceleration, both ways [rad/s^2].
        friction_torque_nm: friction of the gear, at rest and moving; less than the stall torque
            [N m].
        rated_voltage_v: voltage that the figures above belong to [V].
        joint_mode_speed_rad_s: largest speed that the firmware lets it have in joint mode; by
            default as fast as it can [rad/s].
    """

    stall_torque_nm: float = 1.5
    no_load_speed_rad_s: float = 6.18
    acceleration_rad_s2: float = 60.0
    friction_torque_nm: float = 0.1
    rated_voltage_v: float = 12.0
    joint_mode_speed_rad_s: float = math.inf

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            low_ok = value >= 0 if field.name == "friction_torque_nm" else value > 0
            unlimited = field.name == "joint_mode_speed_rad_s" and value == math.inf
            if not (low_ok and (math.isfinite(value) or unlimited)):
                raise ValueError(f"{field.name} = {value!r}: give a positive number")
        if self.friction_torque_nm >= self.stall_torque_nm:
            raise ValueError("friction_torque_nm must be less than stall_torque_nm")

    @property
    def speed_per_torque(self) -> float:
        """Speed gained by each N m beyond load and friction [rad/(s N m)]."""
        return self.no_load_speed_rad_s / (self.stall_torque_nm - self.friction_torque_nm)

    def torque(self, voltage_v: float) -> float:
        """Torque of the full output at rest [N m]."""
        return self.stall_torque_nm * voltage_v / self.rated_voltage_v

    def attainable_speed(self, torque: float) -> float:
        """Speed at which a torque beyond the load, of either sign, is used up [rad/s].

        Without friction this is no_load_speed * (output - load / stall_torque); friction takes its
        share, and holds the gear still when there is no more than that.
        """
        beyond = abs(torque) - self.friction_torque_nm
        return math.copysign(beyond * self.speed_per_torque, torque) if beyond > 0 else 0.0


@dataclasses.dataclass(frozen=True, slots=True)
class Side:
    """Compliance on one side of the goal: margin and slope as angles [rad]."""

    margin_rad: float
    slope_rad: float


@dataclasses.dataclass(frozen=True, slots=True)
class OpenLoop:
    """Wheel mode, or no torque at all: a constant output."""

    output: float = 0.0


@dataclasses.dataclass(frozen=True, slots=True)
class ToGoal:
    """Joint mode: a move to a goal at a regulated speed.

    Attributes:
        goal_rad: servo angle to go to [rad].
        speed_rad_s: regulated speed; infinite for "no speed control" [rad/s].
        ccw: compliance while the goal lies counter-clockwise of the shaft.
        cw: compliance while it lies clockwise.
        punch: output at the edge of the margin.
        torque_limit: largest output.
    """

    goal_rad: float
    speed_rad_s: float
    ccw: Side
    cw: Side
    punch: float
    torque_limit: float

    def error(self, angle_rad: float) -> float:
        """Angle from the shaft to the goal; full turns in wheel mode do not count [rad]."""
        return self.goal_rad - math.remainder(angle_rad, 2 * math.pi)

    def side(self, error_rad: float) -> Side:
        """Return the compliance that is in force at an error."""
        return self.ccw if error_rad > 0 else self.cw

    def output(self, error_rad: float) -> float:
        """Output at an angle error: the figure "Compliance" of the manual (page 16).

        None within the margin; from the punch at its edge linearly to the torque limit.
        """
        side = self.side(error_rad)
        beyond = abs(error_rad) - side.margin_rad
        if beyond <= 0:
            return 0.0
        fraction = min(beyond / side.slope_rad, 1.0)
        output = self.punch + (self.torque_limit - self.punch) * fraction
        return math.copysign(min(output, self.torque_limit), error_rad)


Drive = OpenLoop | ToGoal

SLOPE_STEPS_TICKS = (2, 4, 8, 16, 32, 64, 128)


def slope_ticks(raw: int) -> int:
    """Return the step in force for a value of a Compliance Slope register (manual, page 17).

    Seven steps: up to 3 means 2, up to 7 means 4, ... and 128 and above means 128.
    """
    return next((s for s in SLOPE_STEPS_TICKS if raw < 2 * s), SLOPE_STEPS_TICKS[-1])


@functools.lru_cache(maxsize=1024)
def side(margin_ticks: int, slope_raw: int) -> Side:
    """Build one side's compliance from its two registers."""
    return Side(margin_ticks * TICK_RAD, slope_ticks(slope_raw) * TICK_RAD)


@dataclasses.dataclass(slots=True)
class Motion:
    """State of the shaft.

    Attributes:
        angle_rad: servo angle; counts full turns [rad].
        speed_rad_s: its rate [rad/s].
        output: output that the motor was given, after speed regulation.
    """

    angle_rad: float = 0.0
    speed_rad_s: float = 0.0
    output: float = 0.0


# The position loop is integrated explicitly; a step takes off at most this share of the error.
_LARGEST_GAIN_PER_STEP = 0.5


def advance(
    motion: Motion,
    drive: Drive,
    motor: MotorParameters,
    load_nm: float,
    voltage_v: float,
    dt: float,
) -> None:
    """Move the shaft on by ``dt`` seconds, in place.

    Args:
        motion: state of the shaft.
        drive: what the servo's registers ask of the motor.
        motor: the motor and its gear.
        load_nm: torque that holding the joint takes, constant over the step [N m].
        voltage_v: supply voltage [V].
        dt: time to go [s].
    """
    torque = motor.torque(voltage_v)
    steps = 1
    if isinstance(drive, ToGoal):
        steepest = min(drive.ccw.slope_rad, drive.cw.slope_rad)
        gain = drive.torque_limit * torque * motor.speed_per_torque / steepest
        steps = math.ceil(dt * gain / _LARGEST_GAIN_PER_STEP) or 1
    h = dt / steps
    largest_change = motor.acceleration_rad_s2 * h
    for _ in range(steps):
        target, motion.output = _target(motion, drive, motor, load_nm, torque)
        before = motion.speed_rad_s
        change = min(max(target - before, -largest_change), largest_change)
        motion.speed_rad_s = before + change
        motion.angle_rad += (before + 0.5 * change) * h


def block(motion: Motion, drive: Drive) -> None:
    """Keep the shaft where it is, in place: at rest speed control gives all that the goal asks."""
    motion.speed_rad_s = 0.0
    if isinstance(drive, OpenLoop):
        motion.output = drive.output
    else:
        motion.output = drive.output(drive.error(motion.angle_rad))


def _target(
    motion: Motion, drive: Drive, motor: MotorParameters, load_nm: float, torque: float
) -> tuple[float, float]:
    """Return the speed that the shaft tends to, and the output given to the motor."""
    if isinstance(drive, OpenLoop):
        return motor.attainable_speed(drive.output * torque - load_nm), drive.output
    error = drive.error(motion.angle_rad)
    output = drive.output(error)
    speed = motor.attainable_speed(output * torque - load_nm)
    if error * speed <= 0 or abs(speed) <= drive.speed_rad_s:
        return speed, output
    # Speed control takes the output back until the regulated speed results; with the load's
    # help that can mean braking.
    speed = math.copysign(drive.speed_rad_s, speed)
    needed = (
        load_nm + speed / motor.speed_per_torque + math.copysign(motor.friction_torque_nm, speed)
    )
    limit = drive.torque_limit
    return speed, min(max(needed / torque, -limit), limit) if torque > 0 else 0.0
