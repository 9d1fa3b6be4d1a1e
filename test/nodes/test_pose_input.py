"""The pose input node on real DDS: odometry of good poses, a status of bad ones."""

import math
from itertools import pairwise

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from snake_interfaces.msg import PoseStatus

from snake_control.model.rotation import quaternion_from_rpy
from snake_control.nodes import topics
from snake_control.nodes.conversions import array, head_motion, header, point, quaternion, stamp_ns
from support.clock import SettableClock
from support.graph import CONFIG, Graph
from support.moving_head import STEP_S, MovingHead
from support.robots import PAPER

MS = 1_000_000
RPY = np.array([0.1, -0.8, 2.5])


class Mocap:
    """A motion capture system whose poses a test makes."""

    def __init__(self, graph, reliability=ReliabilityPolicy.BEST_EFFORT, wait=True, **params):
        self.graph = graph
        self.odometry = graph.subscribe(topics.HEAD_ODOMETRY)
        self.status = graph.subscribe(topics.HEAD_STATUS)
        qos = QoSProfile(depth=5, reliability=reliability)
        self.publisher = graph.node.create_publisher(PoseStamped, topics.MOCAP_POSE.name, qos)
        graph.start("pose_input", params_files=[CONFIG / "paper_robot.yaml"], params=params)
        if wait:
            graph.wait_for(self.publisher.get_subscription_count, 30.0, "pose_input")

    @property
    def text(self):
        """Text of the newest status."""
        return self.status.last.text if self.status.last else ""

    def send(self, stamp, position=(0.0, 0.0, 0.3), rotation=None, frame="world"):
        message = PoseStamped(header=header(stamp, frame))
        message.pose.position = point(position)
        message.pose.orientation = quaternion(
            quaternion_from_rpy(RPY) if rotation is None else rotation
        )
        self.publisher.publish(message)
        return stamp

    def wait_status(self, status, text=""):
        def found():
            last = self.status.last
            return last if last and last.status == status and text in last.text else None

        return self.graph.wait_for(found, 20.0, f"status {status} '{text}'")

    def send_until_valid(self):
        """Send until a pose has come through (best effort may lose the first ones)."""
        before = len(self.odometry.messages)
        accepted = self.status.last.accepted if self.status.last else 0

        def arrived():
            self.send(self.graph.now_ns())
            last = self.status.last
            good = last and last.status == PoseStatus.STATUS_VALID and last.accepted > accepted
            return last if good and len(self.odometry.messages) > before else None

        return self.graph.wait_for(arrived, 20.0, "odometry")


@pytest.fixture(scope="module")
def mocap():
    with Graph() as graph:
        mocap = Mocap(graph)
        mocap.wait_status(PoseStatus.STATUS_WAITING, "mocap/pose")
        assert math.isinf(mocap.status.last.age)
        assert mocap.odometry.last is None
        yield mocap


def test_good_poses_become_odometry(mocap):
    mocap.send_until_valid()
    last = mocap.odometry.last
    assert last.header.frame_id == "world"
    assert last.child_frame_id == "link_1"
    # The moment of capture, not of arrival.
    stamps = [stamp_ns(message) for message in mocap.odometry.messages]
    assert stamps == sorted(stamps)
    w, w_dot = head_motion(last, "world")
    np.testing.assert_allclose(w, [0, 0, 0.3, *RPY], atol=1e-9)
    np.testing.assert_allclose(w_dot, np.zeros(6), atol=1e-9)


def test_velocity_is_in_the_frame_of_the_head(mocap):
    mocap.send_until_valid()
    start = stamp_ns(mocap.odometry.last)

    def known():
        """Send on; a pause of this process lets the filter start anew, at rest."""
        now = mocap.graph.now_ns()
        mocap.send(now, (0.05 * (now - start) * 1e-9, 0.0, 0.3))
        last = mocap.odometry.last
        _, w_dot = head_motion(last, "world")
        return last if np.abs(w_dot[:3] - [0.05, 0, 0]).max() < 2e-3 else None

    twist = mocap.graph.wait_for(known, 30.0, "the velocity").twist.twist
    # Yawed by 2.5 rad, the head moves backwards in its own frame.
    assert twist.linear.x == pytest.approx(0.05 * math.cos(2.5) * math.cos(-0.8), abs=2e-3)


