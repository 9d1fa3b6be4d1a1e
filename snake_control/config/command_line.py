"""Which parameters a ROS command line gives to one node; the last one given wins.

rcl resolves by section instead: all files' ``/**`` sections and every ``-p`` first, then all
sections of the node. So a ``-p port:=...`` loses to an older file's section for the node, and a
later file's ``/**`` too. Users expect the order of the command line, as in ``load``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from snake_control.config.yaml_file import matches, read_sections, read_value
from snake_control.errors import ConfigFileError


def parameter_files(arguments: Sequence[str]) -> list[str]:
    """Return the files given with ``--params-file``, in order."""
    return [value for flag, value in _ros_options(arguments) if flag == "--params-file"]


def namespace_and_name(arguments: Sequence[str], name: str) -> tuple[str, str]:
    """Return a node's namespace and name after the remappings of its command line."""
    namespace = "/"
    for flag, value in _ros_options(arguments):
        if flag in ("-r", "--remap"):
            rule, _, replacement = value.partition(":=")
            if rule.rpartition(":")[2] == "__node":
                name = replacement
            elif rule.rpartition(":")[2] == "__ns":
                namespace = replacement
    return namespace, name


def parameters_of_node(arguments: Sequence[str], name: str) -> dict[str, Any]:
    """Return the parameters that a command line gives to a node, flat.

    Args:
        arguments: command line with ``--ros-args``.
        name: the node's name unless the command line renames it.

    Raises:
        ConfigFileError, ConfigError: as ``read_sections``; or a rule that is none.
    """
    namespace, name = namespace_and_name(arguments, name)
    full_name = f"{namespace.rstrip('/')}/{name}"
    found: dict[str, Any] = {}
    for flag, value in _ros_options(arguments):
        if flag == "--params-file":
            for pattern, parameters in read_sections(value):
                if matches(pattern, full_name):
                    found.update(parameters)
        elif flag in ("-p", "--param"):
            rule, assigned, text = value.partition(":=")
            if not assigned:
                raise ConfigFileError(f"-p {value}", "expected name:=value")
            node, _, parameter = rule.rpartition(":")
            if node in ("", name):
                found[parameter] = read_value(parameter, text)
    return found


def _ros_options(arguments: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield (flag, value) of every option between ``--ros-args`` and ``--``."""
    options = ("--params-file", "-p", "--param", "-r", "--remap")
    in_ros_arguments = False
    waiting = ""
    for argument in arguments:
        if waiting:
            yield waiting, argument
            waiting = ""
        elif argument == "--ros-args":
            in_ros_arguments = True
        elif argument == "--":
            in_ros_arguments = False
        elif in_ros_arguments and argument in options:
            waiting = argument
