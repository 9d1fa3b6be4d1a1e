"""The robot without hardware: mock servos, mock motion capture and the nodes.

ros2 launch snake_control mock.launch.py case:=3
ros2 service call /trajectory_generator/start std_srvs/srv/Trigger

Several at once, each in its namespace: namespace:=robot_1. record:=run.mcap records all topics.
"""

from collections.abc import Callable
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessIO
from launch.events.process import ProcessIO
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile

from snake_control.config.namespaces import robot_parameters

# What the mock says when its port is there.
READY = "servos at"

NODES = (
    "mock_bus",
    "bus_driver",
    "pose_input",
    "scp_controller",
    "trajectory_generator",
    "description",
)


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


def nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return the nodes; the driver starts when the mock's port is there."""
    config = Path(get_package_share_directory("snake_control"), "config")
    namespace = LaunchConfiguration("namespace").perform(context)
    record = LaunchConfiguration("record").perform(context)
    own: dict[str, dict[str, str]] = robot_parameters(namespace)
    own["record"] = {"file": record}
    files = [
        ParameterFile(LaunchConfiguration("params_file")),
        ParameterFile(str(config / "mock.yaml")),
        ParameterFile([str(config / "case_"), LaunchConfiguration("case"), ".yaml"]),
    ]
    started = {
        name: Node(
            package="snake_control",
            executable=name,
            name=name,
            namespace=namespace,
            parameters=[*files, *([own[name]] if name in own else [])],
            output="screen",
        )
        for name in (*NODES, *(("record",) if record else ()))
    }
    driver = started.pop("bus_driver")
    ready = OnProcessIO(target_action=started["mock_bus"], on_stderr=once_ready(driver))
    return [RegisterEventHandler(ready), *started.values()]


def generate_launch_description() -> LaunchDescription:
    """Describe the mock's graph."""
    config = Path(get_package_share_directory("snake_control"), "config")
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
            DeclareLaunchArgument(
                "record", default_value="", description="MCAP file to make; empty: none"
            ),
            OpaqueFunction(function=nodes),
        ]
    )
