"""Node ``pose_input``: motion capture poses in, filtered head pose and twist with validity out.

Stamps are judged by ROS time; timers run on a steady clock, also under ``use_sim_time``.
"""

from __future__ import annotations

import collections
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from snake_interfaces.msg import PoseStatus

from snake_control.control.head_filter import HeadFilter, Reason, Rejection
from snake_control.nodes import topics
from snake_control.nodes.conversions import array, header, odometry_message, stamp_ns
from snake_control.nodes.inputs import FUTURE_TOLERANCE_S
from snake_control.nodes.parameters import NodeParameters
from snake_control.nodes.process import run

_STATUS_PERIOD_S = 0.1
_RATE_WINDOW_NS = 1_000_000_000
_FUTURE_TOLERANCE_NS = round(FUTURE_TOLERANCE_S * 1e9)


class PoseInput(Node):
    """Filters ``mocap/pose``; a pose that is refused leads to no odometry, only to a status."""

    def __init__(self, **overrides: Any) -> None:
        super().__init__("pose_input", **overrides)
        self._config = NodeParameters(self, "pose_input").config.pose_input
        self._timeout_ns = round(self._config.timeout_s * 1e9)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._filter = HeadFilter(self._config.cutoff_hz, self._config.timeout_s)
        self._accepted = self._rejected = self._out_of_order = 0
        self._fault = ""
        self._fault_ns = 0
        self._arrivals: collections.deque[int] = collections.deque()
        self._published_status: int | None = None
        self._frames_warned: set[str] = set()

        t = topics.HEAD_ODOMETRY
        self._odometry = self.create_publisher(t.type, t.name, t.qos)
        t = topics.HEAD_STATUS
        self._status = self.create_publisher(t.type, t.name, t.qos)
        t = topics.MOCAP_POSE
        self.create_subscription(t.type, t.name, self._on_pose, t.qos)
        self.create_timer(_STATUS_PERIOD_S, self._publish_status, clock=self._steady)

    def _on_pose(self, message: PoseStamped) -> None:
        now = self.get_clock().now().nanoseconds
        self._arrivals.append(self._steady_ns())
        self._warn_of_frame(message.header.frame_id)
        stamp = stamp_ns(message)
        before = self._filter.estimate
        if before is not None and before.stamp_ns > now + _FUTURE_TOLERANCE_NS:
            self.get_logger().warning("the clock was set back: the filter starts anew")
            self._filter.reset()
        ahead = stamp - now
        if ahead > _FUTURE_TOLERANCE_NS:
            # Once accepted, it would make every later pose look out of order.
            self._reject(f"pose is stamped {ahead * 1e-9:.3f} s ahead of this computer's clock")
        else:
            result = self._filter.update(
                stamp, array(message.pose.position), array(message.pose.orientation)
            )
            if not isinstance(result, Rejection):
                self._accepted += 1
                self._fault = ""
                self._odometry.publish(
                    odometry_message(result, self._config.frame_id, self._config.child_frame_id)
                )
            elif result.reason is Reason.OUT_OF_ORDER:
                self._out_of_order += 1
            else:
                self._reject(result.text)
        if self._judge(now)[0] != self._published_status:
            self._publish_status()

    def _steady_ns(self) -> int:
        return self._steady.now().nanoseconds

    def _reject(self, text: str) -> None:
        self._rejected += 1
        self._fault = text
        self._fault_ns = self._steady_ns()

    def _judge(self, now: int) -> tuple[int, str]:
        """Status and text at time ``now`` [ns]."""
        estimate = self._filter.estimate
        since_fault_ns = self._steady_ns() - self._fault_ns
        if self._fault and (since_fault_ns <= self._timeout_ns or estimate is None):
            return PoseStatus.STATUS_INVALID, self._fault
        if estimate is None:
            return PoseStatus.STATUS_WAITING, "no pose received yet on mocap/pose"
        age = (now - estimate.stamp_ns) * 1e-9
        if age <= self._config.timeout_s:
            return PoseStatus.STATUS_VALID, "valid"
        text = f"the last good pose is {age:.2f} s old (limit {self._config.timeout_s:g} s)"
        if self._rate() > 0:
            text += "; poses do arrive: are the clocks of both computers synchronised?"
        return PoseStatus.STATUS_STALE, text

    def _publish_status(self) -> None:
        now = self.get_clock().now().nanoseconds
        status, text = self._judge(now)
        if status != self._published_status:
            # Two calls: rclpy holds one line of code to one severity.
            if status in (PoseStatus.STATUS_STALE, PoseStatus.STATUS_INVALID):
                self.get_logger().warning(f"head pose: {text}")
            else:
                self.get_logger().info(f"head pose: {text}")
            self._published_status = status
        estimate = self._filter.estimate
        self._status.publish(
            PoseStatus(
                header=header(now, self._config.frame_id),
                status=status,
                text=text,
                age=float("inf") if estimate is None else (now - estimate.stamp_ns) * 1e-9,
                accepted=self._accepted,
                rejected=self._rejected,
                out_of_order=self._out_of_order,
                rate=self._rate(),
            )
        )

    def _rate(self) -> float:
        """Arrival frequency over the last second [Hz]."""
        now = self._steady_ns()
        while self._arrivals and now - self._arrivals[0] > _RATE_WINDOW_NS:
            self._arrivals.popleft()
        if len(self._arrivals) < 2:
            return 0.0
        return (len(self._arrivals) - 1) / ((self._arrivals[-1] - self._arrivals[0]) * 1e-9 or 1.0)

    def _warn_of_frame(self, frame_id: str) -> None:
        if frame_id != self._config.frame_id and frame_id not in self._frames_warned:
            self._frames_warned.add(frame_id)
            self.get_logger().warning(
                f"poses are given in frame '{frame_id}'; they are taken as if in "
                f"'{self._config.frame_id}', which is right only if both are the same frame"
            )

    def close(self) -> None:
        """Nothing moves because of this node alone."""


def main() -> int:
    """Run the node."""
    return run(PoseInput, "pose_input")


if __name__ == "__main__":
    raise SystemExit(main())
