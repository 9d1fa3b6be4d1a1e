"""From the name of a sub-task in the configuration to an object."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.sub_tasks.fall import Fall
from snake_control.control.sub_tasks.guard import GuardedSubTask
from snake_control.control.sub_tasks.joint_range import JointRange
from snake_control.control.sub_tasks.log_manipulability import LogManipulability
from snake_control.control.sub_tasks.log_singularity import LogSingularity
from snake_control.control.sub_tasks.manipulability import Manipulability
from snake_control.control.sub_tasks.obstacles import Obstacles
from snake_control.control.sub_tasks.relative_fall import RelativeFall
from snake_control.control.sub_tasks.singularity import Singularity
from snake_control.control.sub_tasks.sub_task import SubTask
from snake_control.control.sub_tasks.wheel_axes import WheelAxes
from snake_control.errors import ConfigError, SnakeError, SubTaskError
from snake_control.model.floor import head_pose_on_floor
from snake_control.model.posture import Posture

BUILT_IN: Mapping[str, type[SubTask]] = MappingProxyType(
    {
        "manipulability": Manipulability,
        "log_manipulability": LogManipulability,
        "singularity": Singularity,
        "log_singularity": LogSingularity,
        "wheel_axes": WheelAxes,
        "fall": Fall,
        "relative_fall": RelativeFall,
        "joint_range": JointRange,
        "obstacles": Obstacles,
    }
)
"""Sub-tasks of this package by their names; the configuration says which part may have which."""


def make(field: str, name: str, robot: RobotConfig, controller: ControllerConfig) -> SubTask:
    """Return the sub-task of a name for one robot.

    Args:
        field: where the name was given, for errors.
        name: one of ``BUILT_IN``, or ``package.module:Class`` of somebody else's.
        robot, controller: what the sub-task is made for.

    Raises:
        ConfigError: there is no such module or class, it is no ``SubTask``, it cannot be made, or
            its answer for the start posture has the wrong form. Later answers of a class of
            somebody else's raise ``SubTaskError`` where they are no answers.
    """
    if name in BUILT_IN:
        return BUILT_IN[name](robot, controller)
    found = _imported(field, name)
    try:
        task = GuardedSubTask(name, found(robot, controller), robot, controller)
    except ConfigError:
        raise
    # Foreign code may raise anything; its own error stays attached.
    except Exception as error:
        raise ConfigError(field, name, f"it fails: {type(error).__name__}: {error}") from error
    try:
        _try(task, robot)
    except SubTaskError as error:
        raise ConfigError(field, name, f"{error.method} fails: {error.reason}") from error
    return task


def _imported(field: str, name: str) -> type[SubTask]:
    module_name, _, class_name = name.partition(":")
    try:
        module = importlib.import_module(module_name)
    # The same: a module runs whatever it holds.
    except Exception as error:
        raise ConfigError(
            field, name, f"cannot import {module_name}: {type(error).__name__}: {error}"
        ) from error
    found = getattr(module, class_name, None)
    if found is None:
        raise ConfigError(field, name, f"{module_name} has no class {class_name}")
    if not (isinstance(found, type) and issubclass(found, SubTask)):
        raise ConfigError(
            field, name, f"{class_name} must derive from snake_control.control.sub_tasks.SubTask"
        )
    if inspect.isabstract(found):
        missing = ", ".join(sorted(found.__abstractmethods__))
        raise ConfigError(field, name, f"{class_name} lacks {missing}")
    return found


def _try(task: SubTask, robot: RobotConfig) -> None:
    """Ask for every answer once, so that a wrong form shows before the robot moves.

    Raises:
        SubTaskError: an answer fails or has the wrong form.
    """
    phi = np.array(robot.start_joint_angles_rad)
    q = np.concatenate((head_pose_on_floor(robot, phi, np.zeros(3)), phi))
    posture = Posture(robot, q)
    for answer in (task.value, task.gradient, task.by_head, task.by_base):
        try:
            answer(posture)
        except SubTaskError:
            raise
        except SnakeError:
            # A start posture may be singular; that says nothing about the sub-task.
            continue
