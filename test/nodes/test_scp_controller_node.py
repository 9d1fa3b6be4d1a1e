"""The controller node on real DDS: what it commands, and that it commands zero when in doubt."""

import math
import os

import numpy as np
import pytest
from snake_interfaces.msg import BusState, ControllerState
from std_srvs.srv import SetBool

from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ScpController
from snake_control.model.floor import head_pose_on_floor
from snake_control.nodes import topics
from snake_control.nodes.conversions import pose_message, reference_message, stamp_ns
from support.clock import SettableClock
from support.controller_rig import GOOD, ControllerRig
from support.graph import CONFIG, Graph

PAPER_ROBOT = CONFIG / "paper_robot.yaml"
NODE = "scp_controller"
STEP_NS = 20_000_000


@pytest.fixture(scope="module")
def shared_rig():
    with Graph() as graph:
        rig = ControllerRig(graph)
        rig.joint_states = rig.head = rig.reference = None
        graph.start(NODE, params_files=[PAPER_ROBOT])
        state = rig.wait_status(ControllerState.STATUS_WAITING, what="the node waiting")
        for topic in (topics.JOINT_STATES, topics.HEAD_ODOMETRY, topics.HEAD_REFERENCE):
            assert f"waiting for {topic.name}" in state.text
        yield rig


@pytest.fixture
def rig(shared_rig):
    shared_rig.repair()
    shared_rig.wait_status(*GOOD, what="tracking with good inputs")
    return shared_rig


def is_zero(command):
    return not np.any(command.velocity)


