"""The trajectory generator node on real DDS: it moves nothing unasked, and stops when told."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import Trigger

from snake_control.nodes import topics
from snake_control.nodes.conversions import (
    header,
    pose_array,
    pose_message,
    reference_from,
    stamp_ns,
    vector,
)
from support.clock import SettableClock
from support.graph import CONFIG, Graph

NODE = "trajectory_generator"
PAPER_ROBOT = CONFIG / "paper_robot.yaml"
HEAD = np.array([0.4, -0.2, 0.3, 0.1, -0.9, math.pi / 2])
TABLE_1_START = np.array([0, 0, 0.2, math.pi / 8, math.pi / 8, 0])


def seconds(messages):
    """Stamps of messages from the first one on [s]."""
    stamps = np.array([stamp_ns(message) for message in messages])
    return (stamps - stamps[0]) * 1e-9


def moved(pose, *distance):
    return np.add(pose, [*distance, 0, 0, 0])


class Rig:
    """A generator, the head pose it sees, and somebody at a joystick."""

    def __init__(self, graph, **params):
        self.graph = graph
        self.references = graph.subscribe(topics.HEAD_REFERENCE)
        self.head_known = True
        self.command = None
        self._head = graph.publisher(topics.HEAD_ODOMETRY)
        self._cmd_vel = graph.publisher(topics.CMD_VEL)
        self.process = graph.start(NODE, params_files=[PAPER_ROBOT], params=params)
        graph.wait_for(self._head.get_subscription_count, 30.0, NODE)
        graph.wait_for(self._cmd_vel.get_subscription_count, 30.0, NODE)
        graph.every(0.02, self._publish)

    def drive(self, linear=(0, 0, 0), angular=(0, 0, 0), frame="", stamped=True, offset_ns=0):
        message = TwistStamped(header=header(0, frame))
        message.twist.linear = vector(linear)
        message.twist.angular = vector(angular)
        self.command = (message, stamped, offset_ns)

    def last(self):
        return reference_from(self.references.last, "world")

    def wait_rate(self, rate, what):
        """Wait until the reference has this rate to 1 %."""
        self.graph.wait_for(
            lambda: self.references.last and np.allclose(self.last().w_d_dot, rate, atol=5e-4),
            20.0,
            what,
        )

    def wait_stale_head(self):
        """The head pose of a moment ago still counts for 0.1 s."""
        before = self.graph.now_ns()
        self.graph.wait_for(
            lambda: self.graph.now_ns() - before > 500_000_000, 5.0, "the head pose to be stale"
        )

    def wait_silence(self, what):
        """Wait until no reference has come for half a second; return the last one."""
        self.graph.wait_for(
            lambda: self.graph.now_ns() - stamp_ns(self.references.last) > 500_000_000, 20.0, what
        )
        return self.last()

    def _publish(self):
        now = self.graph.now_ns()
        if self.head_known:
            message = Odometry(header=header(now, "world"), child_frame_id="link_1")
            message.pose.pose = pose_message(HEAD)
            self._head.publish(message)
        if self.command is not None:
            message, stamped, offset_ns = self.command
            stamp = now + offset_ns if stamped else 0
            message.header = header(stamp, message.header.frame_id)
            self._cmd_vel.publish(message)


def test_table_1_line_from_start_to_stop():
    with Graph() as graph:
        rig = Rig(graph)
        before = graph.now_ns()
        # Inputs alone start nothing, however long they come.
        graph.wait_for(lambda: graph.now_ns() - before > 1e9, 5.0, "a second")
        called = graph.now_ns()
        response = graph.call(NODE, topics.START, Trigger.Request())
        assert response.success, response.message
        graph.wait_for(lambda: len(rig.references.messages) > 50, 20.0, "references")
        assert stamp_ns(rig.references.messages[0]) >= called

        # Latched: it comes to those who subscribe later, too.
        path = graph.subscribe(topics.HEAD_PLANNED_PATH)
        graph.wait_for(lambda: path.last and path.last.poses, 10.0, "the planned path")
        start_ns = stamp_ns(path.last.poses[0])
        for pose in path.last.poses:
            t = (stamp_ns(pose) - start_ns) * 1e-9
            np.testing.assert_allclose(
                pose_array(pose.pose), moved(TABLE_1_START, 0.01 * t, 0, 0), atol=1e-7
            )
        # One copy: more arrive meanwhile.
        messages = rig.references.messages
        references = [reference_from(message, "world") for message in messages]
        assert abs(stamp_ns(messages[0]) - start_ns) < 1_000_000_000
        for reference in references:
            x = reference.w_d[0]
            np.testing.assert_allclose(reference.w_d, moved(TABLE_1_START, x, 0, 0), atol=1e-7)
            np.testing.assert_allclose(reference.w_d_dot, [0.01, 0, 0, 0, 0, 0], atol=1e-12)
        x = np.array([reference.w_d[0] for reference in references])
        # Time that a busy host loses is not made up for.
        expected = 0.01 * seconds(messages)
        assert np.all(x - x[0] <= expected + 1e-4)
        assert x[-1] - x[0] > 0.5 * expected[-1]

        assert not graph.call(NODE, topics.START, Trigger.Request()).success
        assert graph.call(NODE, topics.STOP, Trigger.Request()).success
        end = rig.wait_silence("the end of references after ~/stop")
        np.testing.assert_array_equal(end.w_d_dot, np.zeros(6))
        graph.wait_for(lambda: not path.last.poses, 10.0, "the path removed")
        # And it can be started again.
        assert graph.call(NODE, topics.START, Trigger.Request()).success


def test_short_line_from_the_head_is_held_at_its_end():
    with Graph() as graph:
        velocity = [0.0, 0.05, 0.0, 0.0, 0.0, 0.0]
        rig = Rig(graph, start_from="head", velocity=velocity, duration_s=0.4, autostart=True)
        rig.wait_rate(np.zeros(6), "the end of the line")
        ended = graph.now_ns()
        graph.wait_for(
            lambda: stamp_ns(rig.references.last) - ended > 500_000_000, 10.0, "the end held"
        )
        np.testing.assert_allclose(rig.last().w_d, moved(HEAD, 0, 0.02, 0), atol=1e-6)


def test_hold_needs_a_head_pose():
    with Graph() as graph:
        rig = Rig(graph, trajectory="hold")
        rig.head_known = False
        rig.wait_stale_head()
        refused = graph.call(NODE, topics.START, Trigger.Request())
        assert not refused.success
        assert "head/odometry" in refused.message
        rig.head_known = True
        graph.wait_for(
            lambda: graph.call(NODE, topics.START, Trigger.Request()).success, 10.0, "a start"
        )
        graph.wait_for(lambda: rig.references.last, 10.0, "references")
        np.testing.assert_allclose(rig.last().w_d, HEAD, atol=1e-6)


@pytest.mark.parametrize(
    ("frame", "stamped", "velocity"),
    [("world", True, [0.04, 0, 0]), ("link_1", True, [0, 0.04, 0]), ("", False, [0.04, 0, 0])],
)
def test_cmd_vel_moves_the_reference_and_its_end_stops_it(frame, stamped, velocity):
    with Graph() as graph:
        rig = Rig(graph)
        rig.drive(linear=(0.04, 0, 0), frame=frame, stamped=stamped)
        rig.wait_rate([*velocity, 0, 0, 0], "the commanded velocity")
        first = reference_from(rig.references.messages[0], "world")
        np.testing.assert_allclose(first.w_d, HEAD, atol=1e-3)
        rig.command = None
        stopped = graph.now_ns()
        end = rig.wait_silence("the end of references after cmd_vel")
        np.testing.assert_array_equal(end.w_d_dot, np.zeros(6))
        # Dead-man 0.5 s, then 0.4 s from 0.04 m/s at 0.1 m/s^2; nothing much later.
        assert stamp_ns(rig.references.last) - stopped < 2_000_000_000
        rates = np.array([reference_from(m, "world").w_d_dot for m in rig.references.messages])
        stamps = seconds(rig.references.messages)
        speed = np.linalg.norm(rates[:, :3], axis=1)
        assert np.all(np.abs(np.diff(speed)) <= 0.1 * np.diff(stamps) + 5e-4)


def test_cmd_vel_takes_over_a_line_without_a_jump():
    with Graph() as graph:
        rig = Rig(graph)
        graph.call(NODE, topics.START, Trigger.Request())
        rig.wait_rate([0.01, 0, 0, 0, 0, 0], "the line")
        rig.drive(angular=(0, 0, 0.2))
        rig.wait_rate([0, 0, 0, 0, 0, 0.2], "the commanded turn")
        messages = rig.references.messages
        references = [reference_from(m, "world") for m in messages]
        stamps = seconds(messages)
        steps = np.abs(np.diff([r.w_d for r in references], axis=0))
        assert np.all(steps.max(axis=1) <= 0.2 * np.diff(stamps) + 1e-3)


@pytest.mark.parametrize("offset_s", [3600.0, -3600.0])
def test_a_clock_that_is_set_moves_nothing(offset_s):
    with Graph() as graph:
        clock = SettableClock(graph)
        rig = Rig(graph, use_sim_time=True)
        clock.wait_for_listener()
        graph.call(NODE, topics.START, Trigger.Request())
        graph.wait_for(lambda: len(rig.references.messages) > 10, 20.0, "references")
        clock.offset_s = offset_s
        graph.wait_for(
            lambda: abs(stamp_ns(rig.references.last) - clock.now_ns()) < 1e9, 10.0, "the new time"
        )
        count = len(rig.references.messages)
        graph.wait_for(lambda: len(rig.references.messages) > count + 25, 10.0, "more references")
        x = np.array([reference_from(m, "world").w_d[0] for m in rig.references.messages])
        assert x[-1] > x[0]
        # No more than two sample periods at once.
        assert np.all(np.diff(x) <= 0.01 * 0.04 + 1e-9)
        assert np.all(np.diff(x) >= 0.0)


def test_a_joystick_at_rest_starts_nothing_and_takes_over_nothing(shared):
    graph = shared.graph
    shared.drive()
    before = graph.now_ns()
    graph.wait_for(lambda: graph.now_ns() - before > 1e9, 5.0, "a second of zero commands")
    assert shared.references.last is None
    assert graph.call(NODE, topics.START, Trigger.Request()).success
    graph.wait_for(lambda: len(shared.references.messages) > 50, 10.0, "references")
    np.testing.assert_allclose(shared.last().w_d_dot, [0.01, 0, 0, 0, 0, 0], atol=1e-12)
    assert graph.call(NODE, topics.STOP, Trigger.Request()).success
    shared.wait_silence("the end of references")
    shared.command = None
    shared.references.clear()


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ({"linear": (math.nan, 0, 0)}, "not finite"),
        ({"angular": (0, 0, math.inf)}, "not finite"),
        ({"linear": (0.04, 0, 0), "offset_ns": -3_000_000_000}, "its stamp is 3.00 s old"),
        ({"linear": (0.04, 0, 0), "offset_ns": 30_000_000}, "ahead of this computer's clock"),
        ({"linear": (0.04, 0, 0), "frame": "base_link"}, "'base_link'"),
    ],
)
def test_a_bad_cmd_vel_is_ignored_with_its_reason(shared, command, reason):
    shared.drive(**command)
    shared.graph.wait_for(lambda: reason in shared.process.output(), 20.0, f"the reason '{reason}'")
    assert "cmd_vel ignored" in shared.process.output()
    assert shared.references.last is None
    shared.command = None


@pytest.fixture(scope="module")
def shared():
    with Graph() as graph:
        yield Rig(graph)


def test_without_a_head_pose_cmd_vel_starts_nothing():
    with Graph() as graph:
        rig = Rig(graph)
        rig.head_known = False
        rig.wait_stale_head()
        rig.drive(linear=(0.04, 0, 0))
        graph.wait_for(
            lambda: "the head pose is not known" in rig.process.output(), 20.0, "the reason"
        )
        assert rig.references.last is None


def test_those_who_do_not_fit_are_reported_once_on_both_sides():
    with Graph() as graph:
        rig = Rig(graph)
        graph.start("pose_input", arguments=["-r", f"{topics.HEAD_STATUS.name}:=cmd_vel"])
        unreliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        graph.node.create_publisher(TwistStamped, topics.CMD_VEL.name, unreliable)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        t = topics.HEAD_REFERENCE
        graph.node.create_subscription(t.type, t.name, print, latched)
        who = graph.node.get_fully_qualified_name()
        reports = (
            f"{who} cannot be heard on /cmd_vel, its quality of service does not fit",
            "/pose_input publishes /cmd_vel as snake_interfaces/msg/PoseStatus, not as "
            "geometry_msgs/msg/TwistStamped (see the parameter cmd_vel_stamped)",
            f"{who} cannot hear on /head/reference, its quality of service does not fit",
        )
        for text in reports:
            graph.wait_for(lambda text=text: text in rig.process.output(), 20.0, text)
        # What comes later is reported in its turn, and what was said is not said again.
        t = topics.HEAD_PLANNED_PATH
        hasty = QoSProfile(depth=1, deadline=Duration(seconds=1))
        graph.node.create_subscription(t.type, t.name, print, hasty)
        graph.wait_for(
            lambda: "cannot hear on /head/planned_path" in rig.process.output(), 20.0, "the last"
        )
        for text in reports:
            assert rig.process.output().count(text) == 1


@pytest.mark.parametrize(("frame", "rate"), [("world", [0.02, 0, 0]), ("link_1", [0, 0.02, 0])])
def test_a_twist_without_a_stamp_is_meant_in_the_configured_frame(frame, rate):
    with Graph() as graph:
        references = graph.subscribe(topics.HEAD_REFERENCE)
        head = graph.publisher(topics.HEAD_ODOMETRY)
        twists = graph.publisher(topics.CMD_VEL_UNSTAMPED)
        graph.start(
            NODE,
            params_files=[PAPER_ROBOT],
            params={"cmd_vel_stamped": False, "cmd_vel_frame": frame},
        )
        graph.wait_for(twists.get_subscription_count, 30.0, NODE)

        def publish():
            where = Odometry(header=header(graph.now_ns(), "world"), child_frame_id="link_1")
            where.pose.pose = pose_message(HEAD)
            head.publish(where)
            twists.publish(Twist(linear=vector((0.02, 0, 0))))

        graph.every(0.02, publish)
        graph.wait_for(
            lambda: (
                references.last
                and np.allclose(
                    reference_from(references.last, "world").w_d_dot[:3], rate, atol=5e-4
                )
            ),
            20.0,
            "the commanded velocity",
        )
