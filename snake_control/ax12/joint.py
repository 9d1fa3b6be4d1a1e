"""One joint's servo: how it is wired, and the map between joint and servo angles."""

from __future__ import annotations

import dataclasses
import math

from snake_control.ax12.units import MAX_RAW, compliance_step, rad_to_ticks
from snake_control.config import RobotConfig, ServosConfig

JOINT_MODE, WHEEL_MODE = "joint", "wheel"


@dataclasses.dataclass(frozen=True)
class JointSetup:
    """What the configuration says about one joint and its servo (SI units, joint frame).

    Attributes:
        name: ``joint_1``, ...
        servo_id: id on the bus.
        direction: +1 if the servo's counter-clockwise is the joint's positive direction, else -1.
        zero_offset: servo angle at joint angle 0 [rad].
        mode: ``joint`` or ``wheel``.
        lower, upper: range of the joint [rad].
        speed_limit: [rad/s].
        margin_ticks, slope_raw, punch_raw, torque_limit: RAM settings; the last as fraction.
    """

    name: str
    servo_id: int
    direction: int
    zero_offset: float
    mode: str
    lower: float
    upper: float
    speed_limit: float
    margin_ticks: int
    slope_raw: int
    punch_raw: int
    torque_limit: float

    def to_servo(self, angle: float) -> float:
        """Return the servo angle of a joint angle [rad]."""
        return self.zero_offset + self.direction * angle

    def to_joint(self, servo_angle: float) -> float:
        """Return the joint angle of a servo angle [rad]."""
        return self.direction * (servo_angle - self.zero_offset)

    @property
    def range_ticks(self) -> tuple[int, int]:
        """First and last position value inside the joint's range; may exceed 0..1023."""
        ends = sorted((self.to_servo(self.lower), self.to_servo(self.upper)))
        return math.ceil(rad_to_ticks(ends[0])), math.floor(rad_to_ticks(ends[1]))

    @property
    def compliance_ticks(self) -> int:
        """Distance to the goal within which the servo does not move at its Moving Speed."""
        return self.margin_ticks + compliance_step(self.slope_raw)

    @property
    def torque_limit_raw(self) -> int:
        """Register value of the torque limit."""
        return max(1, round(self.torque_limit * MAX_RAW))

    def __str__(self) -> str:
        return f"{self.name} (servo id {self.servo_id})"


def joint_setups(robot: RobotConfig, servos: ServosConfig) -> tuple[JointSetup, ...]:
    """Return the setup of joints 1 to n-1; ``servos`` must be expanded, one entry per joint."""
    setups = []
    for i, name in enumerate(robot.joint_names):
        lower, upper = robot.joint_range(i + 1)
        setups.append(
            JointSetup(
                name=name,
                servo_id=servos.ids[i],
                direction=servos.directions[i],
                zero_offset=servos.zero_offsets_rad[i],
                mode=servos.velocity_modes[i],
                lower=lower,
                upper=upper,
                speed_limit=robot.joint_speed_limits_rad_s[i],
                margin_ticks=servos.compliance_margin_ticks[i],
                slope_raw=servos.compliance_slope[i],
                punch_raw=servos.punch_raw[i],
                torque_limit=servos.torque_limit[i],
            )
        )
    return tuple(setups)
