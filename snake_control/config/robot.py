"""The shared groups of the configuration that describe the hardware: the robot and its servos."""

from __future__ import annotations

import dataclasses
import math
from typing import TypeVar

from snake_control.config.conditions import check_conditions
from snake_control.config.parameter import parameter
from snake_control.errors import ConfigError

_T = TypeVar("_T")

_DEGREE = math.pi / 180
_SERVO_HALF_RANGE_RAD = 150 * _DEGREE
_TICK_RAD = 300 * _DEGREE / 1023


def per_joint(field: str, values: tuple[_T, ...], joints: int) -> tuple[_T, ...]:
    """Return ``values`` as one entry for each joint; a single entry stands for all joints.

    Raises:
        ConfigError: any other length.
    """
    if len(values) == joints:
        return values
    if len(values) == 1:
        return values * joints
    raise ConfigError(
        field, list(values), f"give {joints} entries, one for each joint, or one for all"
    )


@dataclasses.dataclass(frozen=True)
class RobotConfig:
    """Structure and measures of the robot; defaults are the robot of the paper (Section 5)."""

    links: int = parameter(12, "n, number of links", low=6, high=200)
    head_links: int = parameter(
        5,
        "n_h, number of links of the raised head part; 0 for a planar snake, all on the floor",
        low=0,
        high=198,
    )
    wheelless_links: tuple[int, ...] = parameter(
        (7, 9, 11),
        "links of the base part without wheels, counted from the head, from 1 ([0] for none)",
        low=0,
    )
    head_scp_joints: tuple[int, ...] = parameter(
        (3,),
        "the n_h - 4 joints of the head part that are H-SCPs ([0] for none)",
        low=0,
    )
    joint_axes: tuple[str, ...] = parameter(
        ("pitch", "yaw", "pitch", "yaw", "pitch") + ("yaw",) * 6,
        "axis of each joint, pitch (y) or yaw (z), joint 1 first",
    )
    half_length_m: float = parameter(0.034, "l, half the length of a link [m]", low=1e-3, high=10.0)
    wheel_offset_m: float = parameter(
        0.032, "l_w, from the centre of a link to each wheel [m]", low=1e-4, high=10.0
    )
    wheel_radius_m: float = parameter(
        0.02, "height of the base link centres above the floor [m]", low=0.0, high=10.0
    )
    link_mass_kg: tuple[float, ...] = parameter(
        (0.1,), "mass of each link, or one for all [kg]", low=1e-6, high=1e3
    )
    link_size_m: tuple[float, ...] = parameter(
        (0.05, 0.032),
        "width and height of each link, a uniform box of length 2 l with its centre of mass in its "
        "middle [m]",
        low=1e-4,
        high=10.0,
    )
    joint_friction: tuple[float, ...] = parameter(
        (0.0,),
        "viscous friction of each joint, or one for all [N m s/rad]",
        low=0.0,
        high=1e3,
    )
    joint_torque_limits_n_m: tuple[float, ...] = parameter(
        (1.5,),
        "largest torque of each joint, or one for all (an AX-12 stalls at 1.5) [N m]",
        low=1e-3,
        high=1e3,
    )
    joint_limits_rad: tuple[float, ...] = parameter(
        (2.4,),
        "largest angle of each joint to both sides, or one for all; or lower and upper bound of "
        "each joint in turn (2 (n - 1) entries) [rad]",
        low=-100.0,
        high=100.0,
    )
    joint_speed_limits_rad_s: tuple[float, ...] = parameter(
        (5.5,), "largest speed of each joint, or one for all [rad/s]", low=1e-3, high=100.0
    )
    start_joint_angles_rad: tuple[float, ...] = parameter(
        (-0.11, 0.0, 0.0, 0.0, 1.1, *tuple(math.pi / d for d in (-9, 6, 6, -9, -6, -10))),
        "posture at the start of the experiment, phi(0) of Table 1 [rad]",
        low=-2 * math.pi,
        high=2 * math.pi,
    )

    def __post_init__(self) -> None:
        # rcl leaves a parameter given as [] uninitialised, so [0] is how a file says "none".
        for name in ("wheelless_links", "head_scp_joints"):
            if getattr(self, name) == (0,):
                object.__setattr__(self, name, ())
        check_conditions(
            self.links,
            self.head_links,
            self.wheelless_links,
            self.head_scp_joints,
            self.joint_axes,
        )
        masses = self.link_mass_kg
        if len(masses) not in (1, self.links):
            raise ConfigError(
                "robot.link_mass_kg", list(masses), f"give one mass for all or {self.links}"
            )
        if len(masses) == 1:
            object.__setattr__(self, "link_mass_kg", masses * self.links)
        if len(self.link_size_m) != 2:
            raise ConfigError(
                "robot.link_size_m", list(self.link_size_m), "give two sizes: width and height"
            )
        self._set_per_joint("joint_friction")
        self._set_per_joint("joint_torque_limits_n_m")
        self._set_per_joint("joint_speed_limits_rad_s")
        self._set_per_joint("start_joint_angles_rad")
        self._check_limits()

    def __hash__(self) -> int:
        # Looked up in every control step, so of a few fields that tell robots apart; equal robots
        # have equal ones.
        return hash((self.links, self.head_links, self.wheelless_links, self.head_scp_joints))

    def _set_per_joint(self, name: str) -> None:
        values = per_joint(f"robot.{name}", getattr(self, name), self.joints)
        object.__setattr__(self, name, values)

    def _check_limits(self) -> None:
        field = "robot.joint_limits_rad"
        limits = self.joint_limits_rad
        if len(limits) != 2 * self.joints:
            for i, limit in enumerate(limits):
                if limit <= 0:
                    raise ConfigError(f"{field}[{i}]", limit, "allowed: more than 0")
            symmetric = per_joint(field, limits, self.joints)
            limits = tuple(bound for limit in symmetric for bound in (-limit, limit))
            object.__setattr__(self, "joint_limits_rad", limits)
        for joint in range(1, self.joints + 1):
            lower, upper = self.joint_range(joint)
            if not lower < upper:
                raise ConfigError(
                    field, [lower, upper], f"lower bound of joint {joint} must be below its upper"
                )
            start = self.start_joint_angles_rad[joint - 1]
            if not lower <= start <= upper:
                raise ConfigError(
                    f"robot.start_joint_angles_rad[{joint - 1}]",
                    start,
                    f"joint {joint} must start inside its range {lower:g} to {upper:g}",
                )

    @property
    def joints(self) -> int:
        """Number of joints, n - 1."""
        return self.links - 1

    @property
    def joint_names(self) -> tuple[str, ...]:
        """``joint_1`` .. ``joint_(n-1)``."""
        return tuple(f"joint_{i}" for i in range(1, self.links))

    @property
    def base_scp_joints(self) -> tuple[int, ...]:
        """B-SCPs: joint i_k - 1 for every wheelless link i_k (paper, Section 2).

        Link 1 of a planar snake has no joint in front of it and gives none.
        """
        return tuple(link - 1 for link in self.wheelless_links if link > 1)

    @property
    def scp_joints(self) -> tuple[int, ...]:
        """All SCPs, H-SCPs first: the order of phi_tilde."""
        return self.head_scp_joints + self.base_scp_joints

    @property
    def planar(self) -> bool:
        """Whether no part is raised: all links on the floor, w = [x, y, Y]."""
        return self.head_links == 0

    @property
    def controlled(self) -> tuple[int, ...]:
        """Indices of [x_h, y_h, z_h, R, P, Y], from 0, that the controller moves."""
        return (0, 1, 5) if self.planar else (0, 1, 2, 3, 4, 5)

    @property
    def wheeled_links(self) -> tuple[int, ...]:
        """Base links with wheels, ascending."""
        return tuple(
            link
            for link in range(self.head_links + 1, self.links + 1)
            if link not in self.wheelless_links
        )

    def joint_range(self, joint: int) -> tuple[float, float]:
        """Lower and upper bound of joint 1 .. n-1 [rad]."""
        return self.joint_limits_rad[2 * joint - 2], self.joint_limits_rad[2 * joint - 1]


