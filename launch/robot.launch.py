"""The robot: the four nodes; motion capture comes from elsewhere, on mocap/pose.

ros2 launch snake_control robot.launch.py port:=/dev/serial/by-id/...
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

NODES = ("bus_driver", "pose_input", "scp_controller", "trajectory_generator")


def nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes; a port given as an argument wins over the file's."""
    port = LaunchConfiguration("port").perform(context)
    own = {"bus_driver": [{"port": port}] if port else []}
    return [
        Node(
            package="snake_control",
            executable=name,
            # The name makes `own` more than a wildcard, which the file's entry would beat.
            name=name,
            namespace=LaunchConfiguration("namespace"),
            parameters=[LaunchConfiguration("params_file"), *own.get(name, [])],
            output="screen",
        )
        for name in NODES
    ]


def generate_launch_description() -> LaunchDescription:
    """Describe the robot's graph."""
    config = Path(get_package_share_directory("snake_control"), "config")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file",
                default_value=str(config / "paper_robot.yaml"),
                description="parameters of the robot",
            ),
            DeclareLaunchArgument(
                "port", default_value="", description="serial port; empty: the one of params_file"
            ),
            DeclareLaunchArgument(
                "namespace", default_value="", description="namespace of this robot"
            ),
            OpaqueFunction(function=nodes),
        ]
    )
