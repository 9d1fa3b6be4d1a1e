"""Node ``description``: the robot as URDF on ``robot_description``, and its frames on ``/tf``.

For RViz and Foxglove. The frames come from ``head/odometry`` (``world`` to ``link_1``) and
``joint_states`` (from each link to the next), so that neither needs robot_state_publisher; where
that runs, ``transforms: head`` leaves the joints to it. Several robots share ``/tf``: give each a
``frame_prefix``, as robot_state_publisher does.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from snake_control.config import RobotConfig
from snake_control.model.link_frames import joint_quaternions
from snake_control.model.urdf import urdf
from snake_control.nodes import topics
from snake_control.nodes.conversions import (
    MessageError,
    array,
    joint_motion,
    quaternion,
    require_finite,
    require_frame,
    vector,
)
from snake_control.nodes.parameters import NodeParameters
from snake_control.nodes.process import run


class Description(Node):
    """Publishes the URDF once, latched, and a transform for each odometry and joint state."""

    def __init__(self, **overrides: Any) -> None:
        super().__init__("description", **overrides)
        config = NodeParameters(self, "description").config
        self._robot, self._own = config.robot, config.description
        t = topics.ROBOT_DESCRIPTION
        self._description = self.create_publisher(t.type, t.name, t.qos)
        self._description.publish(String(data=urdf(self._robot)))
        if self._own.transforms == "none":
            return
        if topics.TF is None:
            self.get_logger().warning(
                "no /tf: tf2_msgs is not installed; the links are on markers all the same"
            )
            return
        t = topics.TF
        self._tf = self.create_publisher(t.type, t.name, t.qos)
        t = topics.HEAD_ODOMETRY
        self.create_subscription(t.type, t.name, self._on_odometry, t.newest_only)
        if self._own.transforms == "all":
            t = topics.JOINT_STATES
            self.create_subscription(t.type, t.name, self._on_joint_states, t.newest_only)

    def _on_odometry(self, message: Odometry) -> None:
        try:
            transform = head_transform(message, self._own.frame_id, self._own.frame_prefix)
        except MessageError as error:
            self._ignore(topics.HEAD_ODOMETRY, error)
            return
        self._publish([transform])

    def _on_joint_states(self, message: JointState) -> None:
        try:
            transforms = joint_transforms(self._robot, message, self._own.frame_prefix)
        except MessageError as error:
            self._ignore(topics.JOINT_STATES, error)
            return
        self._publish(transforms)

    def _publish(self, transforms: list[TransformStamped]) -> None:
        assert topics.TF is not None
        self._tf.publish(topics.TF.type(transforms=transforms))

    def _ignore(self, topic: topics.Topic, error: MessageError) -> None:
        self.get_logger().warning(f"{topic.name} ignored: {error}", throttle_duration_sec=1.0)

    def close(self) -> None:
        """Nothing moves because of this node."""


def head_transform(message: Odometry, frame_id: str, frame_prefix: str) -> TransformStamped:
    """Return the transform from the world to the head's frame ``link_1``.

    Raises:
        MessageError: another frame than ``frame_id``, or not finite.
    """
    require_frame(message, frame_id)
    pose = message.pose.pose
    require_finite("position", array(pose.position))
    require_finite("orientation", array(pose.orientation))
    transform = TransformStamped(header=message.header, child_frame_id=f"{frame_prefix}link_1")
    transform.transform.translation = vector(array(pose.position))
    transform.transform.rotation = pose.orientation
    return transform


def joint_transforms(
    robot: RobotConfig, message: JointState, frame_prefix: str
) -> list[TransformStamped]:
    """Return the transforms from each link's frame to the next one's.

    Raises:
        MessageError: as ``joint_motion``.
    """
    phi, _ = joint_motion(message, robot.joint_names)
    rear = vector(np.array([-2.0 * robot.half_length_m, 0.0, 0.0]))
    transforms = []
    for link, turn in enumerate(joint_quaternions(robot, phi), start=1):
        transform = TransformStamped(child_frame_id=f"{frame_prefix}link_{link + 1}")
        transform.header.stamp = message.header.stamp
        transform.header.frame_id = f"{frame_prefix}link_{link}"
        transform.transform.translation = rear
        transform.transform.rotation = quaternion(turn)
        transforms.append(transform)
    return transforms


def main() -> int:
    """Run the node."""
    return run(Description, "description")


if __name__ == "__main__":
    raise SystemExit(main())