@pytest.mark.parametrize(
    ("pose", "text"),
    [
        ({"position": (math.nan, 0, 0)}, "not finite"),
        ({"rotation": (0, 0, math.nan, 1)}, "not finite"),
        ({"position": (1.7e308, 0, 0)}, "beyond 1000 m"),
        ({"rotation": (0, 0, 0, 0)}, "quaternion has length 0"),
        ({"rotation": (0, 0, 0, 2)}, "quaternion has length 2"),
    ],
)
def test_a_bad_pose_gives_a_status_and_no_odometry(mocap, pose, text):
    before = mocap.send_until_valid()
    bad_stamps = set()

    def noticed():
        bad_stamps.add(mocap.send(mocap.graph.now_ns(), **pose))
        last = mocap.status.last
        return last.status == PoseStatus.STATUS_INVALID and text in last.text and last

    status = mocap.graph.wait_for(noticed, 20.0, f"the status '{text}'")
    assert status.rejected > before.rejected
    mocap.send_until_valid()
    assert bad_stamps.isdisjoint(stamp_ns(message) for message in mocap.odometry.messages)


def test_a_pose_from_the_future_is_refused(mocap):
    mocap.send_until_valid()

    def noticed():
        mocap.send(mocap.graph.now_ns() + 90 * MS)
        return "ahead of this computer's clock" in mocap.status.last.text

    mocap.graph.wait_for(noticed, 20.0, "the clocks found apart")
    assert mocap.status.last.status == PoseStatus.STATUS_INVALID
    mocap.send_until_valid()


def test_silence_makes_the_pose_stale(mocap):
    mocap.send_until_valid()
    status = mocap.wait_status(PoseStatus.STATUS_STALE, "limit 0.1 s")
    assert status.age > 0.1


def test_old_poses_are_stale_although_they_arrive(mocap):
    # A gap restarts the filter, so these are in order.
    mocap.wait_status(PoseStatus.STATUS_STALE)

    def noticed():
        mocap.send(mocap.graph.now_ns() - 70 * MS)
        mocap.send(mocap.graph.now_ns() - 500 * MS)
        return mocap.status.last.out_of_order > 3

    mocap.graph.wait_for(noticed, 20.0, "poses found out of order")
    stamps = [stamp_ns(message) for message in mocap.odometry.messages]
    assert stamps == sorted(stamps)

    def found_old():
        mocap.send(mocap.graph.now_ns() - 150 * MS)
        return "clocks of both computers" in mocap.text

    mocap.graph.wait_for(found_old, 20.0, "a text about the clocks")
    assert mocap.status.last.status == PoseStatus.STATUS_STALE


def test_status_comes_regularly_and_counts(mocap):
    mocap.status.clear()
    mocap.graph.wait_for(lambda: len(mocap.status.messages) >= 5, 10.0, "five statuses")
    counts = [s.accepted for s in mocap.status.messages]
    assert counts == sorted(counts)
    assert counts[0] > 0


def test_all_poses_of_quick_cameras_are_taken_and_few_passed_on():
    with Graph() as graph:
        mocap = Mocap(graph, max_rate_hz=20.0)
        mocap.send_until_valid()
        graph.every(0.01, lambda: mocap.send(graph.now_ns()))
        first = mocap.status.last
        graph.wait_for(
            lambda: mocap.status.last.accepted >= first.accepted + 200, 30.0, "two hundred poses"
        )
        last = mocap.status.last
        stamps = [stamp_ns(message) for message in mocap.odometry.messages]
    assert stamps == sorted(stamps)
    span_s = (stamp_ns(last) - stamp_ns(first)) * 1e-9
    passed_on = sum(stamp_ns(first) < stamp <= stamp_ns(last) for stamp in stamps)
    assert 10.0 * span_s < passed_on <= 20.0 * span_s + 2


