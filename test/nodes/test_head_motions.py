"""Trajectories from files, texts and messages: previewed, followed, taken over and refused."""

from __future__ import annotations

import re

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped, Transform
from nav_msgs.msg import Path
from snake_interfaces.action import FollowHeadTrajectory
from snake_interfaces.msg import HeadTrajectoryStatus
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from snake_control.nodes import head_trajectory, topics
from snake_control.nodes.conversions import (
    array,
    header,
    pose_array,
    pose_message,
    stamp_ns,
    vector,
)
from support.graph import Graph
from support.head_client import HeadClient, jumps, travelled
from support.perfect_head import PerfectHead

NODE = "trajectory_generator"
TOOL = "snake_control.nodes.head_trajectory"
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
def shared():
    with PerfectHead() as robot:
        yield robot


@pytest.fixture
def client(shared):
    client = HeadClient(shared)
    client.stop()
    shared.references.clear()
    shared.status.clear()
    return client


@pytest.fixture
def robot(client):
    return client.robot


def follow_file(robot: PerfectHead, path) -> None:
    [result] = robot.graph.set_parameters(NODE, trajectory_file=str(path)).values()
    assert result.successful, result.reason


def ended(robot: PerfectHead, source: str, code: int) -> HeadTrajectoryStatus:
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
    assert not goes_on.over
    status, result = goes_on.result()
    assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, Result.NONE), result.text
    assert jumps(robot) <= 0.0


@pytest.mark.parametrize("comes_back", [True, False], ids=["in time", "too late"])
def test_a_head_that_is_not_heard_when_the_rehearsal_ends_is_waited_for(robot, client, comes_back):
    client.feedback.clear()
    # Half a minute of motion, so that the rehearsal takes longer than the head needs to be stale.
    client.send(client.poses(*[(0.05 * (i % 2), 0, 0, 0, 0, 0) for i in range(1, 9)]), speed=0.01)
    phases = []

    def in_phase(phase):
        phases[:] = [feedback.phase for feedback in client.feedback]
        return phase in phases

    client.graph.wait_for(lambda: in_phase("rehearsing"), 20.0, "the rehearsal")
    robot.silent = True
    try:
        client.graph.wait_for(lambda: in_phase("waiting"), 20.0, "waiting for the head")
        if comes_back:
            robot.silent = False
            client.graph.wait_for(lambda: in_phase("moving"), 20.0, "motion")
            client.goal.cancel()
        status, result = client.result()
    finally:
        robot.silent = False
    if comes_back:
        assert (status, result.code) == (GoalStatus.STATUS_CANCELED, Result.CANCELED)
    else:
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.NO_HEAD)
        assert result.text == "no fresh head/odometry"
        assert not in_phase("moving")


def path_ahead(robot: PerfectHead, *ways: float, stamp_s: float = 0.0, step_s: float = 0.0) -> Path:
    """A path along x from where the head is; stamps from now on, where a step is given."""
    message = Path(header=header(robot.graph.now_ns(), "world"))
    for i, way in enumerate(ways):
        stamp = robot.graph.now_ns() + round((stamp_s + i * step_s) * 1e9) if step_s else 0
        pose = pose_message(robot.w + [way, 0, 0, 0, 0, 0])
        message.poses.append(PoseStamped(header=header(stamp, "world"), pose=pose))
    return message


def trajectory_ahead(robot: PerfectHead, way: float, seconds: int, ahead_s: float):
    """A trajectory with one point, its stamp ahead of now."""
    stamp = robot.graph.now_ns() + round(ahead_s * 1e9)
    message = MultiDOFJointTrajectory(header=header(stamp, "world"), joint_names=["link_1"])
    pose = pose_message(robot.w + [way, 0, 0, 0, 0, 0])
    transform = Transform(rotation=pose.orientation)
    transform.translation = vector([pose.position.x, pose.position.y, pose.position.z])
    point = MultiDOFJointTrajectoryPoint(transforms=[transform])
    point.time_from_start = Duration(sec=seconds)
    message.points = [point]
    return message