def test_commands_what_the_control_law_says(rig):
    # The acceleration limit has done its part by then.
    state = rig.wait_status(ControllerState.STATUS_TRACKING, what="tracking")
    command = rig.command_of(state)
    expected = ScpController(rig.config.robot, rig.config.controller).step(
        np.concatenate([rig.w, rig.phi]), None, rig.table_1, 0.0
    )
    assert list(command.name) == list(rig.config.robot.joint_names)
    np.testing.assert_allclose(command.velocity, expected.u, rtol=1e-6, atol=1e-9)
    assert not is_zero(command)
    np.testing.assert_allclose(state.u, expected.u, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(state.u_unlimited, expected.u_unlimited, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(state.w, rig.w, atol=1e-12)
    np.testing.assert_allclose(state.w_d, rig.table_1.w_d, atol=1e-12)
    np.testing.assert_allclose(state.error, expected.error, atol=1e-12)
    np.testing.assert_allclose(state.phi, rig.phi, atol=1e-15)
    np.testing.assert_allclose(state.phi_tilde_dot_d, expected.phi_tilde_dot_d, rtol=1e-6)
    assert list(state.scp_name) == ["joint_3", "joint_6", "joint_8", "joint_10"]
    assert (state.experiment_case, state.preset) == (3, "paper")
    assert state.v_h == pytest.approx(5.8775e-7, rel=1e-4)
    assert state.v_b1 == pytest.approx(2.4757e8, rel=1e-4)
    assert state.d_min == pytest.approx(0.034238, abs=1e-6)
    assert state.singular_nearness == pytest.approx(expected.singular_shape.nearness, rel=1e-6)
    assert state.damping == 0.0
    assert state.singular_shape == expected.singular_shape.kind
    assert 0 <= state.head_age < 0.1


SILENCE = [
    ("joint_states", topics.JOINT_STATES, 0.1),
    ("head", topics.HEAD_ODOMETRY, 0.1),
    ("reference", topics.HEAD_REFERENCE, 0.2),
]


@pytest.mark.parametrize(("attribute", "topic", "timeout"), SILENCE)
def test_silence_of_an_input_stops_the_joints_in_time(rig, attribute, topic, timeout):
    setattr(rig, attribute, None)
    state = rig.wait_status(
        ControllerState.STATUS_STALE,
        what=f"{topic.name} stale",
        texts=[f"{topic.name} is", f"limit {timeout:g} s"],
    )
    assert is_zero(rig.command_of(state))
    # By stamps: no motion is commanded later than the time-out after the last input.
    limit = rig.last_stamp_ns[topic.name] + timeout * 1e9
    late = [c for c in rig.commands.messages if stamp_ns(c) > limit]
    assert late
    assert all(is_zero(c) for c in late)
    # And every step still sends a command.
    before = len(rig.commands.messages)
    rig.graph.wait_for(lambda: len(rig.commands.messages) > before + 10, 10.0, "ten more commands")


def nan_position(rig):
    rig.joint_states.position[3] = math.nan  # names run backwards: joint_9


def missing_joint(rig):
    rig.joint_states.name[3] = "other"


def nan_head(rig):
    rig.head.pose.pose.position.y = math.nan


def no_rotation(rig):
    rig.head.pose.pose.orientation.w = 7.0


def nan_head_twist(rig):
    rig.head.twist.twist.angular.x = math.inf


def wrong_head_frame(rig):
    rig.head.header.frame_id = "map"


def nan_reference(rig):
    rig.reference.pose.position.z = math.nan


def nan_reference_twist(rig):
    rig.reference.twist.linear.x = math.nan


def head_from_the_future(rig):
    rig.stamp_offset_ns[topics.HEAD_ODOMETRY.name] = 3_000_000_000


@pytest.mark.parametrize(
    ("spoil", "texts"),
    [
        (nan_position, ["joint_states", "position of joint_9 is nan"]),
        (missing_joint, ["joint_states", "joint_9 missing"]),
        (nan_head, ["head/odometry", "position"]),
        (no_rotation, ["head/odometry", "quaternion"]),
        (nan_head_twist, ["head/odometry", "twist"]),
        (wrong_head_frame, ["head/odometry", "'map'", "'world'"]),
        (nan_reference, ["head/reference", "position"]),
        (nan_reference_twist, ["head/reference", "twist"]),
        (head_from_the_future, ["head/odometry", "ahead of this computer's clock"]),
    ],
)
def test_a_bad_input_stops_the_joints_and_is_named(rig, spoil, texts):
    spoil(rig)
    state = rig.wait_status(
        ControllerState.STATUS_INVALID, what=f"{spoil.__name__} noticed", texts=texts
    )
    assert is_zero(rig.command_of(state))
    rig.repair()
    rig.wait_status(*GOOD, what="tracking after the repair")


def far_reference(rig):
    rig.reference.pose.position.x += 1.0


def millimetres(rig):
    rig.head.pose.pose.position.x = 300.0


def turned_reference(rig):
    w_d = rig.table_1.w_d.copy()
    w_d[5] += 2.8
    rig.reference.pose = pose_message(w_d)


@pytest.mark.parametrize(
    ("spoil", "texts"),
    [
        (far_reference, ["m from its reference", "limit max_position_error_m = 0.3"]),
        (millimetres, ["300 m from its reference"]),
        (turned_reference, ["yaw", "2.8 rad", "limit max_rotation_error_rad = 2.5"]),
    ],
)
def test_a_head_far_from_its_reference_does_not_lunge_after_it(rig, spoil, texts):
    spoil(rig)
    state = rig.wait_status(
        ControllerState.STATUS_ERROR_TOO_LARGE, what=f"{spoil.__name__} noticed", texts=texts
    )
    assert is_zero(rig.command_of(state))
    np.testing.assert_allclose(state.error[:3], np.subtract(state.w, state.w_d)[:3], atol=1e-12)
    assert math.isnan(state.v_h)
    rig.repair()
    rig.wait_status(*GOOD, what="tracking after the repair")


def test_enable_service(rig):
    response = rig.graph.call(NODE, topics.ENABLE, SetBool.Request(data=False))
    assert response.success
    state = rig.wait_status(ControllerState.STATUS_DISABLED, what="disabled")
    assert "~/enable" in state.text
    assert is_zero(rig.command_of(state))
    assert rig.graph.call(NODE, topics.ENABLE, SetBool.Request(data=True)).success
    rig.wait_status(*GOOD, what="tracking again")


def test_a_straight_robot_is_said_to_be_singular_and_moves_within_its_limits(rig):
    w, phi = rig.w, rig.phi
    try:
        rig.phi = np.zeros(len(phi))
        rig.w = head_pose_on_floor(rig.config.robot, rig.phi, np.zeros(3))
        rig.repair()
        at_the_head = Reference(rig.w, rig.table_1.w_d_dot)
        rig.reference = reference_message(at_the_head, 0, "world")
        state = rig.wait_status(
            ControllerState.STATUS_LIMITED,
            ControllerState.STATUS_HOLDING,
            what="the singular posture",
            texts=["singular head posture", "singular shape of the body (parallel"],
        )
    finally:
        rig.w, rig.phi = w, phi
        rig.repair()
    velocity = np.array(rig.command_of(state).velocity)
    assert np.isfinite(velocity).all()
    assert (np.abs(velocity) <= rig.config.robot.joint_speed_limits_rad_s).all()
    rig.wait_status(*GOOD, what="tracking in the old posture")


def test_a_head_that_is_in_the_floor_by_its_joints_rests_and_names_what_to_check(rig):
    w, phi = rig.w, rig.phi
    try:
        # Joint 5 of a head that is raised, with the wrong sign.
        rig.phi = phi * np.where(np.arange(len(phi)) == 4, -1.0, 1.0)
        rig.w = head_pose_on_floor(rig.config.robot, rig.phi, np.zeros(3))
        rig.repair()
        downwards = Reference(rig.w, np.array([0.0, 0.0, -0.05, 0.0, 0.0, 0.0]))
        rig.reference = reference_message(downwards, 0, "world")
        state = rig.wait_status(
            ControllerState.STATUS_HOLDING,
            what="holding above the floor",
            texts=["by the joint angles link 1 is", "check directions, zeros and order"],
        )
        assert ControllerState.REASON_FLOOR in state.reasons
    finally:
        rig.w, rig.phi = w, phi
        rig.repair()
    rig.wait_status(*GOOD, what="tracking in the old posture")


def test_yaw_goes_on_across_half_a_turn(rig):
    for k in range(24):
        # A full turn and a half in steps of 30 degrees, of robot and reference alike.
        yaw = math.radians(30 * k)
        rig.w[5] = yaw
        rig.repair()
        state = rig.graph.wait_for(
            lambda yaw=yaw: (last := rig.states.last) and abs(last.w[5] - yaw) < 1e-9 and last,
            10.0,
            f"yaw {yaw:.2f}",
        )
    assert state.w[5] == pytest.approx(math.radians(690))
    assert abs(state.error[5]) <= math.pi
    rig.w[5] = 0.0


def test_every_step_at_rest_was_a_zero_and_no_other_without_a_reason(shared_rig):
    """Over everything that the tests above did.

    A limit may allow no motion at all; a robot that holds its head may move its SCPs away from one.
    """
    zero = {stamp_ns(c): is_zero(c) for c in shared_rig.commands.messages}
    states = [state for state in shared_rig.states.messages if stamp_ns(state) in zero]
    driven = [state for state in states if state.status in GOOD]
    at_rest = [
        state for state in states if state.status not in (*GOOD, ControllerState.STATUS_HOLDING)
    ]
    assert len(driven) > 10
    assert len(at_rest) > 10
    moved = [(state.status, state.text) for state in at_rest if not zero[stamp_ns(state)]]
    assert not moved
    stood = [(state.status, state.text) for state in driven if zero[stamp_ns(state)]]
    explained = [
        (state.status, state.text) for state in driven if zero[stamp_ns(state)] and state.reasons
    ]
    assert stood == explained


def test_commands_come_at_the_configured_rate(rig):
    rig.commands.clear()
    rig.graph.wait_for(lambda: len(rig.commands.messages) > 100, 30.0, "100 commands")
    periods = np.diff([stamp_ns(c) for c in rig.commands.messages])
    assert np.median(periods) == pytest.approx(STEP_NS, rel=0.25)


def test_markers_show_robot_and_reference(rig):
    markers = rig.graph.subscribe(topics.MARKERS)
    rig.graph.wait_for(lambda: markers.last, 10.0, "markers")
    found = {(marker.ns, marker.id): marker for marker in markers.last.markers}
    tip = found["head_axis", 0].points[0]
    np.testing.assert_allclose([tip.x, tip.y, tip.z], rig.w[:3], atol=1e-9)
    target = found["reference", 0].points[1]
    np.testing.assert_allclose([target.x, target.y, target.z], rig.table_1.w_d[:3], atol=1e-9)
    assert {ns for ns, _ in found} >= {"links", "wheels", "support_polygon", "P_G", "status"}
    state = rig.states.last
    assert found["status", 0].text.endswith(f"\nd_min {1e3 * state.d_min:.1f} mm")
    assert {marker.header.frame_id for marker in found.values()} == {"world"}


def test_a_head_out_of_this_world_is_not_drawn(rig):
    markers = rig.graph.subscribe(topics.MARKERS)
    rig.head.pose.pose.position.x = 1e300
    rig.wait_status(ControllerState.STATUS_ERROR_TOO_LARGE, what="the far head noticed")
    rig.graph.wait_for(
        lambda: markers.last and [m.ns for m in markers.last.markers] == ["reference", "status"],
        10.0,
        "markers without the robot",
    )
    rig.repair()
    rig.wait_status(*GOOD, what="tracking after the repair")


def test_a_joint_that_has_turned_too_far_to_mean_anything_is_named(rig):
    rig.joint_states.position[3] = 1e300
    state = rig.wait_status(
        ControllerState.STATUS_FAULT, what="the angle noticed", texts=["q[14] = 1e+300"]
    )
    assert is_zero(rig.command_of(state))
    rig.repair()
    rig.wait_status(*GOOD, what="tracking after the repair")


SUB_TASKS_WITHOUT_ANSWER = """
import numpy as np
from snake_control.control.sub_tasks import SubTask

class Divides(SubTask):
    def value(self, posture):
        return 0.0

    def gradient(self, posture):
        # They are tried at the start posture before they are taken.
        if posture.g.q[0] > 1.0:
            self.fail(posture)
        return np.zeros(len(posture.g.q))

    def fail(self, posture):
        1.0 / self.value(posture)

class Solves(Divides):
    def fail(self, posture):
        np.linalg.solve(np.zeros((17, 17)), posture.g.q)

class Spoils(Divides):
    def fail(self, posture):
        posture.k.base
        posture.g.middles[:] = np.nan
"""


def test_arithmetic_that_fails_stops_the_joints_and_not_the_node(tmp_path, monkeypatch):
    """In the control law; or, with Spoils, in what the state says of the posture."""
    (tmp_path / "no_answer.py").write_text(SUB_TASKS_WITHOUT_ANSWER)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    with Graph() as graph:
        rig = ControllerRig(graph)
        graph.start(NODE, params_files=[PAPER_ROBOT])
        rig.w[0] += 2.0
        rig.table_1.w_d[0] += 2.0
        rig.repair()
        rig.wait_status(*GOOD, what="tracking")
        for name, text in (
            ("Divides", "float division by zero"),
            ("Solves", "Singular matrix"),
            ("Spoils", "did not converge"),
        ):
            tasks = [f"no_answer:{name}"]
            (result,) = graph.set_parameters(NODE, controller__base_sub_tasks=tasks).values()
            assert result.successful, result.reason
            state = rig.wait_status(
                ControllerState.STATUS_FAULT, what=name, texts=["has no answer", text]
            )
            assert not np.any(state.u)
            same = [c for c in rig.commands.messages if c.header.stamp == state.header.stamp]
            assert is_zero(same[-1])
        graph.set_parameters(NODE, controller__base_sub_tasks=["fall"])
        rig.wait_status(*GOOD, what="tracking again")


def test_speed_limit_is_named():
    with Graph() as graph:
        rig = ControllerRig(graph)
        graph.start(
            NODE, params_files=[PAPER_ROBOT], params={"robot.joint_speed_limits_rad_s": [0.05]}
        )
        state = rig.wait_status(ControllerState.STATUS_LIMITED, what="the speed limit")
        command = rig.command_of(state)
        assert np.abs(command.velocity).max() == pytest.approx(0.05)
        assert len(state.speed_limited) == 1
        assert state.speed_limited[0] in state.text
        assert state.speed_scale < 1
        assert state.feedback_scale < 1
        assert ControllerState.REASON_JOINT_SPEED in state.reasons


class Driver:
    """Says at 50 Hz what a bus driver does."""

    def __init__(self, graph: Graph) -> None:
        self._publisher = graph.publisher(topics.BUS_STATE)
        self.state, self.text = BusState.STATE_HOLDING, "holding: waiting for a zero command"
        graph.every(0.02, self._publish)

    def _publish(self) -> None:
        self._publisher.publish(BusState(state=self.state, text=self.text))


def test_it_heeds_what_the_bus_driver_does():
    with Graph() as graph:
        rig, driver = ControllerRig(graph), Driver(graph)
        graph.start(NODE, params_files=[PAPER_ROBOT])
        graph.wait_for(lambda: rig.commands.last, 30.0, "a command")
        state = rig.wait_status(
            ControllerState.STATUS_WAITING,
            what="a driver that wants a zero command",
            texts=["bus_driver: holding: waiting for a zero command"],
        )
        assert list(state.reasons) == [ControllerState.REASON_BUS]
        assert state.reference_scale == 0.0, "the reference has to wait"
        assert is_zero(rig.command_of(state))
        driver.state, driver.text = BusState.STATE_MOVING, "moving"
        assert rig.wait_status(*GOOD, what="tracking").reference_scale == 1.0
        driver.state, driver.text = BusState.STATE_STOPPED, "joint_3 shut down; needs ~/recover"
        state = rig.wait_status(
            ControllerState.STATUS_STOPPED, what="the driver's stop", texts=["joint_3 shut down"]
        )
        assert is_zero(rig.command_of(state))
        # Recovered; the reference goes on all the time.
        driver.state, driver.text = BusState.STATE_MOVING, "moving"
        rig.wait_status(
            ControllerState.STATUS_STOPPED,
            what="a reference that has to be started again",
            texts=["was stopped (bus_driver: joint_3 shut down", "start it again"],
        )
        rig.reference = None
        state = rig.wait_status(ControllerState.STATUS_STALE, what="the end of the reference")
        assert state.reference_scale == 1.0, "a reference may begin"
        rig.repair()
        rig.wait_status(*GOOD, what="tracking again")


def test_a_reference_whose_time_scale_is_none_is_named(rig):
    rig.reference.time_scale = 1.5
    rig.wait_status(
        ControllerState.STATUS_INVALID, what="the time scale", texts=["time_scale is 1.5"]
    )
    rig.repair()
    rig.wait_status(*GOOD, what="tracking after the repair")


def test_commands_go_on_when_the_clock_is_set_back_and_stands():
    with Graph() as graph:
        clock = SettableClock(graph)
        rig = ControllerRig(graph)
        graph.start(NODE, params_files=[PAPER_ROBOT], params={"use_sim_time": True})
        clock.wait_for_listener()
        rig.wait_status(*GOOD, what="tracking")
        clock.offset_s = -3600.0
        graph.wait_for(
            lambda: stamp_ns(rig.commands.last) < graph.now_ns() - 3.5e12, 10.0, "the new time"
        )
        clock.freeze()
        count = len(rig.commands.messages)
        graph.wait_for(lambda: len(rig.commands.messages) > count + 50, 10.0, "more commands")
        # Its inputs are stamped by a clock that is an hour ahead now.
        assert rig.states.last.status == ControllerState.STATUS_INVALID
        assert is_zero(rig.commands.last)


def test_the_last_command_of_a_stopped_controller_is_rest():
    with Graph() as graph:
        rig = ControllerRig(graph)
        process = graph.start(NODE, params_files=[PAPER_ROBOT])
        rig.wait_status(*GOOD, what="tracking")
        process.interrupt()
        assert process.wait() == 0
        graph.wait_for(lambda: is_zero(rig.commands.last), 5.0, "a zero as last command")
