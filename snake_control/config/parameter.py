"""Describes one configuration value so that YAML, ROS parameters and checks read the same thing."""

from __future__ import annotations

import array
import dataclasses
import math
import types
import typing
from collections.abc import Sequence
from typing import Any

from snake_control.errors import ConfigError

Scalar = bool | int | float | str


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One configuration value, as the field of a group declares it.

    Attributes:
        name: field name inside its group.
        kind: element type: ``bool``, ``int``, ``float`` or ``str``.
        is_list: whether the value is a list of ``kind``.
        default: value used when none is given; ``None`` if it follows from another field.
        doc: meaning and unit, one sentence.
        low, high: inclusive bounds of every element (numbers only).
        choices: allowed values of every element; empty if any.
        run_time: whether a node may change it while it runs.
    """

    name: str
    kind: type
    is_list: bool
    default: Any
    doc: str
    low: float
    high: float
    choices: tuple[Scalar, ...]
    run_time: bool

    def parse(self, field: str, value: object) -> Any:
        """Check ``value`` and return it in canonical form (lists become tuples).

        Args:
            field: dotted name for error messages.
            value: as YAML or rclpy delivers it.

        Raises:
            ConfigError: wrong type, out of range, not finite, or not among the choices.
        """
        if not self.is_list:
            return self._parse_element(field, value)
        # rclpy delivers array.array.
        if isinstance(value, str | bytes) or not isinstance(value, Sequence | array.array):
            raise ConfigError(field, value, f"give a list, each entry {self._kind_name()}")
        return tuple(
            self._parse_element(f"{field}[{i}]", element) for i, element in enumerate(value)
        )

    def _parse_element(self, field: str, value: object) -> Scalar:
        if self.kind is float and type(value) is int:
            value = float(value)
        if type(value) is not self.kind:
            raise ConfigError(field, value, f"give {self._kind_name()}")
        if self.kind is float and not math.isfinite(typing.cast(float, value)):
            raise ConfigError(field, value, "give a finite number")
        if self.kind in (int, float):
            number = typing.cast(float, value)
            if not self.low <= number <= self.high:
                raise ConfigError(field, value, f"allowed: {self._range_text()}")
        if self.choices and value not in self.choices:
            raise ConfigError(field, value, f"allowed: {', '.join(map(str, self.choices))}")
        return typing.cast(Scalar, value)

    def _kind_name(self) -> str:
        return {
            bool: "true or false",
            int: "an integer",
            float: "a number",
            str: "a text",
        }[self.kind]

    def _range_text(self) -> str:
        if math.isinf(self.high):
            return f"at least {self.low:g}"
        if math.isinf(self.low):
            return f"at most {self.high:g}"
        return f"{self.low:g} to {self.high:g}"


def parameter(
    default: Any,
    doc: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    choices: tuple[Scalar, ...] = (),
    run_time: bool = False,
) -> Any:
    """Declare a field of a configuration group; see ``Parameter`` for the arguments."""
    return dataclasses.field(
        default=default,
        metadata={
            "doc": doc,
            "low": low,
            "high": high,
            "choices": choices,
            "run_time": run_time,
        },
    )


def parameters(group: type) -> dict[str, Parameter]:
    """Return the parameters of a configuration group by name, in order of declaration.

    Fields that were not declared by ``parameter`` are none.
    """
    hints = typing.get_type_hints(group)
    found = {}
    for field in dataclasses.fields(group):
        if not field.metadata:
            continue
        kind = hints[field.name]
        if typing.get_origin(kind) in (typing.Union, types.UnionType):
            kind = next(arg for arg in typing.get_args(kind) if arg is not type(None))
        is_list = typing.get_origin(kind) is tuple
        if is_list:
            kind = typing.get_args(kind)[0]
        found[field.name] = Parameter(
            name=field.name,
            kind=kind,
            is_list=is_list,
            default=field.default,
            **field.metadata,
        )
    return found
