"""The action ``follow_head_trajectory`` through all nodes and the mock robot."""

from __future__ import annotations

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from snake_interfaces.action import FollowHeadTrajectory

from snake_control.nodes import topics
from snake_control.nodes.conversions import array
from support.head_client import HeadClient, jumps
from support.whole_graph import WholeGraph

Result = FollowHeadTrajectory.Result


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    with WholeGraph(tmp_path_factory.mktemp("action")) as robot:
        yield robot


@pytest.fixture
def client(robot):
    return HeadClient(robot)


def test_the_head_goes_through_the_poses_and_tells_how_far_it_is(robot, client):
    robot.references.clear()
    start = robot.w
    poses = client.poses((0.02, 0, 0, 0, 0, 0), (0.04, 0.005, 0, 0, 0, 0.1))
    goal = robot.w + np.array([0.04, 0.005, 0, 0, 0, 0.1])
    status, result = client.follow(poses, speed=0.02)
    assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, Result.NONE), result.text
    assert result.position_error <= 0.01
    np.testing.assert_allclose(robot.w[:3], goal[:3], atol=0.012)
    assert np.linalg.norm(robot.w[:3] - start[:3]) > 0.025
    phases = [feedback.phase for feedback in client.feedback]
    assert "rehearsing" in phases
    assert "moving" in phases
    progress = [feedback.progress for feedback in client.feedback]
    assert progress == sorted(progress)
    assert progress[-1] == 1.0
    assert jumps(robot) <= 0.0


@pytest.mark.parametrize(
    ("way", "more", "code", "words"),
    [
        ((0, 0, 0.3, 0, 0, 0), {"speed": 0.03}, Result.UNREACHABLE, "hold it up after"),
        ((0.1, 0, 0, 0, 0, 0), {"speed": 0.5}, Result.INVALID, "max_linear_speed_m_s"),
        ((float("nan"), 0, 0, 0, 0, 0), {}, Result.INVALID, "pose 0"),
        (
            (0.1, 0, 0, 0, 0, 0),
            {"time_from_start": [Duration(sec=-3)]},
            Result.INVALID,
            "pose 0 comes at -3 s",
        ),
    ],
)
def test_what_cannot_be_is_told_and_nothing_moves(robot, client, way, more, code, words):
    before = robot.w
    status, result = client.follow(client.poses(way), **more)
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, code), result.text
    assert words in result.text
    np.testing.assert_allclose(robot.w, before, atol=5e-3)


def test_a_canceled_goal_slows_down_to_rest(robot, client):
    robot.references.clear()
    client.send(client.poses((0.2, 0, 0, 0, 0, 0)), speed=0.03, skip_rehearsal=True)
    client.wait_moving()
    client.goal.cancel()
    status, result = client.result()
    assert (status, result.code) == (GoalStatus.STATUS_CANCELED, Result.CANCELED)
    assert jumps(robot) <= 0.0
    last = robot.references.messages[-1]
    assert np.linalg.norm(array(last.twist.linear)) < 1e-3


def test_a_newer_goal_takes_over_without_a_jump(robot, client):
    robot.references.clear()
    client.send(client.poses((0.2, 0, 0, 0, 0, 0)), speed=0.03, skip_rehearsal=True)
    first = client.goal
    client.wait_moving()
    status, result = client.follow(
        client.poses((0.02, 0.0, 0, 0, 0, 0)), speed=0.02, skip_rehearsal=True
    )
    preempted, ended = first.result(5.0)
    assert (preempted, ended.code) == (GoalStatus.STATUS_ABORTED, Result.PREEMPTED)
    assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, Result.NONE), result.text
    assert jumps(robot) <= 0.0


def test_a_goal_that_is_canceled_while_it_is_rehearsed_moves_nothing(robot, client):
    before = len(robot.references.messages)
    # Minutes of motion: the rehearsal takes seconds, and ends when it is told to.
    ways = [(0.02 * (i % 2), 0, 0, 0, 0, 0) for i in range(200)]
    client.send(client.poses(*ways), speed=0.01)
    client.graph.wait_for(
        lambda: any(f.phase == "rehearsing" for f in client.feedback), 20.0, "the rehearsal"
    )
    client.goal.cancel()
    status, result = client.result(10.0)
    assert (status, result.code) == (GoalStatus.STATUS_CANCELED, Result.CANCELED)
    # What was followed before goes on as it was: here the end of an earlier motion, or nothing.
    moving = [m for m in robot.references.messages[before:] if np.any(array(m.twist.linear))]
    assert moving == []
    status, result = client.follow(client.poses((0.01, 0, 0, 0, 0, 0)), speed=0.02)
    assert result.code == Result.NONE, result.text


def test_stop_ends_a_goal_at_rest(robot, client):
    client.send(client.poses((0.2, 0, 0, 0, 0, 0)), speed=0.03, skip_rehearsal=True)
    client.graph.wait_for(lambda: any(f.phase == "moving" for f in client.feedback), 30.0, "motion")
    stop = topics.STOP
    assert robot.graph.call("trajectory_generator", stop, stop.type.Request()).success
    status, result = client.result()
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.CANCELED)