@dataclasses.dataclass(frozen=True)
class ServosConfig:
    """How joints map to servos, and the RAM settings every servo gets at activation."""

    ids: tuple[int, ...] = parameter(
        (0,), "bus id of each joint's servo ([0]: 1 .. n-1 in joint order)", low=0, high=252
    )
    directions: tuple[int, ...] = parameter(
        (1,),
        "+1 if the servo's counter-clockwise is the joint's positive direction, else -1",
        choices=(1, -1),
    )
    zero_offsets_rad: tuple[float, ...] = parameter(
        (0.0,),
        "servo angle (counter-clockwise from its centre) at joint angle 0 [rad]",
        low=-_SERVO_HALF_RANGE_RAD,
        high=_SERVO_HALF_RANGE_RAD,
    )
    velocity_modes: tuple[str, ...] = parameter(
        ("joint",),
        "joint: speed-regulated moves to a goal a little ahead; wheel: open-loop output, no limits",
        choices=("joint", "wheel"),
    )
    accepted_models: tuple[int, ...] = parameter(
        (12, 18, 300),
        "model numbers accepted at start (AX-12A 12, AX-18A 18, AX-12W 300)",
        low=0,
        high=65535,
    )
    compliance_margin_ticks: tuple[int, ...] = parameter(
        (1,), "position error without output, both directions [0.293 deg]", low=0, high=254
    )
    compliance_slope: tuple[int, ...] = parameter(
        (32,),
        "position error over which the output rises to its maximum [0.293 deg]",
        choices=(2, 4, 8, 16, 32, 64, 128),
    )
    punch_raw: tuple[int, ...] = parameter(
        (32,), "minimum output [1/1023 of the maximum]", low=0, high=1023
    )
    torque_limit: tuple[float, ...] = parameter(
        (1.0,), "largest output [fraction of the maximum]", low=0.01, high=1.0
    )

    def check_reach(self, robot: RobotConfig) -> None:
        """Check that joint-mode servos can reach the whole range of their joints, under load.

        The controller knows a joint's range from the robot alone; a servo that ends before it
        would stop a joint that the controller takes for free. And a load moves a joint away from
        its goal, by the compliance margin and slope at most; one that it moves past the end of its
        sensor is blind, which stops the robot until somebody turns it back by hand.

        Raises:
            ConfigError: a range that goes nearer to the servo's +-150 degrees than its compliance
                is wide.
        """
        for joint in range(1, robot.links):
            if self.velocity_modes[joint - 1] != "joint":
                continue
            give = self.compliance_margin_ticks[joint - 1] + self.compliance_slope[joint - 1]
            reach = _SERVO_HALF_RANGE_RAD - give * _TICK_RAD
            for bound in robot.joint_range(joint):
                angle = self.directions[joint - 1] * bound + self.zero_offsets_rad[joint - 1]
                if abs(angle) > reach:
                    raise ConfigError(
                        "robot.joint_limits_rad",
                        bound,
                        f"joint {joint} would turn its servo to {angle:.3f} rad; allowed in joint "
                        f"mode: +-{reach:.3f}, since beyond +-{_SERVO_HALF_RANGE_RAD:.3f} an AX-12 "
                        f"is blind, and loads move it by up to {give} ticks (compliance margin and "
                        "slope)",
                    )

    @staticmethod
    def for_joints(config: ServosConfig, joints: int) -> ServosConfig:
        """Return ``config`` with every per-joint list expanded to ``joints`` entries.

        Raises:
            ConfigError: a list of the wrong length, or an id given twice.
        """
        ids = config.ids
        if ids == (0,):
            ids = tuple(range(1, joints + 1))
        if len(ids) != joints:
            raise ConfigError("servos.ids", list(ids), f"give {joints} ids, one for each joint")
        doubled = sorted({i for i in ids if ids.count(i) > 1})
        if doubled:
            raise ConfigError("servos.ids", list(ids), f"every id once; {doubled[0]} is repeated")
        changes: dict[str, object] = {"ids": ids}
        for field in dataclasses.fields(config):
            if field.name not in ("ids", "accepted_models"):
                values = getattr(config, field.name)
                changes[field.name] = per_joint(f"servos.{field.name}", values, joints)
        return dataclasses.replace(config, **changes)  # type: ignore[arg-type]
