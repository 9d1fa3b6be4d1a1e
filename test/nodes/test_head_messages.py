"""What a Path or a MultiDOFJointTrajectory asks for; no graph, no clock."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped, Transform, Twist
from nav_msgs.msg import Path
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.control.reference import Reference
from snake_control.errors import SnakeError
from snake_control.nodes.conversions import header, pose_message, vector
from snake_control.nodes.head_messages import MessageMotion, path_motion, trajectory_motion
from snake_control.trajectory.plan import Plan

HEAD = np.array([0.3, -0.2, 0.2, 0.4, 0.3, 0.5])
NOW = 1_000 * 10**9
SECOND = 10**9


def ahead(*ways: float) -> list[np.ndarray]:
    return [HEAD + [way, 0, 0, 0, 0, 0] for way in ways]


def path(poses, stamps=(), stamp: int = NOW, frame: str = "world") -> Path:
    message = Path(header=header(stamp, frame))
    for i, w in enumerate(poses):
        at = header(int(stamps[i]) if stamps else 0, frame)
        message.poses.append(PoseStamped(header=at, pose=pose_message(np.array(w, dtype=float))))
    return message


def trajectory(poses, times, stamp: int = 0, names=("link_1",), velocities=()):
    message = MultiDOFJointTrajectory(header=header(stamp, "world"), joint_names=list(names))
    for i, (w, t) in enumerate(zip(poses, times, strict=True)):
        pose = pose_message(w)
        transform = Transform(rotation=pose.orientation)
        transform.translation = vector([pose.position.x, pose.position.y, pose.position.z])
        point = MultiDOFJointTrajectoryPoint(transforms=[transform] * max(1, len(names)))
        if velocities:
            point.velocities = [Twist(linear=vector(velocities[i]))] * max(1, len(names))
        point.time_from_start = Duration(sec=int(t), nanosec=round((t % 1) * 1e9))
        message.points.append(point)
    return message


def planned(motion: MessageMotion, elapsed: float = 0.0) -> Plan:
    start = Reference(HEAD, np.zeros(6))
    return Plan(TrajectoryGeneratorConfig(), motion.course(elapsed), start)


def from_path(message: Path, elapsed: float = 0.0) -> Plan:
    return planned(path_motion(message, NOW, 0.5, "world"), elapsed)


def from_trajectory(message: MultiDOFJointTrajectory) -> Plan:
    return planned(trajectory_motion(message, NOW, 0.5, "world"))


def x(plan: Plan, t: float) -> float:
    return float(plan.made()(0.0).sample(t).w_d[0] - HEAD[0])


def test_equal_stamps_mean_a_speed_and_a_stamp_ahead_a_later_begin():
    for stamps in ((), [NOW, NOW]):
        plan = from_path(path(ahead(0.05, 0.1), stamps))
        assert plan.duration == pytest.approx(11.0)
    later = path_motion(path(ahead(0.1), stamp=NOW + 3 * SECOND), NOW, 0.5, "world")
    assert later.wait_s == pytest.approx(3.0)
    assert path_motion(path(ahead(0.1), stamp=0), NOW, 0.5, "world").wait_s == 0.0


@pytest.mark.parametrize("first", [0, NOW - SECOND // 4])
def test_rising_stamps_count_from_the_first(first):
    stamps = [first + k * 5 * SECOND for k in range(3)]
    plan = from_path(path(ahead(0.0, 0.05, 0.1), stamps))
    assert plan.duration == pytest.approx(10.0)
    assert x(plan, 5.0) == pytest.approx(0.05)
    # The head goes to the first pose first, and rests there.
    plan = from_path(path(ahead(0.05, 0.1), stamps[:2]))
    assert plan.duration == pytest.approx(6.0 + 5.0)


def test_without_a_stamp_of_its_own_a_path_has_relative_times():
    plan = from_path(path(ahead(0.0, 0.1), [7 * SECOND, 17 * SECOND], stamp=0))
    assert plan.duration == pytest.approx(10.0)


def test_stamps_ahead_are_kept():
    stamps = [NOW + 8 * SECOND, NOW + 16 * SECOND]
    message = path(ahead(0.05, 0.1), stamps)
    assert path_motion(message, NOW, 0.5, "world").is_dated
    plan = from_path(message, elapsed=2.0)
    assert plan.duration == pytest.approx(14.0)
    assert x(plan, 6.0) == pytest.approx(0.05)
    np.testing.assert_allclose(plan.made()(0.0).sample(6.0).w_d_dot, 0.0, atol=1e-12)
    with pytest.raises(SnakeError, match=r"time of pose 0 has passed .* 1 s ago"):
        from_path(message, elapsed=9.0)


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (path([]), "no poses"),
        (path(ahead(0.1), frame="map"), "its frame is 'map', expected 'world', or 'link_1'"),
        (path(ahead(0.1, 0.2), [NOW - 9 * SECOND, NOW]), "pose 0 is stamped 9 s in the past"),
        (path(ahead(0.0, 0.1, 0.2), [0, 9 * SECOND, 3 * SECOND]), "pose 2 comes at 3 s, not after"),
        (path(ahead(0.0, 0.1), [0, 1 * SECOND]), "pose 1: the head would move at 0.18"),
        (path([[math.nan] * 6]), "pose 0: its position is not finite"),
    ],
)
def test_what_is_wrong_with_a_path_is_named(message, words):
    with pytest.raises(SnakeError, match=words):
        from_path(message)


def test_poses_in_another_frame_than_the_path_are_refused():
    message = path(ahead(0.1))
    message.poses[0].header.frame_id = "map"
    with pytest.raises(SnakeError, match="pose 0: its frame is 'map', that of the path 'world'"):
        from_path(message)


def test_poses_relative_to_the_head():
    plan = from_path(path([[0.1, 0, 0, 0, 0, 0.2]], frame="link_1"))
    end = plan.made()(0.0).sample(plan.duration).w_d
    c, s = 0.1 * math.cos(0.5), 0.1 * math.sin(0.5)
    np.testing.assert_allclose(end, HEAD + [c, s, 0, 0, 0, 0.2], atol=1e-9)


def test_points_of_a_trajectory_are_met_at_their_times():
    for names in (("link_1",), ("head",), (), ("other", "link_1")):
        plan = from_trajectory(trajectory(ahead(0.05, 0.1), (5.5, 11.0), names=names))
        assert plan.duration == pytest.approx(11.0)
        assert x(plan, 5.5) == pytest.approx(0.05)
    # A first point at 0 s is where the head goes first.
    plan = from_trajectory(trajectory(ahead(0.05, 0.1), (0.0, 8.0)))
    assert plan.duration == pytest.approx(6.0 + 8.0)
    later = trajectory(ahead(0.05), (5.5,), stamp=NOW + 2 * SECOND)
    assert trajectory_motion(later, NOW, 0.5, "world").wait_s == pytest.approx(2.0)


def test_velocities_of_points_are_kept():
    velocities = [(0.02, 0, 0), (0.02, 0, 0), (0, 0, 0)]
    plan = from_trajectory(
        trajectory(ahead(0.04, 0.08, 0.1), (4.0, 6.0, 8.0), velocities=velocities)
    )
    motion = plan.made()(0.0)
    for t in (4.0, 6.0):
        np.testing.assert_allclose(motion.sample(t).w_d_dot, [0.02, 0, 0, 0, 0, 0], atol=1e-9)
    # Each velocity between two points is that of both: an even line.
    assert motion.sample(5.0).w_d_dot[0] == pytest.approx(0.02, abs=2e-3)


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (trajectory([], ()), "no poses"),
        (trajectory(ahead(0.1), (9.0,), stamp=NOW - 2 * SECOND), "it is stamped 2 s in the past"),
        (
            trajectory(ahead(0.1), (9.0,), names=("a", "b")),
            "its joints are a, b; give one, or link_1",
        ),
        (trajectory(ahead(0.1, 0.2), (9.0, 9.0)), "point 1 comes at 9 s, not after point 0"),
        (
            trajectory(ahead(0.05, 0.1), (5.0, 9.0), velocities=[(0, 0, 0), (0.01, 0, 0)]),
            "point 1: the last velocity must be 0",
        ),
        (
            trajectory(ahead(0.05, 0.1), (5.0, 9.0), velocities=[(math.inf, 0, 0), (0, 0, 0)]),
            "point 0: its velocity is not finite",
        ),
    ],
)
def test_what_is_wrong_with_a_trajectory_is_named(message, words):
    with pytest.raises(SnakeError, match=words):
        from_trajectory(message)


def test_a_velocity_or_transform_that_is_missing_is_named():
    message = trajectory(ahead(0.05, 0.1), (5.0, 9.0), velocities=[(0, 0, 0), (0, 0, 0)])
    message.points[1].velocities = []
    with pytest.raises(SnakeError, match="point 1: it has no velocity, and others have one"):
        from_trajectory(message)
    message.points[0].transforms = []
    with pytest.raises(SnakeError, match="point 0: it has 0 transforms"):
        from_trajectory(message)