def test_reliable_poses_of_a_frame_that_is_named_are_taken_and_no_others():
    with Graph() as graph:
        mocap = Mocap(graph, ReliabilityPolicy.RELIABLE, pose_frames=["mocap_volume"])

        def sent(frame, condition):
            def met():
                mocap.send(graph.now_ns(), frame=frame)
                return condition()

            graph.wait_for(met, 20.0, f"what becomes of frame {frame}")

        sent("camera", lambda: "frame 'camera', not in 'world'" in mocap.text)
        assert mocap.odometry.last is None
        assert mocap.status.last.reason == PoseStatus.REASON_WRONG_FRAME
        counts = mocap.status.last.rejected_by_reason
        assert counts[PoseStatus.REASON_WRONG_FRAME - 1] == mocap.status.last.rejected > 0
        sent("mocap_volume", lambda: mocap.odometry.last)
        assert mocap.odometry.last.header.frame_id == "world"
        np.testing.assert_allclose(array(mocap.odometry.last.pose.pose.position), [0, 0, 0.3])
        # Raw at first; what the filter leaves of the noise is known.
        sent("mocap_volume", lambda: 0 < mocap.odometry.last.pose.covariance[0] < 0.0005**2)
        assert 0 < mocap.odometry.last.twist.covariance[0] < 0.01


def test_what_keeps_poses_from_being_heard_is_said():
    with Graph() as graph:
        diagnostics = graph.subscribe(topics.DIAGNOSTICS)
        wrong = f"{topics.HEAD_REFERENCE.name}:={topics.MOCAP_POSE.name}"
        graph.start("trajectory_generator", arguments=["-r", wrong])
        params = {"qos_overrides./mocap/pose.subscription.reliability": "reliable"}
        mocap = Mocap(graph, wait=False, **params)
        for text in ("as snake_interfaces/msg/HeadReference", "quality of service"):
            mocap.graph.wait_for(lambda text=text: text in mocap.text, 20.0, text)
            assert mocap.status.last.publishers == 0
            assert text in graph.report()
            graph.wait_for(
                lambda text=text: any(
                    status.name == "pose_input: head pose"
                    and status.level == DiagnosticStatus.WARN
                    and text in status.message
                    for array in diagnostics.messages
                    for status in array.status
                ),
                20.0,
                f"diagnostics with {text}",
            )


def test_poses_go_on_when_the_clock_is_set_back_and_stands():
    with Graph() as graph:
        clock = SettableClock(graph)
        mocap = Mocap(graph, use_sim_time=True)
        clock.wait_for_listener()

        def arrived():
            mocap.send(clock.now_ns())
            return mocap.odometry.last and (
                abs(stamp_ns(mocap.odometry.last) - clock.now_ns()) < 1000 * MS
            )

        graph.wait_for(arrived, 20.0, "odometry")
        clock.offset_s = -3600.0
        graph.wait_for(arrived, 20.0, "odometry by the new time")
        clock.freeze()
        count = len(mocap.status.messages)
        graph.wait_for(lambda: len(mocap.status.messages) > count + 10, 10.0, "statuses")


class Robot:
    """Poses and joint states of a moving head, at the times of their stamps.

    Attributes:
        gap: times between which no pose is sent [s].
        scale: what angles are multiplied by before they are sent.
        truth: where the head was, by stamp.
    """

    def __init__(self, mocap, fastest_rad_s=0.1, flipped=()):
        self._mocap, self._graph = mocap, mocap.graph
        self._head = MovingHead(PAPER, fastest_rad_s)
        self._signs = np.ones(PAPER.joints)
        self._signs[[joint - 1 for joint in flipped]] = -1.0
        self._rng = np.random.default_rng(8)
        self._steps = 0
        self.gap = (math.inf, math.inf)
        self.scale = 1.0
        self.truth = {}
        self.begin_ns = self._graph.now_ns()
        self._joints = self._graph.publisher(topics.JOINT_STATES, wait=True)
        self._graph.every(STEP_S, self._go_on)

    @property
    def t(self):
        return self._head.t

    def stamp(self, t):
        return self.begin_ns + round(t * 1e9)

    def _go_on(self):
        while self.stamp(self._head.t) <= self._graph.now_ns():
            stamp = self.stamp(self._head.t)
            self.truth[stamp] = self._head.position
            if not self.gap[0] <= self._head.t < self.gap[1]:
                place = self._head.position + self._rng.normal(0.0, 2e-4, 3)
                self._mocap.send(stamp, place, self._head.quaternion)
            if self._steps % 2 == 0:
                self._joints.publish(
                    JointState(
                        header=header(stamp),
                        name=list(PAPER.joint_names),
                        position=(self.scale * self._signs * self._head.phi).tolist(),
                        velocity=(self._signs * self._head.phi_dot).tolist(),
                    )
                )
            self._head.step()
            self._steps += 1

    def leave_out(self, seconds):
        """Send valid poses for a while, then none; return what was heard from there on."""
        mocap = self._mocap
        mocap.wait_status(PoseStatus.STATUS_VALID)
        since = self.t
        self._graph.wait_for(lambda: self.t > since + 0.5, 20.0, "poses before the gap")
        mocap.status.clear()
        begin = self.t + 0.05
        self.gap = (begin, begin + seconds)

        def over():
            last = mocap.odometry.last
            status = mocap.status.last
            return (
                stamp_ns(last) > self.stamp(begin + seconds + 0.3)
                and status.status == PoseStatus.STATUS_VALID
            )

        self._graph.wait_for(over, 20.0, "poses after the gap")
        edges = self.stamp(begin), self.stamp(begin + seconds)
        inside = [m for m in mocap.odometry.messages if edges[0] <= stamp_ns(m) < edges[1]]
        return inside, mocap.status.messages


