"""A client of the action ``follow_head_trajectory`` beside all nodes and the mock robot."""

from __future__ import annotations

import numpy as np
from rclpy.action import ActionClient
from snake_interfaces.action import FollowHeadTrajectory

from snake_control.nodes import topics
from snake_control.nodes.conversions import pose_message
from support.whole_graph import WholeGraph


class HeadActionClient:
    """Sends goals and keeps the feedback."""

    def __init__(self, robot: WholeGraph) -> None:
        self.robot, self.graph = robot, robot.graph
        action = topics.FOLLOW_HEAD_TRAJECTORY
        self._client = ActionClient(self.graph.node, action.type, action.name)
        self.graph.wait_for(self._client.server_is_ready, 30.0, "the action server")
        self.feedback: list = []

    def poses(self, *ways: tuple[float, ...]) -> list:
        """Poses by their distance from where the head is now."""
        return [pose_message(self.robot.w + np.array(way)) for way in ways]

    def send(self, poses, **more):
        """Send a goal; return its handle."""
        goal = FollowHeadTrajectory.Goal(poses=poses, **more)
        goal.header.frame_id = more.get("header") or "world"
        sent = self._client.send_goal_async(
            goal, feedback_callback=lambda m: self.feedback.append(m.feedback)
        )
        self.graph.wait_for(sent.done, 20.0, "acceptance")
        handle = sent.result()
        assert handle.accepted
        self._result = handle.get_result_async()
        return handle

    def result(self, timeout_s: float = 60.0):
        """Wait for the status and result of the goal sent last."""
        self.graph.wait_for(self._result.done, timeout_s, "the result")
        got = self._result.result()
        return got.status, got.result

    def follow(self, poses, **more):
        self.send(poses, **more)
        return self.result()
