"""Turns parameter files, or the parameters of a node, into one validated frozen snapshot."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from snake_control.config.nodes import (
    BusDriverConfig,
    MockBusConfig,
    PoseInputConfig,
    ScpControllerConfig,
    TrajectoryGeneratorConfig,
)
from snake_control.config.parameter import Parameter, parameters
from snake_control.config.robot import ControllerConfig, RobotConfig, ServosConfig
from snake_control.config.yaml_file import read_sections
from snake_control.errors import ConfigError

_SHARED_GROUPS: dict[str, type] = {
    "robot": RobotConfig,
    "servos": ServosConfig,
    "controller": ControllerConfig,
}
_NODE_GROUPS: dict[str, type] = {
    "bus_driver": BusDriverConfig,
    "pose_input": PoseInputConfig,
    "scp_controller": ScpControllerConfig,
    "trajectory_generator": TrajectoryGeneratorConfig,
    "mock_bus": MockBusConfig,
}
_SHARED_GROUPS_OF_NODE: dict[str, tuple[str, ...]] = {
    "bus_driver": ("robot", "servos"),
    "pose_input": (),
    "scp_controller": ("robot", "controller"),
    "trajectory_generator": (),
    "mock_bus": ("robot", "servos"),
}
# Parameters that rclpy itself declares in every node.
_ROS_NAMES = ("use_sim_time", "start_type_description_service")
_ROS_PREFIXES = ("qos_overrides.",)


@dataclasses.dataclass(frozen=True)
class Config:
    """One validated snapshot of everything that can be configured."""

    robot: RobotConfig
    servos: ServosConfig
    controller: ControllerConfig
    bus_driver: BusDriverConfig
    pose_input: PoseInputConfig
    scp_controller: ScpControllerConfig
    trajectory_generator: TrajectoryGeneratorConfig
    mock_bus: MockBusConfig


def load(*paths: str | Path) -> Config:
    """Read parameter files, later ones winning over earlier ones.

    Sections with a wildcard (``/**``) may hold the shared groups ``robot``, ``servos`` and
    ``controller`` and any node's own parameters; a section of a node holds what that node knows.

    Raises:
        ConfigFileError: a file that cannot be read or is no ROS parameter file.
        ConfigError: a value that is unknown, missing, of the wrong type, or not allowed.
    """
    shared: dict[str, Any] = {}
    own: dict[str, dict[str, Any]] = {node: {} for node in _NODE_GROUPS}
    for path in paths:
        for pattern, values in read_sections(path):
            nodes = _nodes_of(pattern)
            if not nodes:
                continue
            known = known_parameters(nodes)
            for field, value in values.items():
                if not is_ros_parameter(field):
                    refuse_unknown(field, value, known)
                if field.partition(".")[0] in _SHARED_GROUPS:
                    shared[field] = value
                for node in nodes:
                    if field in known_parameters((node,)):
                        own[node][field] = value
    return _build(shared, own)


def from_parameters(node: str, values: Mapping[str, Any]) -> Config:
    """Build a snapshot from the parameters of one node; groups it does not know keep defaults.

    Args:
        node: node kind (``bus_driver``, ...), not its possibly remapped name.
        values: flat parameter names (``robot.links``) and values.

    Raises:
        ConfigError: as ``load``.
    """
    known = known_parameters((node,))
    for field, value in values.items():
        if not is_ros_parameter(field):
            refuse_unknown(field, value, known)
    shared = {f: v for f, v in values.items() if f.partition(".")[0] in _SHARED_GROUPS}
    own = {name: dict(values) if name == node else {} for name in _NODE_GROUPS}
    return _build(shared, own)


def known_parameters(nodes: Iterable[str]) -> dict[str, Parameter]:
    """Return what the given kinds of nodes declare: flat name to description, in file order."""
    known: dict[str, Parameter] = {}
    for node in nodes:
        for group in _SHARED_GROUPS_OF_NODE[node]:
            for name, item in parameters(_SHARED_GROUPS[group]).items():
                known[f"{group}.{name}"] = item
    for node in nodes:
        known.update(parameters(_NODE_GROUPS[node]))
    return known


def is_ros_parameter(field: str) -> bool:
    """Whether a parameter belongs to rclpy and not to this package."""
    return field in _ROS_NAMES or field.startswith(_ROS_PREFIXES)


def refuse_unknown(field: str, value: object, known: Iterable[str]) -> None:
    """Raise ``ConfigError`` if ``field`` is not among the ``known`` names."""
    known = list(known)
    if field in known:
        return
    near = difflib.get_close_matches(field, known, n=1)
    hint = f"did you mean {near[0]}?" if near else "no such parameter"
    raise ConfigError(field, value, f"unknown parameter; {hint}")


def _nodes_of(pattern: str) -> tuple[str, ...]:
    """Kinds of nodes a section applies to; a section of some other node applies to none."""
    last = pattern.rpartition("/")[2]
    if last in ("**", "*"):
        return tuple(_NODE_GROUPS)
    nodes = tuple(node for node in _NODE_GROUPS if last == node)
    if not nodes:
        near = difflib.get_close_matches(last, list(_NODE_GROUPS), n=1)
        if near:
            raise ConfigError(pattern, "ros__parameters", f"no such node; did you mean {near[0]}?")
    return nodes


def _build(shared: Mapping[str, Any], own: Mapping[str, Mapping[str, Any]]) -> Config:
    groups: dict[str, Any] = {}
    for group, cls in _SHARED_GROUPS.items():
        prefix = f"{group}."
        values = {f[len(prefix) :]: v for f, v in shared.items() if f.startswith(prefix)}
        groups[group] = _group(cls, prefix, values)
    robot: RobotConfig = groups["robot"]
    groups["servos"] = ServosConfig.for_joints(groups["servos"], robot.joints)
    groups["controller"] = ControllerConfig.for_scps(groups["controller"], len(robot.scp_joints))
    for node, cls in _NODE_GROUPS.items():
        names = parameters(cls)
        groups[node] = _group(cls, "", {f: v for f, v in own[node].items() if f in names})
    return Config(**groups)


def _group(cls: type, prefix: str, values: Mapping[str, Any]) -> Any:
    known = parameters(cls)
    arguments = {}
    for name, value in values.items():
        refuse_unknown(f"{prefix}{name}", value, (f"{prefix}{k}" for k in known))
        item = known[name]
        # One mass for all links, one limit for all joints: a number stands for a list of one.
        if item.is_list and isinstance(value, int | float) and not isinstance(value, bool):
            value = [value]
        if value is None and item.default is None:
            continue
        arguments[name] = item.parse(f"{prefix}{name}", value)
    return cls(**arguments)