def test_a_short_gap_is_bridged_by_the_joints_and_a_long_one_is_not():
    with Graph() as graph:
        mocap = Mocap(graph)
        robot = Robot(mocap)
        heard = []

        def bridged():
            """A stall of the machine may have taken the joint states, too."""
            heard[:] = robot.leave_out(0.2)
            return len(heard[0]) >= 4

        graph.wait_for(bridged, 60.0, "a gap that was bridged")
        inside, statuses = heard
        variances = np.array([np.diag(np.reshape(m.pose.covariance, (6, 6))) for m in inside])
        assert (np.diff(variances, axis=0) > 0).all()
        assert variances[0, 0] > 0.0005**2
        for message in inside:
            there = robot.truth[stamp_ns(message)]
            assert np.linalg.norm(array(message.pose.pose.position) - there) < 5e-3
        predicted = [s for s in statuses if s.status == PoseStatus.STATUS_PREDICTED]
        assert predicted
        assert "the joints say where the head is, within" in predicted[0].text
        assert 0.03 < predicted[0].predicted_for <= 0.3
        assert predicted[0].predicted_position_std > 0.0005
        assert statuses[-1].predicted_for == 0.0
        assert statuses[-1].gaps_bridged > 0

        inside, statuses = robot.leave_out(0.8)
        ages = [stamp_ns(m) * 1e-9 - robot.stamp(robot.gap[0]) * 1e-9 for m in inside]
        assert max(ages, default=0.0) <= 0.3
        stale = [s for s in statuses if s.status == PoseStatus.STATUS_STALE]
        assert stale
        assert "s old (limit 0.1 s)" in stale[0].text

        stamps = [stamp_ns(message) for message in mocap.odometry.messages]
        assert all(a < b for a, b in pairwise(stamps))
        assert mocap.status.last.suspicion == PoseStatus.SUSPICION_NONE


def test_a_joint_that_turns_the_wrong_way_is_named_and_stops_nothing():
    with Graph() as graph:
        diagnostics = graph.subscribe(topics.DIAGNOSTICS)
        mocap = Mocap(graph, max_speed_m_s=10.0)
        robot = Robot(mocap, fastest_rad_s=0.4, flipped=(8,))

        def named():
            last = mocap.status.last
            return last if last and last.suspicion != PoseStatus.SUSPICION_NONE else None

        status = graph.wait_for(named, 40.0, "a suspicion")
        assert status.suspicion == PoseStatus.SUSPICION_WRONG_DIRECTION
        assert "joint 8 seems to turn the wrong way" in status.suspicion_text
        graph.wait_for(lambda: "pose against joints: joint 8" in graph.report(), 10.0, "the log")
        graph.wait_for(
            lambda: any(
                each.level == DiagnosticStatus.WARN and "joint 8" in each.message
                for message in diagnostics.messages
                for each in message.status
            ),
            10.0,
            "diagnostics",
        )
        robot.scale = 1e200
        graph.wait_for(lambda: "compared anew" in graph.report(), 20.0, "angles beyond all reason")
        stamp = stamp_ns(mocap.odometry.last)
        graph.wait_for(lambda: stamp_ns(mocap.odometry.last) > stamp, 10.0, "odometry that goes on")
