"""Node ``pose_input``: motion capture poses in, filtered head pose and twist with validity out.

Stamps are judged by ROS time; timers run on a steady clock, also under ``use_sim_time``.
"""

from __future__ import annotations

import collections
import dataclasses
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState
from snake_interfaces.msg import PoseStatus

from snake_control.control.head_filter import HeadEstimate, Rejection
from snake_control.control.head_prediction import Prediction
from snake_control.control.pose_bridge import PoseBridge
from snake_control.control.pose_hypotheses import Cause
from snake_control.control.pose_intake import Measurement, PoseIntake
from snake_control.control.pose_watch import PoseWatch
from snake_control.control.rate_limit import RateLimit
from snake_control.errors import ModelError
from snake_control.nodes import topics
from snake_control.nodes.conversions import (
    MessageError,
    joint_motion,
    odometry_message,
    of_robot,
    stamp_ns,
)
from snake_control.nodes.endpoints import Endpoints
from snake_control.nodes.inputs import FUTURE_TOLERANCE_S
from snake_control.nodes.parameters import NodeParameters
from snake_control.nodes.pose_messages import (
    NUMBER_OF_REASON,
    Verdict,
    diagnostics,
    status_message,
)
from snake_control.nodes.pose_sources import Convert, Feed, feeds
from snake_control.nodes.process import run

_STATUS_PERIOD_S = 0.1
_RATE_WINDOW_NS = 1_000_000_000
_LATE = 0.5
"""A pose that was older on arrival, as a share of its time-out, is late by itself."""
_NEWS_NS = 2_000_000_000
"""How long the status tells what happened."""

# What joint angles beyond all reason lead to, and a covariance that is none.
_NO_ANSWER = (ModelError, ArithmeticError, ValueError)


