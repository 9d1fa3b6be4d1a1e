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
from snake_control.config.loader import (
    Config,
    from_parameters,
    is_ros_parameter,
    known_parameters,
    load,
    refuse_unknown,
)
from snake_control.config.nodes import (
    BusDriverConfig,
    MockBusConfig,
    PoseInputConfig,
    ScpControllerConfig,
    TrajectoryGeneratorConfig,
)
from snake_control.config.parameter import Parameter
from snake_control.config.robot import CASES, ControllerConfig, RobotConfig, ServosConfig
from snake_control.config.yaml_file import matches, read_sections

__all__ = [
    "CASES",
    "BusDriverConfig",
    "Config",
    "ControllerConfig",
    "MockBusConfig",
    "Parameter",
    "PoseInputConfig",
    "RobotConfig",
    "ScpControllerConfig",
    "ServosConfig",
    "TrajectoryGeneratorConfig",
    "from_parameters",
    "is_ros_parameter",
    "known_parameters",
    "load",
    "matches",
    "namespace_and_name",
    "parameter_files",
    "parameters_of_node",
    "read_sections",
    "refuse_unknown",
]
