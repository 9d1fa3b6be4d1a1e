"""RViz with the robot, what it stands on, and where it shall go (apt: ros-jazzy-rviz2).

ros2 launch snake_control view.launch.py namespace:=robot_1
"""

import tempfile
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from snake_control.config.namespaces import layout_for

NODES = ("rviz2",)


def nodes(context: LaunchContext) -> list[Node]:
    """Return RViz with the layout of one robot."""
    namespace = LaunchConfiguration("namespace").perform(context)
    layout = Path(get_package_share_directory("snake_control"), "config", "snake.rviz")
    with tempfile.NamedTemporaryFile("w", suffix=".rviz", delete=False) as file:
        file.write(layout_for(layout.read_text(encoding="utf-8"), namespace))
    return [
        Node(
            package=name,
            executable=name,
            name=name,
            namespace=namespace,
            arguments=["-d", file.name],
            output="screen",
        )
        for name in NODES
    ]


def generate_launch_description() -> LaunchDescription:
    """Describe RViz."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="", description="of the robot"),
            OpaqueFunction(function=nodes),
        ]
    )
