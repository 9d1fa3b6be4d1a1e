"""Turns parameter files, or the parameters of a node, into one validated frozen snapshot."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from snake_control.config.controller import ControllerConfig
from snake_control.config.nodes import (
    BusDriverConfig,
    DescriptionConfig,
    KeyboardTeleopConfig,
    MockBusConfig,
    RecordConfig,
    ScpControllerConfig,
    TrajectoryGeneratorConfig,
)
from snake_control.config.parameter import Parameter, parameters
from snake_control.config.pose_input import PoseInputConfig
from snake_control.config.postures import (
    GROUP,
    PosturesConfig,
    posture_parameter,
    postures_from,
)
from snake_control.config.robot import RobotConfig, ServosConfig
from snake_control.config.supervisor import SupervisorConfig
from snake_control.config.yaml_file import matches, read_sections
from snake_control.errors import ConfigError

_SHARED_GROUPS: dict[str, type] = {
    "robot": RobotConfig,
    "servos": ServosConfig,
    "controller": ControllerConfig,
    "supervisor": SupervisorConfig,
}
_NODE_GROUPS: dict[str, type] = {
    "bus_driver": BusDriverConfig,
    "pose_input": PoseInputConfig,
    "scp_controller": ScpControllerConfig,
    "trajectory_generator": TrajectoryGeneratorConfig,
    "keyboard_teleop": KeyboardTeleopConfig,
    "description": DescriptionConfig,
    "record": RecordConfig,
    "mock_bus": MockBusConfig,
}
_SHARED_GROUPS_OF_NODE: dict[str, tuple[str, ...]] = {
    "bus_driver": ("robot", "servos", GROUP),
    "pose_input": ("robot",),
    "scp_controller": ("robot", "controller", "supervisor", GROUP),
    "trajectory_generator": ("robot", "controller", "supervisor"),
    "keyboard_teleop": (),
    "description": ("robot",),
    "record": (),
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
    supervisor: SupervisorConfig
    postures: PosturesConfig
    bus_driver: BusDriverConfig
    pose_input: PoseInputConfig
    scp_controller: ScpControllerConfig
    trajectory_generator: TrajectoryGeneratorConfig
    keyboard_teleop: KeyboardTeleopConfig
    description: DescriptionConfig
    record: RecordConfig
    mock_bus: MockBusConfig


def load(
    *paths: str | Path, namespace: str = "/", names: Mapping[str, str] | None = None
) -> Config:
    """Read parameter files for one robot, later ones winning over earlier ones.

    Sections that several kinds of nodes match (``/**``) may hold the shared groups ``robot``,
    ``servos``, ``controller``, ``supervisor`` and ``postures``, and any node's own parameters; a
    section of one node holds what that node knows. Sections of other namespaces and of foreign
    nodes are left alone.

    Args:
        paths: ROS parameter files.
        namespace: the robot's namespace.
        names: names of renamed nodes, by kind (``{"bus_driver": "left_driver"}``).

    Raises:
        ConfigFileError: a file that cannot be read or is no ROS parameter file.
        ConfigError: a value that is unknown, missing, of the wrong type, or not allowed.
    """
    full_names = {
        kind: f"{namespace.rstrip('/')}/{(names or {}).get(kind, kind)}" for kind in _NODE_GROUPS
    }
    shared: dict[str, Any] = {}
    own: dict[str, dict[str, Any]] = {kind: {} for kind in _NODE_GROUPS}
    for path in paths:
        for pattern, values in read_sections(path):
            kinds = [kind for kind, name in full_names.items() if matches(pattern, name)]
            if not kinds:
                _refuse_misspelt(pattern)
                continue
            known = known_parameters(kinds, values)
            for field, value in values.items():
                if not is_ros_parameter(field):
                    refuse_unknown(field, value, known)
                if _is_shared(field):
                    shared[field] = value
                for kind in kinds:
                    if field in known_parameters((kind,)):
                        own[kind][field] = value
    config = _build(shared, own)
    config.servos.check_reach(config.robot)
    _check_rates(config)
    return config


def from_parameters(node: str, values: Mapping[str, Any]) -> Config:
    """Build a snapshot from the parameters of one node; groups it does not know keep defaults.

    Args:
        node: node kind (``bus_driver``, ...), not its possibly remapped name.
        values: flat parameter names (``robot.links``) and values.

    Raises:
        ConfigError: as ``load``.
    """
    known = known_parameters((node,), values)
    for field, value in values.items():
        if not is_ros_parameter(field):
            refuse_unknown(field, value, known)
    shared = {f: v for f, v in values.items() if _is_shared(f)}
    own = {name: dict(values) if name == node else {} for name in _NODE_GROUPS}
    config = _build(shared, own)
    if "servos" in _SHARED_GROUPS_OF_NODE[node]:
        config.servos.check_reach(config.robot)
    return config


def known_parameters(nodes: Iterable[str], given: Iterable[str] = ()) -> dict[str, Parameter]:
    """Return what the given kinds of nodes declare: flat name to description, in file order.

    Args:
        nodes: kinds of nodes.
        given: fields that are given; those of a group whose names are free are known, too.

    Raises:
        ConfigError: such a name is none.
    """
    known: dict[str, Parameter] = {}
    groups = [group for node in nodes for group in _SHARED_GROUPS_OF_NODE[node]]
    for group in groups:
        if group != GROUP:
            for name, item in parameters(_SHARED_GROUPS[group]).items():
                known[f"{group}.{name}"] = item
    if GROUP in groups:
        for field in given:
            posture = posture_parameter(field)
            if posture is not None:
                known[field] = posture
    for node in nodes:
        known.update(parameters(_NODE_GROUPS[node]))
    return known


def node_kinds() -> tuple[str, ...]:
    """Return the kinds of nodes that have parameters."""
    return tuple(_NODE_GROUPS)


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


def _is_shared(field: str) -> bool:
    group = field.partition(".")[0]
    return group in _SHARED_GROUPS or group == GROUP


def _refuse_misspelt(pattern: str) -> None:
    """Refuse a section whose node name is one letter off one of ours; others are foreign."""
    name = pattern.rpartition("/")[2]
    for kind in _NODE_GROUPS:
        if name != kind and _one_letter_apart(name, kind):
            raise ConfigError(pattern, "ros__parameters", f"no such node; did you mean {kind}?")


def _one_letter_apart(a: str, b: str) -> bool:
    """Whether one letter was added, left out or changed, or two were swapped."""
    front = 0
    while front < min(len(a), len(b)) and a[front] == b[front]:
        front += 1
    rest_a, rest_b = a[front:], b[front:]
    return (
        rest_a[1:] == rest_b
        or rest_a == rest_b[1:]
        or rest_a[1:] == rest_b[1:]
        or (rest_a[:2] == rest_b[:2][::-1] and rest_a[2:] == rest_b[2:])
    )


def _check_rates(config: Config) -> None:
    """Check that every sender is quick enough for whoever waits for it, one message lost included.

    Raises:
        ConfigError: names the sender's rate or delay.
    """
    mock, controller = config.mock_bus, config.scp_controller
    pairs = (
        ("scp_controller: rate_hz", controller.rate_hz, config.bus_driver.command_timeout_s),
        ("bus_driver: rate_hz", config.bus_driver.rate_hz, controller.joint_states_timeout_s),
        (
            "trajectory_generator: rate_hz",
            config.trajectory_generator.rate_hz,
            controller.reference_timeout_s,
        ),
        ("pose_input: max_rate_hz", config.pose_input.max_rate_hz, controller.head_timeout_s),
    )
    for field, rate_hz, timeout_s in pairs:
        if 2.0 / rate_hz > timeout_s:
            raise ConfigError(
                field, rate_hz, f"at least {2.0 / timeout_s:g}: the receiver waits {timeout_s:g} s"
            )
    timeout_s = min(controller.head_timeout_s, config.pose_input.timeout_s)
    latest_s = timeout_s - 2.0 / mock.mocap_rate_hz
    if mock.mocap_delay_s > latest_s:
        raise ConfigError(
            "mock_bus: mocap_delay_s",
            mock.mocap_delay_s,
            f"at most {latest_s:.3g} at {mock.mocap_rate_hz:g} poses a second: head poses would be "
            f"older than {timeout_s:g} s",
        )


def _build(shared: Mapping[str, Any], own: Mapping[str, Mapping[str, Any]]) -> Config:
    groups: dict[str, Any] = {}
    for group, cls in _SHARED_GROUPS.items():
        prefix = f"{group}."
        values = {f[len(prefix) :]: v for f, v in shared.items() if f.startswith(prefix)}
        groups[group] = _group(cls, prefix, values)
    robot: RobotConfig = groups["robot"]
    groups["servos"] = ServosConfig.for_joints(groups["servos"], robot.joints)
    groups["controller"] = ControllerConfig.for_scps(groups["controller"], len(robot.scp_joints))
    groups[GROUP] = postures_from(
        robot, {f: v for f, v in shared.items() if f.partition(".")[0] == GROUP}
    )
    for node, cls in _NODE_GROUPS.items():
        names = parameters(cls)
        groups[node] = _group(cls, "", {f: v for f, v in own[node].items() if f in names})
    groups["bus_driver"] = groups["bus_driver"].for_robot(robot, groups[GROUP])
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
