"""Configuration: one YAML in ROS parameter form, one loader for nodes and for plain Python.

from snake_control.config import load
config = load("config/paper_robot.yaml", "config/mock.yaml")
config.robot.links
"""

from snake_control.config.command_line import (
    namespace_and_name,
    parameter_files,
    parameters_of_node,
)
from snake_control.config.controller import ControllerConfig
from snake_control.config.loader import (
    Config,
    from_parameters,
    is_ros_parameter,
    known_parameters,
    load,
    node_kinds,
    refuse_unknown,
)
from snake_control.config.nodes import (
    BusDriverConfig,
    KeyboardTeleopConfig,
    MockBusConfig,
    ScpControllerConfig,
    TrajectoryGeneratorConfig,
)
from snake_control.config.obstacles import Circle
from snake_control.config.parameter import Parameter
from snake_control.config.pose_input import PoseInputConfig
from snake_control.config.postures import PosturesConfig
from snake_control.config.presets import PRESETS
from snake_control.config.robot import RobotConfig, ServosConfig
from snake_control.config.sub_tasks import BASE_SUB_TASKS, HEAD_SUB_TASKS
from snake_control.config.supervisor import SupervisorConfig
from snake_control.config.yaml_file import matches, read_sections

__all__ = [
    "BASE_SUB_TASKS",
    "HEAD_SUB_TASKS",
    "PRESETS",
    "BusDriverConfig",
    "Circle",
    "Config",
    "ControllerConfig",
    "KeyboardTeleopConfig",
    "MockBusConfig",
    "Parameter",
    "PoseInputConfig",
    "PosturesConfig",
    "RobotConfig",
    "ScpControllerConfig",
    "ServosConfig",
    "SupervisorConfig",
    "TrajectoryGeneratorConfig",
    "from_parameters",
    "is_ros_parameter",
    "known_parameters",
    "load",
    "matches",
    "namespace_and_name",
    "node_kinds",
    "parameter_files",
    "parameters_of_node",
    "read_sections",
    "refuse_unknown",
]