class PoseInput(Node):
    """Filters measured poses; one that is refused leads to no odometry, only to a status.

    Short gaps are bridged by the joints, and the poses are compared with them.
    """

    def __init__(self, **overrides: Any) -> None:
        """Subscribe to what the configuration names.

        Raises:
            ConfigError: a parameter that is not allowed, or messages that are not installed.
        """
        super().__init__("pose_input", **overrides)
        config = NodeParameters(self, "pose_input").config
        self._config = config.pose_input
        self._joint_names = config.robot.joint_names
        self._timeout_ns = round(self._config.timeout_s * 1e9)
        self._diagnostics_ns = round(self._config.diagnostics_period_s * 1e9)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._bridge = (
            PoseBridge(config.robot, self._config, FUTURE_TOLERANCE_S)
            if self._config.bridge_s > 0.0
            else None
        )
        self._watch = PoseWatch(config.robot) if self._config.watch else None
        self._suspicion: tuple[Cause, tuple[int, ...]] = (Cause.NOTHING, ())
        self._joints_problem = ""
        self._odometry_ns = 0
        self._odometry_limit = RateLimit(self._config.max_rate_hz)
        self._intake = PoseIntake(self._config, FUTURE_TOLERANCE_S, self._bridge)
        self._fault: Rejection | None = None
        self._fault_ns = 0
        self._age_on_arrival_s = 0.0
        self._news, self._news_ns = "", 0
        self._arrivals: collections.deque[int] = collections.deque()
        self._published: Verdict | None = None
        self._diagnosed: Verdict | None = None
        self._diagnosed_ns = 0

        self._endpoints = Endpoints(self)
        self._odometry = self._endpoints.publisher(topics.HEAD_ODOMETRY)
        self._status = self._endpoints.publisher(topics.HEAD_STATUS)
        self._diagnostics = self._endpoints.publisher(topics.DIAGNOSTICS)
        first, *others = feeds(self._config)
        self._subscription = self._subscribe(first)
        for feed in others:
            self._subscribe(feed)
        if self._bridge is not None or self._watch is not None:
            # All of them count, not only the newest.
            self._endpoints.subscription(topics.JOINT_STATES, self._receive_joints)
        self.create_timer(_STATUS_PERIOD_S, self._report, clock=self._steady)

    def _subscribe(self, feed: Feed) -> Subscription:
        return self._endpoints.subscription(
            feed.topic,
            lambda message: self._receive(message, feed.convert),
            overriding=True,
            hint=" (see the parameter source)",
        )

    def _receive(self, message: Any, convert: Convert) -> None:
        now = self.get_clock().now().nanoseconds
        measured = convert(message)
        if measured is None:
            return
        self._arrivals.append(self._steady_ns())
        if isinstance(measured, Measurement):
            result = self._intake.take(measured, now)
            if self._intake.news:
                self._news, self._news_ns = self._intake.news, self._steady_ns()
                self.get_logger().warning(self._news)
            # By the clock alone, too: odometry must not wait until an old time comes again.
            if self._intake.set_back or self._odometry_ns - now > 1e9 * FUTURE_TOLERANCE_S:
                self._odometry_ns = 0
                self._odometry_limit.reset()
                if self._watch is not None:
                    self._watch.reset()
        else:
            result = self._intake.refuse(measured)
        if isinstance(result, HeadEstimate):
            self._fault = None
            self._age_on_arrival_s = (now - result.stamp_ns) * 1e-9
            # Those of cameras that are quicker than anybody here needs only serve the filter, too.
            if self._odometry_limit.allows(result.stamp_ns):
                self._publish_odometry(result)
            self._take_note(result, now)
        elif result.reason.is_fault:
            self._fault, self._fault_ns = result, self._steady_ns()
        verdict = self._judge(now)
        if self._published is None or verdict.status != self._published.status:
            self._publish_status(verdict, now)

    def _publish_odometry(self, estimate: HeadEstimate) -> None:
        """Send what is believed of the head: every accepted pose ends here, and every prediction.

        After a gap, poses that are older than what was predicted already only serve the filter.
        """
        if estimate.stamp_ns <= self._odometry_ns:
            return
        self._odometry_ns = estimate.stamp_ns
        self._odometry.publish(
            odometry_message(estimate, self._config.frame_id, self._config.child_frame_id)
        )

    def _take_note(self, estimate: HeadEstimate, now: int) -> None:
        """Let those know of a good pose whom nobody waits for."""
        if self._bridge is not None:
            self._bridge.took(estimate, now)
        if self._watch is not None and self._intake.measured is not None:
            pose = self._intake.measured
            try:
                self._watch.pose(pose.stamp_ns, pose.position, pose.quaternion)
            except _NO_ANSWER as error:
                self._watch_anew(error)

    def _receive_joints(self, message: JointState) -> None:
        now = self.get_clock().now().nanoseconds
        try:
            phi, phi_dot = joint_motion(message, self._joint_names)
        except MessageError as error:
            self._joints_problem = f"{topics.JOINT_STATES.name}: {error}"
            return
        self._joints_problem = ""
        stamp = stamp_ns(message)
        if self._bridge is not None:
            prediction = self._bridge.joints(stamp, phi, phi_dot, now)
            if prediction is not None:
                self._publish_odometry(prediction.estimate)
                verdict = self._judge(now)
                if self._published is None or verdict.status != self._published.status:
                    self._publish_status(verdict, now)
        if self._watch is not None:
            try:
                self._watch.joints(stamp, phi)
            except _NO_ANSWER as error:
                self._watch_anew(error)

    def _watch_anew(self, error: Exception) -> None:
        """Begin to compare anew: it must not keep the poses from going on."""
        assert self._watch is not None
        self._watch.reset()
        self.get_logger().warning(
            f"poses and joints are compared anew: {error}", throttle_duration_sec=1.0
        )

    def _steady_ns(self) -> int:
        return self._steady.now().nanoseconds

    def _judge(self, now: int) -> Verdict:
        """Return how far the head pose can be trusted at time ``now`` [ns]."""
        prediction = self._prediction(now)
        verdict = dataclasses.replace(self._judge_poses(now, prediction), prediction=prediction)
        if self._watch is None:
            return verdict
        seen = self._watch.verdict
        return dataclasses.replace(verdict, cause=seen.cause, suspicion=seen.text)

    def _prediction(self, now: int) -> Prediction | None:
        """Return the prediction that is in force, ``None`` if none is."""
        prediction = None if self._bridge is None else self._bridge.prediction
        if prediction is None or now - prediction.estimate.stamp_ns > self._timeout_ns:
            return None
        return prediction

    def _judge_poses(self, now: int, prediction: Prediction | None) -> Verdict:
        estimate, steady_ns = self._intake.estimate, self._steady_ns()
        senders = self._endpoints.ends(self._subscription)
        remarks = [self._intake.clock.problem, senders.problem, self._joints_problem]
        if self._news and steady_ns - self._news_ns < _NEWS_NS:
            remarks.append(self._news)
        bridged = "" if prediction is None else self._bridged(prediction)
        remark = "; ".join(filter(None, remarks))
        fault = self._fault
        if fault and (steady_ns - self._fault_ns <= self._timeout_ns or estimate is None):
            reason = NUMBER_OF_REASON[fault.reason]
            remark = "; ".join(filter(None, [bridged, remark]))
            return Verdict(PoseStatus.STATUS_INVALID, reason, fault.text, remark)
        none = PoseStatus.REASON_NONE
        if estimate is None:
            text = f"no pose received yet on {self._subscription.topic_name.lstrip('/')}"
            if not (senders.fitting or senders.problem):
                text += ": nobody publishes it"
            return Verdict(PoseStatus.STATUS_WAITING, none, text, remark)
        if bridged:
            return Verdict(PoseStatus.STATUS_PREDICTED, none, bridged, remark)
        age = (now - estimate.stamp_ns) * 1e-9
        if age <= self._config.timeout_s:
            return Verdict(PoseStatus.STATUS_VALID, none, "valid", remark)
        text = f"the last good pose is {age:.2f} s old (limit {self._config.timeout_s:g} s)"
        if self._age_on_arrival_s > _LATE * self._config.timeout_s:
            text += (
                f", {self._age_on_arrival_s:.2f} s when it came: are the clocks of both computers "
                "synchronised?"
            )
        return Verdict(PoseStatus.STATUS_STALE, none, text, remark)

    def _bridged(self, prediction: Prediction) -> str:
        return (
            f"no pose for {prediction.age_s:.2f} s (bridged for {self._config.bridge_s:g} s at "
            "most): the joints say where the head is, within "
            f"{1e3 * prediction.position_std_m:.1f} mm and "
            f"{1e3 * prediction.attitude_std_rad:.1f} mrad"
        )

    def _report(self) -> None:
        """Publish the status, and diagnostics when they are due or something has changed."""
        now = self.get_clock().now().nanoseconds
        self._publish_status(self._judge(now), now)
        self._tell_suspicion()

    def _tell_suspicion(self) -> None:
        """Log what seems to be wrong with poses and joints, when that changes."""
        if self._watch is None:
            return
        seen = self._watch.verdict
        before, self._suspicion = self._suspicion, (seen.cause, seen.joints)
        if self._suspicion == before:
            return
        if seen.cause is Cause.NOTHING:
            self.get_logger().info(f"pose against joints: {seen.text}")
        else:
            self.get_logger().warning(f"pose against joints: {seen.text}")

    def _publish_status(self, verdict: Verdict, now: int) -> None:
        before, self._published = self._published, verdict
        # Two calls: rclpy holds one line of code to one severity.
        if before is None or verdict.status != before.status:
            if verdict.status in (PoseStatus.STATUS_STALE, PoseStatus.STATUS_INVALID):
                self.get_logger().warning(f"head pose: {verdict.words}")
            else:
                self.get_logger().info(f"head pose: {verdict.words}")
        status = status_message(
            verdict,
            self._intake,
            now,
            self._config.frame_id,
            self._rate(),
            self._endpoints.ends(self._subscription).fitting,
            0 if self._bridge is None else self._bridge.gaps,
        )
        self._status.publish(status)
        self._diagnose(status, verdict)

    def _diagnose(self, status: PoseStatus, verdict: Verdict) -> None:
        steady_ns = self._steady_ns()
        last = self._diagnosed
        changed = (
            last is None
            or (verdict.status, verdict.reason, verdict.cause)
            != (last.status, last.reason, last.cause)
            or bool(verdict.remarks) != bool(last.remarks)
        )
        if not changed and steady_ns - self._diagnosed_ns < self._diagnostics_ns:
            return
        self._diagnosed, self._diagnosed_ns = verdict, steady_ns
        array = diagnostics(status, verdict, self._intake, self._subscription.topic_name)
        self._diagnostics.publish(of_robot(array, self.get_namespace()))

    def _rate(self) -> float:
        """Arrival frequency over the last second [Hz]."""
        now = self._steady_ns()
        while self._arrivals and now - self._arrivals[0] > _RATE_WINDOW_NS:
            self._arrivals.popleft()
        if len(self._arrivals) < 2:
            return 0.0
        return (len(self._arrivals) - 1) / ((self._arrivals[-1] - self._arrivals[0]) * 1e-9 or 1.0)

    def close(self) -> None:
        """Nothing moves because of this node alone."""


def main() -> int:
    """Run the node."""
    return run(PoseInput, "pose_input")


if __name__ == "__main__":
    raise SystemExit(main())
