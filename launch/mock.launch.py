"""The robot without hardware: mock servos, mock motion capture and the four nodes.

ros2 launch snake_control mock.launch.py case:=3
ros2 service call /trajectory_generator/start std_srvs/srv/Trigger
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, RegisterEventHandler
from launch.event_handlers import OnProcessIO
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile

NODES = ("mock_bus", "bus_driver", "pose_input", "scp_controller", "trajectory_generator")


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
            # The driver needs the port, which is there when the mock has said so.
            RegisterEventHandler(
                OnProcessIO(
                    target_action=nodes["mock_bus"],
                    on_stderr=lambda _: driver,
                    handle_once=True,
                )
            ),
            *nodes.values(),
        ]
    )
