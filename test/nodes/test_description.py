"""The robot's description and frames, as RViz and Foxglove read them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from snake_control.config import RobotConfig
from snake_control.model.link_frames import link_frames
from snake_control.model.urdf import urdf
from snake_control.nodes import topics
from snake_control.nodes.conversions import MessageError, array, header
from snake_control.nodes.description import head_transform, joint_transforms
from support.controller_rig import ControllerRig
from support.graph import CONFIG, Graph

ROBOT = RobotConfig()


def chained(transforms) -> dict[str, tuple[np.ndarray, Rotation]]:
    """Where each frame stands in the world, by going along the transforms."""
    frames = {"world": (np.zeros(3), Rotation.identity())}
    for t in transforms:
        origin, rotation = frames[t.header.frame_id]
        frames[t.child_frame_id] = (
            origin + rotation.apply(array(t.transform.translation)),
            rotation * Rotation.from_quat(array(t.transform.rotation)),
        )
    return frames


def assert_frames_of_the_model(frames, q, prefix: str) -> None:
    origins, quaternions = link_frames(ROBOT, q)
    for link, (origin, xyzw) in enumerate(zip(origins, quaternions, strict=True), start=1):
        found_origin, found_rotation = frames[f"{prefix}link_{link}"]
        np.testing.assert_allclose(found_origin, origin, atol=1e-9)
        assert (found_rotation.inv() * Rotation.from_quat(xyzw)).magnitude() < 1e-9


def test_latched_description_and_frames_of_a_robot():
    with Graph() as graph:
        process = graph.start("description", params_files=[CONFIG / "paper_robot.yaml"])
        rig = ControllerRig(graph)
        # Latched: whoever comes later gets it, too.
        graph.wait_for(lambda: graph.node.count_publishers("robot_description"), 20.0, "the node")
        for _ in range(2):
            description = graph.subscribe(topics.ROBOT_DESCRIPTION)
            graph.wait_for(lambda d=description: d.last, 20.0, "the description")
            assert description.last.data == urdf(ROBOT)
        # The rig's own messages, with joints in another order and one that is not ours.
        sent: JointState = rig.joint_states
        head = head_transform(rig.head, "world", "robot_1/")
        frames = chained([head, *joint_transforms(ROBOT, sent, "robot_1/")])
        assert len(frames) == 1 + ROBOT.links
        assert_frames_of_the_model(frames, np.concatenate([rig.w, rig.phi]), "robot_1/")
        if topics.TF is None:
            graph.wait_for(lambda: "no /tf: tf2_msgs" in process.output(), 10.0, "the warning")
        else:
            tf = graph.subscribe(topics.TF)
            graph.wait_for(lambda: len(tf.messages) > 20, 20.0, "transforms")
            newest = {t.child_frame_id: t for m in tf.messages for t in m.transforms}
            order = [newest[f"link_{link}"] for link in range(1, ROBOT.links + 1)]
            assert_frames_of_the_model(chained(order), np.concatenate([rig.w, rig.phi]), "")
            assert order[0].header.stamp.sec > 0
        process.interrupt()
        assert process.wait(20.0) == 0, process.report()


def test_what_is_not_finite_or_in_another_frame_gives_no_transform():
    head = Odometry(header=header(0, "world"), child_frame_id="link_1")
    with pytest.raises(MessageError, match="its frame is 'world', expected 'map'"):
        head_transform(head, "map", "")
    head.pose.pose.position.y = math.nan
    with pytest.raises(MessageError, match="position is not finite"):
        head_transform(head, "world", "")
    joints = JointState(
        name=list(ROBOT.joint_names), position=[0.1] * ROBOT.joints, velocity=[0.0] * ROBOT.joints
    )
    joints.position[2] = math.inf
    with pytest.raises(MessageError, match="position of joint_3 is inf"):
        joint_transforms(ROBOT, joints, "")
