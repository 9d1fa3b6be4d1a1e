"""Feeds a controller with inputs that a test can spoil, and records what it answers."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from snake_interfaces.msg import ControllerState, HeadReference

from snake_control.config import load
from snake_control.control.reference import Reference
from snake_control.model.floor import head_pose_on_floor
from snake_control.nodes import topics
from snake_control.nodes.conversions import header, pose_message, reference_message, stamp_ns
from support.graph import CONFIG, Graph

GOOD = (
    ControllerState.STATUS_TRACKING,
    ControllerState.STATUS_LIMITED,
    ControllerState.STATUS_RECOVERING,
)


class ControllerRig:
    """A robot that stands still in the posture of Table 1, as messages at 50 Hz.

    Attributes:
        joint_states, head, reference: templates of what is sent, stamped anew each time;
            ``None`` for silence.
        stamp_offset_ns: added to the stamps of a topic.
        last_stamp_ns: of each topic.
        w, phi, table_1: what the good messages say.
    """

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.config = load(CONFIG / "paper_robot.yaml")
        robot = self.config.robot
        self.phi = np.array(robot.start_joint_angles_rad)
        self.w = head_pose_on_floor(robot, self.phi, np.zeros(3))
        start = self.config.trajectory_generator
        self.table_1 = Reference(np.array(start.start_pose), np.array(start.velocity))
        self._publishers = {
            topic.name: graph.publisher(topic)
            for topic in (topics.JOINT_STATES, topics.HEAD_ODOMETRY, topics.HEAD_REFERENCE)
        }
        self.commands = graph.subscribe(topics.JOINT_VELOCITY_COMMAND)
        self.states = graph.subscribe(topics.CONTROLLER_STATE)
        self.last_stamp_ns: dict[str, int] = {}
        self.repair()
        graph.every(0.02, self._publish)

    def repair(self) -> None:
        """Send good inputs again."""
        names = list(self.config.robot.joint_names)
        self.stamp_offset_ns: dict[str, int] = {}
        # Not in joint order: a controller has to go by names.
        self.joint_states: JointState | None = JointState(
            name=["gripper", *names[::-1]],
            position=[9.0, *self.phi[::-1].tolist()],
            velocity=[9.0, *[0.0] * len(names)],
        )
        head = Odometry(header=header(0, "world"), child_frame_id="link_1")
        head.pose.pose = pose_message(self.w)
        self.head: Odometry | None = head
        self.reference: HeadReference | None = reference_message(self.table_1, 0, "world")

    def wait_status(self, *statuses: int, what: str, texts: Sequence[str] = ()) -> ControllerState:
        """Wait for a state, sent from now on, with one of ``statuses`` and all ``texts``."""
        now = self.graph.now_ns()

        def found() -> ControllerState | None:
            for state in reversed(self.states.messages):
                if stamp_ns(state) < now:
                    return None
                if state.status in statuses and all(text in state.text for text in texts):
                    return state
            return None

        return self.graph.wait_for(found, 30.0, what)

    def command_of(self, state: ControllerState):
        """The command of the same control step."""

        def found():
            return [c for c in self.commands.messages if c.header.stamp == state.header.stamp]

        return self.graph.wait_for(found, 10.0, "the command of a control step")[0]

    def _publish(self) -> None:
        for name, template in (
            (topics.JOINT_STATES.name, self.joint_states),
            (topics.HEAD_ODOMETRY.name, self.head),
            (topics.HEAD_REFERENCE.name, self.reference),
        ):
            if template is None:
                continue
            message = copy.deepcopy(template)
            stamp = self.graph.now_ns() + self.stamp_offset_ns.get(name, 0)
            message.header = header(stamp, message.header.frame_id)
            self.last_stamp_ns[name] = stamp
            self._publishers[name].publish(message)
