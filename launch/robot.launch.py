"""The robot: its nodes; motion capture comes from elsewhere, on mocap/pose.

ros2 launch snake_control robot.launch.py port:=/dev/serial/by-id/...

Several at once, each in its namespace: namespace:=robot_1. record:=run.mcap records all topics.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from snake_control.config.namespaces import robot_parameters

NODES = ("bus_driver", "pose_input", "scp_controller", "trajectory_generator", "description")


def nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes; a port given as an argument wins over the file's."""
    namespace = LaunchConfiguration("namespace").perform(context)
    port = LaunchConfiguration("port").perform(context)
    record = LaunchConfiguration("record").perform(context)
    own: dict[str, dict[str, str]] = robot_parameters(namespace)
    own["bus_driver"] = {"port": port} if port else {}
    own["record"] = {"file": record}
    return [
        Node(
            package="snake_control",
            executable=name,
            # The name makes `own` more than a wildcard, which the file's entry would beat.
            name=name,
            namespace=namespace,
            parameters=[
                LaunchConfiguration("params_file"),
                *([own[name]] if own.get(name) else []),
            ],
            output="screen",
        )
        for name in (*NODES, *(("record",) if record else ()))
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
            DeclareLaunchArgument(
                "record", default_value="", description="MCAP file to make; empty: none"
            ),
            OpaqueFunction(function=nodes),
        ]
    )
