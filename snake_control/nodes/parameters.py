"""Declares the configuration as ROS parameters of a node and keeps one validated snapshot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterType,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from snake_control.config import (
    Config,
    Parameter,
    from_parameters,
    is_ros_parameter,
    known_parameters,
    node_kinds,
    refuse_unknown,
)
from snake_control.errors import ConfigError

_ROS_TYPES = {
    bool: ParameterType.PARAMETER_BOOL,
    int: ParameterType.PARAMETER_INTEGER,
    str: ParameterType.PARAMETER_STRING,
}
_NONE: dict[type, Any] = {int: 0, float: 0.0, str: "none"}


class NodeParameters:
    """The configuration of one node, as ROS parameters.

    The node must have been made with ``automatically_declare_parameters_from_overrides=True``:
    that is how unknown parameters come to light and are refused.

    Attributes:
        config: the snapshot in force; replaced as a whole when a parameter changes.
        prepared: what ``prepare`` made of it.
    """

    def __init__(
        self,
        node: Node,
        kind: str,
        on_change: Callable[[Config], None] | None = None,
        prepare: Callable[[Config], Any] = lambda config: None,
    ) -> None:
        """Declare all parameters of a kind of node and validate what was given.

        Args:
            node: the node to declare them on.
            kind: ``bus_driver``, ``pose_input``, ... (the node itself may be renamed).
            on_change: called with the new snapshot after a run-time change was accepted.
            prepare: makes what the node needs of a snapshot; where it raises ConfigError, a change
                is refused and everything stays as it was.

        Raises:
            ConfigError: names the parameter, its value and what is allowed.
        """
        self._node = node
        self._kind = kind
        self._on_change = on_change
        self._prepare = prepare
        self._following = False
        self._checked: tuple[Config, Any] | None = None
        given = {n: p.value for n, p in node.get_parameters_by_prefix("").items()}
        # A file may serve all nodes through one /** section.
        self._known = known_parameters((kind,), given)
        known_to_any = known_parameters(node_kinds(), given)
        for name, value in given.items():
            if is_ros_parameter(name):
                continue
            refuse_unknown(name, value, known_to_any)
            if name not in self._known:
                node.undeclare_parameter(name)
        self._explicit = {name: value for name, value in given.items() if name in self._known}
        self.config = from_parameters(kind, self._explicit)
        self.prepared = prepare(self.config)
        for name, item in self._known.items():
            if name in given:
                node.set_descriptor(name, _descriptor(item))
            else:
                node.declare_parameter(name, self._effective(name), _descriptor(item))
        node.add_on_set_parameters_callback(self._check_change)
        node.add_post_set_parameters_callback(self._take_change)

    def _effective(self, name: str) -> Any:
        """Value in force of a parameter nobody gave."""
        item = self._known[name]
        value = item.default
        if value is None:
            group, _, field = name.rpartition(".")
            value = getattr(getattr(self.config, group), field)
        if not item.is_list:
            return value
        # A ROS parameter holds no empty list.
        return list(value) or [_NONE[item.kind]]

    def _check_change(self, changed: Iterable[RosParameter]) -> SetParametersResult:
        if self._following:
            return SetParametersResult(successful=True)
        values = self._ours(changed)
        try:
            config = from_parameters(self._kind, self._explicit | values)
            self._checked = config, self._prepare(config)
        except ConfigError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _take_change(self, changed: Iterable[RosParameter]) -> None:
        values = self._ours(changed)
        if not values or self._following:
            return
        assert self._checked is not None
        # What was checked is what is taken: files that it names may have changed since.
        self.config, self.prepared = self._checked
        self._explicit |= values
        if any(name.startswith("controller.") for name in values):
            self._follow()
        if self._on_change is not None:
            self._on_change(self.config)

    def _follow(self) -> None:
        """Show what follows from a change, without making it explicit."""
        followers = [
            RosParameter(name, value=self._effective(name))
            for name, item in self._known.items()
            if item.default is None and name not in self._explicit
        ]
        self._following = True
        try:
            self._node.set_parameters(followers)
        finally:
            self._following = False

    def _ours(self, changed: Iterable[RosParameter]) -> dict[str, Any]:
        return {p.name: p.value for p in changed if p.name in self._known}


def _descriptor(item: Parameter) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        name=item.name,
        description=item.doc,
        read_only=not item.run_time,
        # A whole number where a decimal is meant, or one value for a list, is checked by us.
        dynamic_typing=item.kind is float or item.is_list,
    )
    if not descriptor.dynamic_typing:
        descriptor.type = _ROS_TYPES[item.kind]
    if item.choices:
        descriptor.additional_constraints = "one of: " + ", ".join(map(str, item.choices))
    elif not item.is_list and item.kind is int and not math.isinf(item.low):
        high = int(item.high) if not math.isinf(item.high) else 2**31 - 1
        descriptor.integer_range = [IntegerRange(from_value=int(item.low), to_value=high, step=0)]
    elif not item.is_list and item.kind is float and not math.isinf(item.low):
        high_value = item.high if not math.isinf(item.high) else 1e308
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=item.low, to_value=high_value, step=0.0)
        ]
    return descriptor