def test_paths_and_trajectories_of_others_are_followed_and_take_over(robot, client):
    paths = robot.graph.publisher(topics.HEAD_PATH, wait=True)
    trajectories = robot.graph.publisher(topics.HEAD_TRAJECTORY, wait=True)
    begin = robot.w
    paths.publish(path_ahead(robot, 0.02, 0.2))
    robot.graph.wait_for(
        lambda: any(s.phase == "moving" and s.progress > 0.1 for s in robot.status.messages),
        30.0,
        "motion along the path",
    )
    trajectories.publish(trajectory_ahead(robot, 0.02, seconds=3, ahead_s=2.0))
    assert "head/trajectory took over" in ended(robot, "head/path", Status.PREEMPTED).text
    ended(robot, "head/trajectory", Status.NONE)
    phases = [s.phase for s in robot.status.messages if s.source == "head/trajectory"]
    assert list(dict.fromkeys(phases)) == ["rehearsing", "waiting", "moving", "arriving", "ended"]
    assert jumps(robot) <= 0.0
    assert robot.w[0] > begin[0] + 0.01


def test_stamps_of_a_path_are_kept_and_past_ones_refused(robot, client):
    paths = robot.graph.publisher(topics.HEAD_PATH, wait=True)
    paths.publish(path_ahead(robot, 0.0, 0.02, stamp_s=-10.0, step_s=5.0))
    text = ended(robot, "head/path", Status.INVALID).text
    assert re.search(r"pose 0 is stamped 1\d\S* s in the past", text)
    robot.status.clear()
    message = path_ahead(robot, 0.0, 0.03, stamp_s=3.0, step_s=2.0)
    paths.publish(message)
    ended(robot, "head/path", Status.NONE)
    moving = [s for s in robot.status.messages if s.phase == "moving"]
    arriving = [s for s in robot.status.messages if s.phase == "arriving"]
    assert moving
    # A busy machine loses time, which is not made up for; but none is gained.
    late_s = (stamp_ns(arriving[0]) - stamp_ns(message.poses[-1])) * 1e-9
    assert -0.1 <= late_s < 3.0


def test_the_command_follows_a_file_and_says_how_it_ended(robot, tmp_path):
    def run(text: str, *arguments: str, name: str = "motion.yaml"):
        file = tmp_path / name
        file.write_text(text)
        process = robot.graph.run(TOOL, [str(file), *arguments])
        process.let_end()
        return process

    begin = robot.w
    process = run("[{line: {by: [0.01, 0, 0]}}, return_to_start]", "--speed", "0.03")
    assert process.wait(60.0) == 0, process.output()
    output = process.output()
    assert "moving" in output
    assert "100 %" in output
    assert "arrived; the head is" in output
    np.testing.assert_allclose(robot.w[:3], begin[:3], atol=0.012)

    process = run("x,y,z,roll,pitch,yaw\n0,0,0.4,0,0,0", "--frame", "link_1", name="up.csv")
    assert process.wait(60.0) == 1
    assert "line 2: " in process.output()
    assert "would hold it up after" in process.output()

    robot.references.clear()
    process = run("[{line: {by: [0.2, 0, 0], speed_m_s: 0.03}}]", "--skip-rehearsal")
    robot.graph.wait_for(
        lambda: robot.references.last and robot.references.last.twist.linear.x > 0.02,
        40.0,
        "full speed",
    )
    process.interrupt()
    assert process.wait(20.0) == 1
    assert "canceling" in process.output()
    assert "canceled; the head is" in process.output()
    assert np.linalg.norm(array(robot.references.last.twist.linear)) < 1e-3
    assert jumps(robot) <= 0.0


def test_the_command_refuses_a_wrong_file(tmp_path, capsys):
    file = tmp_path / "motion.yaml"
    file.write_text("[{line: {by: [1]}}]")
    assert head_trajectory.main(["head_trajectory", str(file)]) == 2
    assert f"{file}: segment 1 (line): by = [1.0]: give 3 numbers" in capsys.readouterr().err


def test_the_command_gives_up_without_a_generator(tmp_path):
    file = tmp_path / "motion.yaml"
    file.write_text(THERE_AND_BACK)
    with Graph() as graph:
        process = graph.run(TOOL, [str(file), "--wait", "0.5"])
        process.let_end()
        assert process.wait(20.0) == 1
        assert "is trajectory_generator running?" in process.output()
