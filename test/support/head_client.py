"""What a user of the head's trajectories sees and does."""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from snake_control.nodes import topics
from snake_control.nodes.conversions import array, pose_message, stamp_ns
from support.action_client import Goals, Sent
from support.perfect_head import PerfectHead
from support.whole_graph import WholeGraph


class HeadClient:
    """Sends goals, calls services, and keeps feedback and status.

    Attributes:
        goal: the one that was sent last.
    """

    goal: Sent

    def __init__(self, robot: WholeGraph | PerfectHead) -> None:
        self.robot, self.graph = robot, robot.graph
        self._goals = Goals(self.graph, topics.FOLLOW_HEAD_TRAJECTORY)
        self.feedback = self._goals.feedback

    def poses(self, *ways: tuple[float, ...]) -> list:
        """Poses by their distance from where the head is now."""
        return [pose_message(self.robot.w + np.array(way)) for way in ways]

    def send(self, poses: list = (), frame: str = "world", **more: Any) -> Sent:
        """Send a goal."""
        self.goal = self._goals.send(header=Header(frame_id=frame), poses=list(poses), **more)
        return self.goal

    def result(self, timeout_s: float = 60.0) -> tuple[int, Any]:
        """Wait for the status and result of the goal sent last."""
        return self.goal.result(timeout_s)

    def end(self, timeout_s: float) -> bool:
        """Wait for the end of the goal sent last; cancel it after ``timeout_s``.

        Returns:
            Whether it ended by itself.
        """
        deadline = time.monotonic() + timeout_s
        self.graph.wait_for(
            lambda: self.goal.over or time.monotonic() > deadline, timeout_s + 10.0, "the result"
        )
        over = self.goal.over
        self._goals.cancel_last()
        return over

    def follow(self, poses: list = (), **more: Any) -> tuple[int, Any]:
        """Send a goal and wait for its end."""
        return self.send(poses, **more).result()

    def wait_moving(self) -> None:
        """Wait until the goal sent last has moved the head by a tenth of its way."""
        self.graph.wait_for(
            lambda: any(f.phase == "moving" and f.progress > 0.1 for f in self.feedback),
            30.0,
            "motion",
        )

    def call(self, service: topics.Service) -> Trigger.Response:
        """Call a service of the generator."""
        return self.graph.call("trajectory_generator", service, Trigger.Request())

    def stop(self) -> None:
        """Bring the head to rest, and wait until no references come any more."""
        assert self.call(topics.STOP).success
        self.graph.wait_for(
            lambda: (
                self.robot.references.last is None
                or self.graph.now_ns() - stamp_ns(self.robot.references.last) > 300_000_000
            ),
            20.0,
            "the end of references",
        )


def jumps(robot: WholeGraph | PerfectHead) -> float:
    """Largest step of the reference beyond what its twist explains [m]."""
    messages = robot.references.messages
    worst = 0.0
    for a, b in itertools.pairwise(messages):
        dt = (stamp_ns(b) - stamp_ns(a)) * 1e-9
        if dt > 0.1:
            continue
        step = array(b.pose.position) - array(a.pose.position)
        fastest = max(np.linalg.norm(array(m.twist.linear)) for m in (a, b))
        worst = max(worst, float(np.linalg.norm(step)) - (fastest * dt + 5e-4))
    return worst


def travelled(robot: WholeGraph | PerfectHead) -> NDArray[np.float64]:
    """Positions of the references received, (k, 3) [m]."""
    return np.array([array(message.pose.position) for message in robot.references.messages])
