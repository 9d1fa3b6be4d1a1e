"""The actions go_to_posture and reshape through all nodes and the mock robot."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from snake_interfaces.action import FollowHeadTrajectory, GoToPosture, Reshape
from snake_interfaces.msg import BusState, ControllerState
from std_srvs.srv import SetBool

from snake_control.config import load
from snake_control.model.bodies import Bodies
from snake_control.nodes import topics
from snake_control.nodes.conversions import header, pose_message, stamp_ns
from snake_control.plant.kinematic import KinematicPlant
from support.action_client import Goals
from support.controller_rig import ControllerRig
from support.graph import CONFIG, Graph
from support.whole_graph import WholeGraph

pytestmark = pytest.mark.real_time

NODE = "scp_controller"
PAPER = load(CONFIG / "paper_robot.yaml")
FLAT = np.zeros(11)
START = np.array(PAPER.robot.start_joint_angles_rad)
Posture = GoToPosture.Result
SUCCEEDED, ABORTED, CANCELED = (
    GoalStatus.STATUS_SUCCEEDED,
    GoalStatus.STATUS_ABORTED,
    GoalStatus.STATUS_CANCELED,
)


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    with WholeGraph(tmp_path_factory.mktemp("postures")) as robot:
        robot.bus = robot.graph.subscribe(topics.BUS_STATE)
        robot.postures = Goals(robot.graph, topics.GO_TO_POSTURE)
        robot.reshapes = Goals(robot.graph, topics.RESHAPE)
        robot.graph.wait_for(lambda: robot.bus.last, 10.0, "the driver")
        yield robot


@pytest.fixture(autouse=True)
def recovered(request):
    """Neither a stopped driver, a goal nor a reference is left to a later test."""
    if "robot" not in request.fixturenames:
        return
    robot = request.getfixturevalue("robot")
    robot.drive(None)
    for goals in (robot.postures, robot.reshapes):
        goals.cancel_last()
    if robot.bus.last.state == BusState.STATE_STOPPED:
        service = topics.RECOVER
        robot.graph.call("bus_driver", service, service.type.Request())
        robot.graph.wait_for(
            lambda: robot.bus.last.state == BusState.STATE_MOVING, 20.0, "the driver again"
        )
    robot.graph.wait_for(
        lambda: "head/reference" in robot.states.last.text, 20.0, "a controller without reference"
    )


def phi(robot) -> np.ndarray:
    return np.array(robot.truth.last.phi)


def wait_status(robot, status: int, *texts: str) -> ControllerState:
    def found():
        last = robot.states.last
        return last.status == status and all(text in last.text for text in texts) and last

    return robot.graph.wait_for(found, 20.0, f"status {status} {texts}")


def at_rest(robot) -> None:
    wait_status(robot, ControllerState.STATUS_STALE, "head/reference")


def bring_to(robot, name: str) -> None:
    """Go where a test begins, whatever the one before has left."""
    status, result = robot.postures.do(posture=name, speed=1.0)
    assert (status, result.code) == (SUCCEEDED, Posture.NONE), result.text


def moving(robot, least: float = 0.1) -> None:
    robot.graph.wait_for(
        lambda: any(f.phase == "moving" and f.progress > least for f in robot.postures.feedback),
        20.0,
        "motion",
    )


def jerks(robot, since_ns: int) -> float:
    """Largest change of a commanded speed beyond what braking at twice the plan's acceleration is.

    From one control step of the move to the next [rad/s]; interruptions are none of its own.
    """
    steps = [s for s in robot.states.messages if stamp_ns(s) > since_ns]
    worst = -np.inf
    for a, b in itertools.pairwise(steps):
        if a.status == b.status == ControllerState.STATUS_POSTURE:
            change = float(np.abs(np.subtract(b.u, a.u)).max())
            worst = max(worst, change - 2.0 * (stamp_ns(b) - stamp_ns(a)) * 1e-9)
    return worst


def test_down_to_lying_flat_and_up_again(robot):
    for name, goal in (("flat", FLAT), ("start", START)):
        begun = robot.graph.now_ns()
        robot.postures.feedback.clear()
        status, result = robot.postures.do(posture=name, speed=0.8)
        assert (status, result.code) == (SUCCEEDED, Posture.NONE), result.text
        assert result.text == "arrived: all joints at once"
        assert result.error <= 0.02
        assert result.worst in PAPER.robot.joint_names
        np.testing.assert_allclose(phi(robot), goal, atol=0.03)
        feedback = robot.postures.feedback
        assert {"moving", "arriving"} <= {f.phase for f in feedback}
        progress = [f.progress for f in feedback]
        assert progress == sorted(progress)
        assert progress[-1] == 1.0
        assert feedback[-1].time_left == 0.0
        truth = robot.truth_after(begun)
        assert not any(state.fallen for state in truth)
        assert min(state.d_min for state in truth) > 0.02
        assert jerks(robot, begun) < 0.1
        states = [s for s in robot.states.messages if stamp_ns(s) > begun]
        while_moving = [s for s in states if s.status == ControllerState.STATUS_POSTURE]
        assert len(while_moving) > 10
        assert all(
            list(s.reasons) == [ControllerState.REASON_JOINT_MOTION] and s.reference_scale == 0.0
            for s in while_moving
        )
        assert f"go_to_posture ({name}): moving" in while_moving[len(while_moving) // 2].text
        assert min(s.d_min for s in while_moving) > 0.02
        # Afterwards it waits for a reference as before.
        robot.graph.wait_for(
            lambda: "head/reference" in robot.states.last.text, 10.0, "waiting for a reference"
        )


REFUSED = [
    ({"posture": "flt"}, Posture.INVALID, "no such posture; there are: flat, start, lying"),
    ({}, Posture.INVALID, "it names no joint"),
    ({"posture": "flat", "name": ["joint_1"], "angle": [0.0]}, Posture.INVALID, "not both"),
    ({"name": ["joint_1"], "angle": []}, Posture.INVALID, "1 names but 0 angles"),
    ({"name": ["joint_12"], "angle": [0.0]}, Posture.INVALID, "joint_1 to joint_11"),
    ({"name": ["joint_2"] * 2, "angle": [0.0] * 2}, Posture.INVALID, "joint_2 given twice"),
    ({"name": ["joint_2"], "angle": [2.59]}, Posture.INVALID, "joint_2 = 2.59 rad: allowed: -2.3"),
    ({"name": ["joint_2"], "angle": [float("nan")]}, Posture.INVALID, "joint_2 = nan rad"),
    ({"posture": "flat", "speed": 5.4}, Posture.INVALID, "speed = 5.4 rad/s: allowed: up to 4.95"),
    ({"posture": "flat", "speed": -1.0}, Posture.INVALID, "speed = -1"),
    ({"posture": "flat", "speed": float("nan")}, Posture.INVALID, "speed = nan"),
    (
        {"name": ["joint_5"], "angle": [-0.5]},
        Posture.UNSAFE,
        "no way leads there: the posture itself: the floor",
    ),
]


@pytest.mark.parametrize(("goal", "code", "words"), REFUSED)
def test_what_cannot_be_is_told_and_nothing_moves(robot, goal, code, words):
    begun = robot.graph.now_ns()
    status, result = robot.postures.do(**goal)
    assert (status, result.code) == (ABORTED, code), result.text
    assert words in result.text
    sent = [c for c in robot.commands.messages if stamp_ns(c) > begun]
    assert not any(np.any(c.velocity) for c in sent)


def test_some_joints_by_name_go_and_the_others_stay(robot):
    bring_to(robot, "start")
    before = phi(robot)
    status, result = robot.postures.do(name=["joint_11", "joint_2"], angle=[0.1, 0.2], speed=1.0)
    assert (status, result.code) == (SUCCEEDED, Posture.NONE), result.text
    goal = before.copy()
    goal[[10, 1]] = 0.1, 0.2
    np.testing.assert_allclose(phi(robot), goal, atol=0.03)


def test_a_canceled_move_slows_down_to_rest(robot):
    bring_to(robot, "start")
    begun = robot.graph.now_ns()
    robot.postures.feedback.clear()
    sent = robot.postures.send(posture="flat", speed=0.8)
    moving(robot, 0.3)
    sent.cancel()
    status, result = sent.result()
    assert (status, result.code) == (CANCELED, Posture.CANCELED)
    assert jerks(robot, begun) < 0.1
    np.testing.assert_array_equal(robot.commands.last.velocity, 0.0)
    assert 0.1 < phi(robot)[4] < 1.0


def test_one_motion_at_a_time(robot):
    bring_to(robot, "start")
    robot.postures.feedback.clear()
    sent = robot.postures.send(posture="flat", speed=0.5)
    moving(robot)
    status, result = robot.postures.do(posture="start")
    assert (status, result.code) == (ABORTED, Posture.NOT_AT_REST)
    assert result.text == "go_to_posture is under way: cancel it first"
    assert not sent.over
    sent.cancel()
    assert sent.result()[1].code == Posture.CANCELED


def test_references_and_motions_of_joints_keep_out_of_each_others_way(robot):
    bring_to(robot, "start")
    robot.drive((0.005, 0.0, 0.0))
    wait_status(robot, ControllerState.STATUS_TRACKING)
    status, result = robot.postures.do(posture="flat")
    assert (status, result.code) == (ABORTED, Posture.NOT_AT_REST)
    assert "stop the reference first" in result.text
    robot.drive(None)
    at_rest(robot)

    # The other way round: a reference that comes meanwhile is not followed, nor afterwards.
    robot.postures.feedback.clear()
    sent = robot.postures.send(posture="lying", speed=0.5)
    moving(robot)
    heads = Goals(robot.graph, topics.FOLLOW_HEAD_TRAJECTORY)
    up = pose_message(robot.w + np.array([0.02, 0.0, 0.0, 0.0, 0.0, 0.0]))
    status, result = heads.do(header=header(0, "world"), poses=[up], skip_rehearsal=True)
    assert (status, result.code) == (ABORTED, FollowHeadTrajectory.Result.STOPPED)
    assert "go_to_posture (lying): moving" in result.text
    robot.drive((0.005, 0.0, 0.0))
    status, result = sent.result()
    assert (status, result.code) == (SUCCEEDED, Posture.NONE), result.text
    wait_status(robot, ControllerState.STATUS_STOPPED, "came while go_to_posture moved the joints")
    np.testing.assert_array_equal(robot.commands.last.velocity, 0.0)
    robot.drive(None)
    at_rest(robot)
    bring_to(robot, "start")
    robot.drive((0.005, 0.0, 0.0))
    wait_status(robot, ControllerState.STATUS_TRACKING)
    robot.drive(None)
    at_rest(robot)


def test_disabling_ends_a_move_at_once(robot):
    bring_to(robot, "start")
    robot.postures.feedback.clear()
    sent = robot.postures.send(posture="flat", speed=0.5)
    moving(robot)
    robot.graph.call(NODE, topics.ENABLE, SetBool.Request(data=False))
    status, result = sent.result()
    assert (status, result.code) == (ABORTED, Posture.STOPPED)
    assert result.text == "disabled by ~/enable"
    status, result = robot.postures.do(posture="flat")
    assert (result.code, result.text) == (Posture.STOPPED, "disabled by ~/enable")
    robot.graph.call(NODE, topics.ENABLE, SetBool.Request(data=True))
    bring_to(robot, "start")


def test_an_emergency_stop_ends_a_move_and_after_its_reset_another_one_may_begin(robot):
    bring_to(robot, "start")
    robot.postures.feedback.clear()
    sent = robot.postures.send(posture="flat", speed=0.5)
    moving(robot)
    stop, reset = topics.EMERGENCY_STOP, topics.RESET_EMERGENCY_STOP
    robot.graph.call("bus_driver", stop, stop.type.Request())
    status, result = sent.result()
    assert (status, result.code) == (ABORTED, Posture.STOPPED)
    assert "bus_driver: emergency stop" in result.text
    stood = phi(robot)
    status, result = robot.postures.do(posture="start")
    assert result.code == Posture.STOPPED
    np.testing.assert_allclose(phi(robot), stood, atol=0.03)
    robot.graph.call("bus_driver", reset, reset.type.Request())
    # The driver waits for a zero command first; the goal waits for the driver.
    wait_status(robot, ControllerState.STATUS_STALE, "head/reference")
    bring_to(robot, "start")


def test_scps_turn_while_the_head_stands_still(robot):
    bring_to(robot, "start")
    begun = robot.graph.now_ns()
    robot.reshapes.feedback.clear()
    w = robot.w
    angles = {"joint_3": 0.2, "joint_8": 0.2, "joint_10": -0.8}
    status, result = robot.reshapes.do(name=list(angles), angle=list(angles.values()), speed=0.2)
    assert (status, result.code) == (SUCCEEDED, Reshape.Result.NONE), result.text
    assert result.error <= 0.02
    assert result.worst in ("joint_3", "joint_6", "joint_8", "joint_10")
    np.testing.assert_allclose(phi(robot)[[2, 7, 9]], [0.2, 0.2, -0.8], atol=0.03)
    # What the motion capture saw, and what was true.
    truth = np.array([state.w for state in robot.truth_after(begun)])
    assert 0.0 < result.head_position_error < 0.01
    assert np.linalg.norm(truth[:, :3] - w[:3], axis=1).max() < 0.01
    assert np.abs(truth[:, 3:] - w[3:]).max() < 0.04
    assert not any(state.fallen for state in robot.truth_after(begun))
    feedback = robot.reshapes.feedback
    assert feedback[0].phase == "moving"
    assert feedback[-1].progress == 1.0
    assert any("tracking" in f.controller or "scaled" in f.controller for f in feedback)
    states = [
        s
        for s in robot.states.messages
        if stamp_ns(s) > begun and s.status == ControllerState.STATUS_RESHAPING
    ]
    assert len(states) > 50
    assert all(s.reasons[0] == ControllerState.REASON_JOINT_MOTION for s in states)
    assert all(s.reference_scale == 0.0 for s in states)
    assert np.isfinite([s.v_b1 for s in states]).all()


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        (
            {"name": ["joint_8", "joint_7", "joint_1"], "angle": [0.0] * 3},
            "no SCP: joint_7, joint_1; the SCPs are joint_3, joint_6, joint_8, joint_10",
        ),
        ({"name": ["joint_12"], "angle": [0.0]}, "joint_12 is no joint"),
        ({"name": ["joint_8"], "angle": [2.6]}, "joint_8 = 2.6 rad: allowed: -2.3"),
        ({}, "it names no joint"),
    ],
)
def test_what_is_no_scp_is_told_with_those_that_are(robot, goal, words):
    status, result = robot.reshapes.do(**goal)
    assert (status, result.code) == (ABORTED, Reshape.Result.INVALID)
    assert words in result.text


def test_a_body_about_to_curl_into_itself_ends_a_reshape_and_a_cancellation_does(robot):
    bring_to(robot, "start")
    sent = robot.reshapes.send(name=["joint_8"], angle=[-2.3], speed=1.0)
    status, result = robot.postures.do(posture="flat")
    assert (status, result.code) == (ABORTED, Posture.NOT_AT_REST)
    assert result.text == "reshape is under way: cancel it first"
    status, result = sent.result()
    assert (status, result.code) == (ABORTED, Reshape.Result.STOPPED)
    assert result.text.startswith("the robot itself (two links would be")
    # Where they meet depends on how the rest of the body came along; stopping takes a moment.
    assert -2.2 < phi(robot)[7] < -1.7
    assert Bodies(PAPER.robot, phi(robot)).self_clearance > -0.005

    robot.reshapes.feedback.clear()
    bring_to(robot, "start")
    sent = robot.reshapes.send(name=["joint_10"], angle=[0.5], speed=0.3)
    robot.graph.wait_for(
        lambda: any(f.progress > 0.2 for f in robot.reshapes.feedback), 20.0, "motion"
    )
    sent.cancel()
    status, result = sent.result()
    assert (status, result.code) == (CANCELED, Reshape.Result.CANCELED)
    np.testing.assert_array_equal(robot.commands.last.velocity, 0.0)
    assert phi(robot)[9] < 0.4


class Perfect:
    """A robot that does each command for a cycle, as messages of a rig.

    Attributes:
        share: how much of it each joint does.
        state: of the plant.
    """

    def __init__(self, rig: ControllerRig, phi: np.ndarray) -> None:
        self.rig, self.share, self._seen = rig, np.ones(len(phi)), 0
        self._plant = KinematicPlant(PAPER.robot, 0.01)
        self.state = self._plant.reset(phi)
        rig.head, self.head = None, rig.head
        rig.reference = None
        self._show(rig.joint_states)
        rig.graph.every(0.02, self._move)

    def _move(self) -> None:
        rig, shown = self.rig, self.rig.joint_states
        if shown is None:
            return
        for command in rig.commands.messages[self._seen :]:
            self._seen += 1
            self.state = self._plant.step(self.share * np.array(command.velocity), 0.02)
        self._show(shown)

    def _show(self, joint_states) -> None:
        joint_states.position = [9.0, *self.state.phi[::-1].tolist()]
        self.head.pose.pose = pose_message(self.state.w)


def test_it_needs_joint_states_alone_and_stops_without_them():
    with Graph() as graph:
        rig = ControllerRig(graph)
        robot = Perfect(rig, FLAT)
        rig.joint_states, kept = None, rig.joint_states
        own = {"postures.bent_2": [0.1], "posture_patience_s": 1.0}
        graph.start(NODE, params_files=[CONFIG / "paper_robot.yaml"], params=own)
        goals = Goals(graph, topics.GO_TO_POSTURE)
        status, result = goals.do(posture="start")
        assert (status, result.code) == (ABORTED, Posture.NO_INPUT)
        assert result.text == "waiting for joint_states"
        rig.joint_states = kept
        status, result = goals.do(posture="start", speed=1.0)
        assert (status, result.code) == (SUCCEEDED, Posture.NONE), result.text
        np.testing.assert_allclose(robot.state.phi, START, atol=0.03)
        assert not robot.state.fallen

        goals.feedback.clear()
        sent = goals.send(posture="flat", speed=0.5)
        graph.wait_for(lambda: any(f.progress > 0.2 for f in goals.feedback), 20.0, "motion")
        rig.joint_states = None
        status, result = sent.result()
        assert (status, result.code) == (ABORTED, Posture.STOPPED)
        assert result.text.startswith("joint_states is 0.")
        # No motion was commanded later than the time-out after the last input.
        limit = rig.last_stamp_ns[topics.JOINT_STATES.name] + 0.1e9
        late = [c for c in rig.commands.messages if stamp_ns(c) > limit]
        assert late
        assert not any(np.any(c.velocity) for c in late)

        # A short silence only interrupts a move.
        rig.joint_states = kept
        goals.feedback.clear()
        sent = goals.send(posture="bent_2", speed=0.5)
        graph.wait_for(lambda: any(f.progress > 0.2 for f in goals.feedback), 20.0, "motion")
        rig.joint_states = None
        rig.wait_status(ControllerState.STATUS_STALE, what="the silence")
        rig.joint_states = kept
        status, result = sent.result()
        assert (status, result.code) == (SUCCEEDED, Posture.NONE), result.text

        np.testing.assert_allclose(robot.state.phi, 0.1, atol=0.03)

        # What holds the head needs to know where it is.
        status, result = Goals(graph, topics.RESHAPE).do(name=["joint_8"], angle=[0.3])
        assert (status, result.code) == (ABORTED, Reshape.Result.NO_INPUT)
        assert result.text == "waiting for head/odometry"

        rig.head = robot.head
        goals.do(posture="start", speed=1.0)
        w = robot.state.w
        status, result = Goals(graph, topics.RESHAPE).do(name=["joint_8"], angle=[0.2], speed=0.3)
        assert (status, result.code) == (SUCCEEDED, Reshape.Result.NONE), result.text
        assert robot.state.phi[7] == pytest.approx(0.2, abs=0.02)
        # Not in lockstep: what is measured is some cycles old, how many the machine decides.
        assert 0.0 < result.head_position_error < 6e-3
        assert 0.0 < result.head_rotation_error < 0.015
        np.testing.assert_allclose(robot.state.w[:3], w[:3], atol=6e-3)
        np.testing.assert_allclose(robot.state.w[3:], w[3:], atol=0.015)
        robot.share[7] = 0.0
        status, result = Goals(graph, topics.RESHAPE).do(name=["joint_8"], angle=[0.6], speed=0.3)
        assert (status, result.code) == (ABORTED, Reshape.Result.STOPPED)
        assert result.text.startswith("joint_8 is 0.")
        assert "and does not come nearer; the controller: " in result.text
        robot.share[7] = 1.0
        rig.head = None

        # A joint that is stuck: the others wait for it, and it is named.
        rig.joint_states = kept
        robot.share[6] = 0.0
        status, result = goals.do(posture="flat", speed=0.5)
        assert (status, result.code) == (ABORTED, Posture.STOPPED)
        assert result.text.startswith("joint_7 is 0.")
        assert result.text.endswith("and does not come nearer")

        # Nor does an angle that means nothing end the node.
        robot.share[6] = 1e300
        status, result = goals.do(posture="flat", speed=0.5)
        assert (status, result.code) == (ABORTED, Posture.STOPPED)
        assert "this posture has no answer: q[12] = " in result.text
