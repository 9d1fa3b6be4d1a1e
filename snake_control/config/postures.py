"""The group ``postures``: sets of joint angles by name, the only group whose names are free.

Two are always there: ``flat``, all joints at 0, and ``start``, the robot's start posture.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from typing import Any

from snake_control.config.parameter import Parameter
from snake_control.config.robot import RobotConfig, per_joint
from snake_control.errors import ConfigError

GROUP = "postures"

FLAT = "flat"
START = "start"
_BUILT_IN = {
    FLAT: "all joints at 0",
    START: "robot.start_joint_angles_rad",
}
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@dataclasses.dataclass(frozen=True)
class PosturesConfig:
    """Postures by name.

    Attributes:
        named: name and angles [rad], one for each joint, of all postures that there are.
    """

    named: tuple[tuple[str, tuple[float, ...]], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All names, the built-in ones first."""
        return tuple(name for name, _ in self.named)

    def angles(self, field: str, name: str) -> tuple[float, ...]:
        """Return the angles of a posture, one for each joint [rad].

        Args:
            field: what asks for it, for the error.
            name: of the posture.

        Raises:
            ConfigError: there is none of that name.
        """
        for each, angles in self.named:
            if each == name:
                return angles
        raise ConfigError(field, name, f"no such posture; there are: {', '.join(self.names)}")


def posture_parameter(field: str) -> Parameter | None:
    """Return the description of ``postures.<name>``, or ``None`` for a field of another group.

    Raises:
        ConfigError: no name, or one of the built-in ones.
    """
    group, dot, name = field.partition(".")
    if group != GROUP or not dot:
        return None
    if name in _BUILT_IN:
        raise ConfigError(field, name, f"built in: {_BUILT_IN[name]}; give another name")
    if not _NAME.fullmatch(name):
        raise ConfigError(field, name, "a name has letters, digits and _, a letter first")
    return Parameter(
        name=name,
        kind=float,
        is_list=True,
        default=None,
        doc=f"the posture {name}: angle of each joint, or one for all [rad]",
        low=-2 * math.pi,
        high=2 * math.pi,
        choices=(),
        run_time=False,
    )


def postures_from(robot: RobotConfig, given: Mapping[str, Any]) -> PosturesConfig:
    """Return the built-in postures and the given ones.

    Args:
        robot: its joints say how many angles there are, and within which ranges.
        given: values by their fields, ``postures.<name>``.

    Raises:
        ConfigError: another number of angles, or one beyond its joint's range; a wrong name.
    """
    named = {START: robot.start_joint_angles_rad}
    flat = (0.0,) * robot.joints
    if _beyond(robot, flat) is None:
        named = {FLAT: flat} | named
    for field, value in given.items():
        item = posture_parameter(field)
        assert item is not None
        if isinstance(value, int | float) and not isinstance(value, bool):
            value = [value]
        angles = per_joint(field, item.parse(field, value), robot.joints)
        joint = _beyond(robot, angles)
        if joint is not None:
            lower, upper = robot.joint_range(joint)
            raise ConfigError(
                f"{field}[{joint - 1}]",
                angles[joint - 1],
                f"inside the range of joint {joint}, {lower:g} to {upper:g}",
            )
        named[item.name] = angles
    return PosturesConfig(tuple(named.items()))


def _beyond(robot: RobotConfig, angles: tuple[float, ...]) -> int | None:
    """Return the first joint, from 1, whose angle is beyond its range."""
    for joint, angle in enumerate(angles, start=1):
        lower, upper = robot.joint_range(joint)
        if not lower <= angle <= upper:
            return joint
    return None
