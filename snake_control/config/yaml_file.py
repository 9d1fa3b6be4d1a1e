"""Reads ROS parameter files the way rcl reads them, with errors that name a field."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from snake_control.errors import ConfigError, ConfigFileError


class _RclLoader(yaml.SafeLoader):
    """PyYAML follows YAML 1.1, where 1e-11 and 1.0e5 are texts; rcl reads them as doubles."""


_RclLoader.yaml_implicit_resolvers = {
    first: [(tag, regexp) for tag, regexp in resolvers if tag != "tag:yaml.org,2002:float"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_RclLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(
        r"""^[-+]?(?:(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?
             |[0-9]+[eE][-+]?[0-9]+
             |\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$""",
        re.VERBOSE,
    ),
    list("-+0123456789."),
)


def read_yaml(path: str | Path) -> Any:
    """Return what a YAML file holds, numbers read as rcl reads them; ``None`` if it is empty.

    Raises:
        ConfigFileError: the file is missing, is no text in UTF-8, or no YAML.
    """
    return parse_yaml(read_text(path), str(path))


def read_text(path: str | Path) -> str:
    """Return what a text file holds.

    Raises:
        ConfigFileError: the file is missing, or is no text in UTF-8.
    """
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigFileError(str(path), f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigFileError(str(path), "is no text in UTF-8") from error


def parse_yaml(text: str, name: str) -> Any:
    """Return what a text in YAML holds, numbers read as rcl reads them; ``None`` if it is empty.

    Args:
        text: the YAML.
        name: where it is from, for errors.

    Raises:
        ConfigFileError: it is no YAML.
    """
    try:
        return yaml.load(text, Loader=_RclLoader)
    # PyYAML lets errors of what it makes through, such as that of a month 13.
    except (yaml.YAMLError, ValueError) as error:
        raise ConfigFileError(name, f"is not valid YAML: {error}") from error


def read_sections(path: str | Path) -> list[tuple[str, dict[str, Any]]]:
    """Return the sections of a ROS parameter file as (node pattern, flat parameters).

    Nested maps are flattened with dots (``robot: {links: 12}`` becomes ``robot.links``).

    Raises:
        ConfigFileError: the file is missing, is no YAML, or has no ``ros__parameters``.
        ConfigError: a list that rcl would abort on: mixed types, empty, or of maps.
    """
    tree = read_yaml(path)
    if tree is None:
        return []
    if not isinstance(tree, Mapping):
        raise ConfigFileError(str(path), "holds no map; expected '/**: ros__parameters: ...'")
    return [
        (pattern, _flatten("", parameters)) for pattern, parameters in _sections(path, "", tree)
    ]


def read_value(field: str, text: str) -> Any:
    """Return the value of a ``-p name:=value`` rule.

    Raises:
        ConfigError: no YAML, or a list that rcl would abort on.
    """
    try:
        value = yaml.load(text, Loader=_RclLoader)
    except (yaml.YAMLError, ValueError) as error:
        raise ConfigError(field, text, "give a value in YAML") from error
    _check_as_rcl(field, value)
    return value


def _sections(
    path: str | Path, prefix: str, tree: Mapping[Any, Any]
) -> list[tuple[str, Mapping[str, Any]]]:
    found: list[tuple[str, Mapping[str, Any]]] = []
    for key, value in tree.items():
        pattern = f"{prefix}/{str(key).lstrip('/')}"
        if not isinstance(value, Mapping):
            raise ConfigFileError(
                str(path), f"'{key}' stands where a node name with 'ros__parameters:' is expected"
            )
        if "ros__parameters" in value:
            parameters = value["ros__parameters"]
            if not isinstance(parameters, Mapping):
                raise ConfigFileError(str(path), f"'{key}: ros__parameters' holds no map")
            found.append((pattern, parameters))
            value = {k: v for k, v in value.items() if k != "ros__parameters"}
        found.extend(_sections(path, pattern, value))
    return found


def _flatten(prefix: str, tree: Mapping[Any, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            flat.update(_flatten(f"{name}.", value))
        else:
            _check_as_rcl(name, value)
            flat[name] = value
    return flat


def _check_as_rcl(field: str, value: object) -> None:
    if value is None:
        raise ConfigError(field, value, "give a value, or remove the line")
    if not isinstance(value, list):
        return
    if not value:
        raise ConfigError(field, value, "ROS ignores an empty list; remove the line (or see docs)")
    kinds = {type(element) for element in value}
    if kinds & {dict, list}:
        raise ConfigError(field, value, "ROS parameters hold no lists of lists or maps")
    if kinds == {int, float}:
        raise ConfigError(field, value, "ROS refuses mixed lists: write all as decimals (0 as 0.0)")
    if len(kinds) > 1:
        raise ConfigError(field, value, "ROS refuses lists of mixed types")


def matches(pattern: str, node: str) -> bool:
    """Whether a section's pattern applies to the fully qualified node name, as in rcl.

    ``*`` stands for one name, ``**`` for any number of them.
    """
    regexp = ""
    for token in pattern.strip("/").split("/"):
        regexp += {"**": r"(?:/[^/]+)*", "*": r"/[^/]+"}.get(token, "/" + re.escape(token))
    return re.fullmatch(regexp, node) is not None
