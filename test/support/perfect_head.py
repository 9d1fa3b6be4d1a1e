"""The trajectory generator alone, with a head that is where the reference was a moment ago."""

from __future__ import annotations

import numpy as np
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from snake_control.config import load
from snake_control.experiment.guided import GuidedRobot
from snake_control.nodes import topics
from snake_control.nodes.conversions import header, pose_array, pose_message
from support.graph import CONFIG, Graph

NODE = "trajectory_generator"


class PerfectHead:
    """Context manager around the node; the joints stay in the paper's start posture.

    Attributes:
        graph: where it runs.
        references, status, path: recorders.
        silent: whether nobody hears of head and joints.
    """

    silent = False

    def __enter__(self) -> PerfectHead:
        files = [CONFIG / "paper_robot.yaml"]
        config = load(*files)
        start = GuidedRobot(config).state
        self._w, self._joints = start.w, (config.robot.joint_names, start.phi)
        self.graph = graph = Graph().__enter__()
        try:
            self.references = graph.subscribe(topics.HEAD_REFERENCE)
            self.status = graph.subscribe(topics.HEAD_TRAJECTORY_STATUS)
            self.path = graph.subscribe(topics.HEAD_PLANNED_PATH)
            self._odometry = graph.publisher(topics.HEAD_ODOMETRY)
            self._states = graph.publisher(topics.JOINT_STATES)
            graph.start(NODE, params_files=files)
            graph.wait_for(self._odometry.get_subscription_count, 30.0, NODE)
            graph.every(0.02, self._publish)
        except BaseException:
            graph.__exit__(None, None, None)
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        self.graph.__exit__(*exception)

    @property
    def w(self) -> NDArray[np.float64]:
        """Head pose, shape (6,)."""
        return np.array(self._w)

    def _publish(self) -> None:
        if self.silent:
            return
        now = self.graph.now_ns()
        if self.references.last is not None:
            self._w = pose_array(self.references.last.pose)
        odometry = Odometry(header=header(now, "world"), child_frame_id="link_1")
        odometry.pose.pose = pose_message(self._w)
        self._odometry.publish(odometry)
        names, phi = self._joints
        self._states.publish(
            JointState(header=header(now), name=list(names), position=phi.tolist())
        )
