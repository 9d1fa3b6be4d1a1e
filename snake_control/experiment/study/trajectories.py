"""The head trajectories that a study runs, by name, from a YAML file or the built-in set."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from snake_control.config import RobotConfig
from snake_control.config.yaml_file import read_yaml
from snake_control.errors import ConfigError, ConfigFileError
from snake_control.trajectory.arc import Arc
from snake_control.trajectory.head_trajectory import HeadTrajectory
from snake_control.trajectory.line import Line

_TABLE_1_POSE = (0.0, 0.0, 0.2, math.pi / 8, math.pi / 8, 0.0)
_COMPONENTS = 6


@dataclasses.dataclass(frozen=True)
class StudyTrajectory:
    """One trajectory of the head.

    Attributes:
        name: how tables call it.
        kind: ``line`` or ``arc``.
        start_pose: w_d at t = 0, 6 numbers [m, rad].
        velocity: of a line, 6 numbers [m/s, rad/s].
        speed_m_s, radius_m: of an arc.
    """

    name: str
    kind: str
    start_pose: tuple[float, ...]
    velocity: tuple[float, ...] = (0.0,) * _COMPONENTS
    speed_m_s: float = 0.0
    radius_m: float = math.inf

    def make(self) -> HeadTrajectory:
        """Return the trajectory itself."""
        if self.kind == "arc":
            return Arc(self.start_pose, self.speed_m_s, self.radius_m)
        return Line(self.start_pose, self.velocity, 0.0)


def built_in(robot: RobotConfig) -> list[StudyTrajectory]:
    """Return Table 1's line, the same path at twice the speed while rising, and an arc.

    Lengths scale with the robot's links; a planar snake's head stays on the floor.
    """
    scale = robot.half_length_m / RobotConfig().half_length_m
    if robot.head_links:
        start = (0.0, 0.0, _TABLE_1_POSE[2] * scale, *_TABLE_1_POSE[3:])
        rise = 0.0005 * scale
    else:
        start, rise = (0.0, 0.0, robot.wheel_radius_m, 0.0, 0.0, 0.0), 0.0
    along = 0.01 * scale
    return [
        StudyTrajectory("line", "line", start, (along, 0.0, 0.0, 0.0, 0.0, 0.0)),
        StudyTrajectory("fast rise", "line", start, (2 * along, 0.0, rise, 0.0, 0.0, 0.0)),
        StudyTrajectory("arc", "arc", start, speed_m_s=along, radius_m=0.5 * scale),
    ]


def read_trajectories(path: str | Path) -> list[StudyTrajectory]:
    """Read trajectories from a YAML file: a map from name to kind and measures.

    line: {kind: line, start_pose: [..6], velocity: [..6]}
    arc: {kind: arc, start_pose: [..6], speed_m_s: 0.01, radius_m: 0.5}

    Raises:
        ConfigFileError: the file cannot be read, or is no map.
        ConfigError: names the field that is wrong and what is allowed.
    """
    tree = read_yaml(path)
    if not isinstance(tree, Mapping) or not tree:
        raise ConfigFileError(str(path), "expected a map from names to trajectories")
    return [_trajectory(str(name), fields) for name, fields in tree.items()]


def _trajectory(name: str, fields: Any) -> StudyTrajectory:
    if not isinstance(fields, Mapping):
        raise ConfigError(name, fields, "give a map with kind, start_pose, ...")
    measures = {"line": ("velocity",), "arc": ("speed_m_s", "radius_m")}
    kind = fields.get("kind")
    if not isinstance(kind, str) or kind not in measures:
        raise ConfigError(f"{name}.kind", kind, f"allowed: {', '.join(measures)}")
    allowed = ("kind", "start_pose", *measures[kind])
    for key in fields:
        if key not in allowed:
            raise ConfigError(f"{name}.{key}", fields[key], f"allowed: {', '.join(allowed)}")
    values: dict[str, Any] = {"start_pose": _six(f"{name}.start_pose", fields.get("start_pose"))}
    if kind == "line":
        values["velocity"] = _six(f"{name}.velocity", fields.get("velocity"))
    else:
        values["speed_m_s"] = _number(f"{name}.speed_m_s", fields.get("speed_m_s"))
        values["radius_m"] = _number(f"{name}.radius_m", fields.get("radius_m"))
        if values["speed_m_s"] <= 0:
            raise ConfigError(f"{name}.speed_m_s", values["speed_m_s"], "allowed: more than 0")
        if values["radius_m"] == 0:
            raise ConfigError(f"{name}.radius_m", 0.0, "allowed: any length but 0 (> 0 turns left)")
    return StudyTrajectory(name, kind, **values)


def _six(field: str, values: Any) -> tuple[float, ...]:
    if not isinstance(values, list) or len(values) != _COMPONENTS:
        raise ConfigError(field, values, "give 6 numbers: x, y, z, R, P, Y")
    return tuple(_number(f"{field}[{i}]", value) for i, value in enumerate(values))


def _number(field: str, value: Any) -> float:
    try:
        number = float(value) if isinstance(value, int | float) else math.nan
    except OverflowError:
        number = math.nan
    if isinstance(value, bool) or not math.isfinite(number):
        raise ConfigError(field, value, "give a finite number")
    return number
