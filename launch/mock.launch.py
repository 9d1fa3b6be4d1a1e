"""The robot without hardware: mock servos, mock motion capture and the four nodes.

ros2 launch snake_control mock.launch.py case:=3
ros2 service call /trajectory_generator/start std_srvs/srv/Trigger
"""

from collections.abc import Callable
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, RegisterEventHandler
from launch.event_handlers import OnProcessIO
from launch.events.process import ProcessIO
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile

# What the mock says when its port is there.
READY = "servos at"

NODES = ("mock_bus", "bus_driver", "pose_input", "scp_controller", "trajectory_generator")


def once_ready(action: Node) -> Callable[[ProcessIO], Node | None]:
    """Return what to do with a process's output: start ``action`` once it says that it is ready."""
    heard = ""

    def on_output(event: ProcessIO) -> Node | None:
        nonlocal heard
        if READY in heard:
            return None
        heard += event.text.decode(errors="replace")
        return action if READY in heard else None

    return on_output


def generate_launch_description() -> LaunchDescription:
    """Describe the mock's graph."""
    config = Path(get_package_share_directory("snake_control"), "config")
    parameters = [
        ParameterFile(LaunchConfiguration("params_file")),
        ParameterFile(str(config / "mock.yaml")),
        ParameterFile([str(config / "case_"), LaunchConfiguration("case"), ".yaml"]),
    ]
    nodes = {
        name: Node(
            package="snake_control",
            executable=name,
            name=name,
            namespace=LaunchConfiguration("namespace"),
            parameters=parameters,
            output="screen",
        )
        for name in NODES
    }
    driver = nodes.pop("bus_driver")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "case", default_value="3", choices=["1", "2", "3"], description="the paper's case"
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value=str(config / "paper_robot.yaml"),
                description="parameters of the robot; those of the mock and of the case follow",
            ),
            DeclareLaunchArgument(
                "namespace", default_value="", description="namespace of this robot"
            ),
            # The driver needs the port.
            RegisterEventHandler(
                OnProcessIO(target_action=nodes["mock_bus"], on_stderr=once_ready(driver))
            ),
            *nodes.values(),
        ]
    )
