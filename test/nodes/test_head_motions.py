"""Trajectories from files and texts through all nodes and the mock robot, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from snake_interfaces.action import FollowHeadTrajectory
from snake_interfaces.msg import HeadTrajectoryStatus

from snake_control.nodes import topics
from snake_control.nodes.conversions import pose_array
from support.head_client import HeadClient, jumps, travelled
from support.whole_graph import WholeGraph

NODE = "trajectory_generator"
Result = FollowHeadTrajectory.Result
Status = HeadTrajectoryStatus

THERE_AND_BACK = """
speed_m_s: 3e-2
segments:
  - line: {by: [0.03, 0.0, 0.0]}
  - line: {by: [0.0, 0.01, 0.0], join: blend}
  - return_to_start
"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    with WholeGraph(tmp_path_factory.mktemp("motions")) as robot:
        robot.status = robot.graph.subscribe(topics.HEAD_TRAJECTORY_STATUS)
        robot.path = robot.graph.subscribe(topics.HEAD_PLANNED_PATH)
        yield robot


@pytest.fixture
def client(robot):
    return HeadClient(robot)


def follow_file(robot: WholeGraph, path) -> None:
    [result] = robot.graph.set_parameters(NODE, trajectory_file=str(path)).values()
    assert result.successful, result.reason


def ended(robot: WholeGraph, source: str, code: int) -> HeadTrajectoryStatus:
    """Wait until the newest motion of a source has ended with a code; return its status."""
    status = robot.graph.wait_for(
        lambda: next(
            (s for s in robot.status.messages[::-1] if (s.source, s.phase) == (source, "ended")),
            None,
        ),
        40.0,
        f"the end of {source}",
    )
    assert status.code == code, status.text
    return status


def test_a_file_is_previewed_followed_and_returned_from(robot, client, tmp_path):
    file = tmp_path / "there_and_back.yaml"
    file.write_text(THERE_AND_BACK)
    follow_file(robot, file)
    begin = robot.w
    seen = client.call(topics.PREVIEW)
    assert seen.success, seen.message
    assert "the rehearsal came through in 1.0" in seen.message
    assert "0.07 m" in seen.message
    robot.graph.wait_for(lambda: robot.path.last and robot.path.last.poses, 10.0, "the path")
    path = np.array([pose_array(pose.pose)[:3] for pose in robot.path.last.poses])
    assert np.linalg.norm(path - begin[:3], axis=1).max() == pytest.approx(0.0316, abs=2e-3)
    assert robot.references.last is None, "a preview moves nothing"

    robot.status.clear()
    started = client.call(topics.START)
    assert started.success, started.message
    ended(robot, "~/start", Status.NONE)
    phases = list(dict.fromkeys(s.phase for s in robot.status.messages))
    assert phases == ["rehearsing", "moving", "arriving", "ended"]
    progress = [s.progress for s in robot.status.messages if s.phase == "moving"]
    assert progress == sorted(progress)
    assert jumps(robot) <= 0.0
    assert np.ptp(travelled(robot)[:, 0]) == pytest.approx(0.03, abs=2e-3)
    np.testing.assert_allclose(robot.w[:3], begin[:3], atol=0.012)

    # Its end is held.
    assert "call ~/stop first" in client.call(topics.START).message
    client.stop()


def test_what_a_file_asks_for_and_cannot_be_is_told_with_segment(robot, client, tmp_path):
    file = tmp_path / "up.yaml"
    file.write_text("segments:\n  - hold: {duration_s: 1.0}\n  - line: {by: [0.0, 0.0, 0.4]}\n")
    follow_file(robot, file)
    robot.references.clear()
    robot.status.clear()
    for service in (topics.PREVIEW, topics.START):
        answer = client.call(service)
        assert not answer.success
        assert "segment 2 (line): " in answer.message
        assert "would hold it up after" in answer.message
    ended(robot, "~/start", Status.UNREACHABLE)

    # It is read anew: what is wrong by now is told then.
    file.write_text("segments: [{line: {by: [0.0, 0.0]}}]")
    answer = client.call(topics.START)
    assert not answer.success
    assert answer.message.startswith(f"{file}: segment 1 (line): by = [0.0, 0.0]: give 3 numbers")
    ended(robot, "~/start", Status.INVALID)
    [result] = robot.graph.set_parameters(NODE, trajectory_file="none.csv").values()
    assert not result.successful
    assert "none.csv: cannot be read" in result.reason
    assert robot.references.last is None


def test_a_goal_may_be_a_text_relative_to_the_head_and_its_way_back(robot, client):
    begin = robot.w
    poses = "t,x,y,z,roll,pitch,yaw\n0,0,0,0,0,0,0\n3,0.03,0,0,0,0,0"
    status, result = client.follow(trajectory=poses, frame="link_1")
    assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, Result.NONE), result.text
    assert robot.w[0] - begin[0] == pytest.approx(0.03, abs=0.012)
    back = client.call(topics.RETURN)
    assert back.success, back.message
    ended(robot, "~/return", Status.NONE)
    np.testing.assert_allclose(robot.w[:3], begin[:3], atol=0.012)
    # Once more: it is there already.
    assert "no way to go" in client.call(topics.RETURN).message
    status, result = client.follow(trajectory="[{circle: {radius_m: 0.05}}]")
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.INVALID)
    assert "min_turn_radius_m" in result.text


def test_a_refused_request_leaves_what_goes_on_alone(robot, client):
    robot.references.clear()
    client.send(client.poses((0.06, 0, 0, 0, 0, 0)), speed=0.02, skip_rehearsal=True)
    goes_on = client.goal
    client.wait_moving()
    status, result = client.follow(client.poses((0.1, 0, 0, 0, 0, 0)), speed=0.5)
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.INVALID), result.text
    assert not goes_on.done()
    client.goal = goes_on
    status, result = client.result()
    assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, Result.NONE), result.text
    assert jumps(robot) <= 0.0
    client.stop()
