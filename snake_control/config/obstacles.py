"""Obstacles on the floor: circles in a file of their own, since ROS parameters hold no maps."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from snake_control.config.parameter import parameter, parameters
from snake_control.config.yaml_file import read_yaml
from snake_control.errors import ConfigError, ConfigFileError


@dataclasses.dataclass(frozen=True)
class Circle:
    """A round obstacle, in the frame of head pose and reference."""

    x_m: float = parameter(None, "x of the centre [m]", low=-1e6, high=1e6)
    y_m: float = parameter(None, "y of the centre [m]", low=-1e6, high=1e6)
    radius_m: float = parameter(None, "radius [m]", low=1e-6, high=1e6)


def read_obstacles(field: str, path: str) -> tuple[Circle, ...]:
    """Return the circles of a file: a YAML list of {x_m, y_m, radius_m}.

    Args:
        field: which parameter names the file, for errors.
        path: the file, absolute or from where the process was started.

    Raises:
        ConfigError: the file cannot be read or is no such list; the message names the obstacle.
    """
    try:
        found = read_yaml(path)
    except ConfigFileError as error:
        raise ConfigError(field, path, f"give a readable YAML file; {error}") from error
    if not isinstance(found, list):
        raise ConfigError(field, path, "the file must hold a list of {x_m, y_m, radius_m}")
    return tuple(_circle(field, path, i, entry) for i, entry in enumerate(found, start=1))


def _circle(field: str, path: str, number: int, entry: object) -> Circle:
    known = parameters(Circle)
    if not isinstance(entry, Mapping) or set(entry) != set(known):
        raise ConfigError(
            field, path, f"obstacle {number} is {entry!r}; give x_m, y_m and radius_m, no more"
        )
    try:
        values = {name: item.parse(name, entry[name]) for name, item in known.items()}
    except ConfigError as error:
        raise ConfigError(field, path, f"obstacle {number}: {error}") from error
    return Circle(**values)
