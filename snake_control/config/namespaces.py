"""What keeps robots in namespaces apart beyond the names of their topics."""

from __future__ import annotations

import re

# What the layouts in config/ show of one robot; /diagnostics is of the whole graph.
_TOPICS = (
    "bus_state",
    "controller_state",
    "head/odometry",
    "head/planned_path",
    "joint_states",
    "markers",
    "robot_description",
)
_TOPIC = re.compile(rf"(?<![\w/])/(?=(?:{'|'.join(_TOPICS)})\b)")


def robot_parameters(namespace: str) -> dict[str, dict[str, str]]:
    """Return parameters by node: the robot's frames, and a port of its own for the mock.

    Args:
        namespace: of the robot; empty or ``/`` for the only one, which needs none of this.
    """
    robot = namespace.strip("/")
    if not robot:
        return {}
    port = f"/tmp/snake_control_mock_bus_{robot.replace('/', '_')}"
    return {
        "mock_bus": {"port": port},
        "bus_driver": {"port": port},
        "pose_input": {"child_frame_id": f"{robot}/link_1"},
        "description": {"frame_prefix": f"{robot}/"},
    }


def layout_for(text: str, namespace: str) -> str:
    """Return the text of a layout (RViz, Foxglove, PlotJuggler) for the robot of a namespace."""
    robot = namespace.strip("/")
    if not robot:
        return text
    text = _TOPIC.sub(f"/{robot}/", text)
    # RViz puts the slash itself.
    text = text.replace('TF Prefix: ""', f'TF Prefix: "{robot}"')
    return text.replace('"framePrefix": ""', f'"framePrefix": "{robot}/"')
