import os

import dynamixel_sdk as sdk
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snake_control.model.rotation import rotation_from_rpy
from snake_control.nodes.topics import CLEAR_FAULTS, INJECT_FAULT, MOCAP_POSE, PLANT_STATE
from support.graph import CONFIG, Graph
from support.waiting import wait_for

PAPER_ROBOT = CONFIG / "paper_robot.yaml"
START = [-0.11, 0.0, 0.0, 0.0, 1.1, -np.pi / 9, np.pi / 6, np.pi / 6, -np.pi / 9, -np.pi / 6]
START.append(-np.pi / 10)
PACKETS = sdk.PacketHandler(1.0)


@pytest.fixture
def graph():
    with Graph() as made:
        yield made


@pytest.fixture
def link(tmp_path):
    return tmp_path / "bus"


def start(graph, link, **params):
    process = graph.start(
        "mock_bus", params_files=[PAPER_ROBOT], params={"port": str(link), **params}
    )
    graph.wait_for(lambda: link.is_symlink() or not process.running, 30.0, "the port's link")
    return process


def open_port(link):
    port = sdk.PortHandler(str(link))
    assert port.setBaudRate(1_000_000)
    return port


def seconds(message) -> float:
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9


def test_motion_capture_has_its_rate_noise_and_delay(graph, link):
    poses = graph.subscribe(MOCAP_POSE)
    truths = graph.subscribe(PLANT_STATE)
    arrivals = []
    graph.node.create_subscription(
        MOCAP_POSE.type,
        MOCAP_POSE.name,
        lambda m: arrivals.append(graph.node.get_clock().now().nanoseconds * 1e-9 - seconds(m)),
        MOCAP_POSE.qos,
    )
    start(graph, link, mocap_delay_s=0.05, seed=5)
    count = 400
    graph.wait_for(lambda: len(poses.messages) > count and truths.messages, 60.0, "400 poses")

    w = np.array(truths.last.w)
    messages = poses.messages
    stamps = np.array([seconds(m) for m in messages])
    assert np.median(np.diff(stamps)) == pytest.approx(0.01, rel=0.1)
    assert (np.diff(stamps) > 0).all()
    # Nothing is early; how late a busy machine makes it is not the mock's affair.
    assert 0.05 - 1e-3 < np.median(arrivals) < 0.15

    points = np.array([[m.pose.position.x, m.pose.position.y, m.pose.position.z] for m in messages])
    offsets = points - w[:3]
    quaternions = [m.pose.orientation for m in messages]
    measured = Rotation.from_quat([[q.x, q.y, q.z, q.w] for q in quaternions])
    turns = (measured * Rotation.from_matrix(rotation_from_rpy(w[3:])).inv()).as_rotvec()
    for errors, deviation in ((offsets, 0.0005), (turns, 0.002)):
        np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=5 * deviation / count**0.5)
        np.testing.assert_allclose(errors.std(axis=0), deviation, rtol=5 / (2 * count) ** 0.5)
    assert {m.header.frame_id for m in messages} == {"world"}


def test_the_ground_truth_is_the_start_posture_until_torque_is_on(graph, link):
    truths = graph.subscribe(PLANT_STATE)
    start(graph, link)
    graph.wait_for(lambda: len(truths.messages) > 40, 30.0, "40 ground truths")

    truth = truths.last
    assert list(truth.name) == [f"joint_{i}" for i in range(1, 12)]
    np.testing.assert_allclose(truth.phi, START, atol=1e-12)
    assert list(truth.wheeled_link) == [6, 8, 10, 12]
    assert truth.w[2] == pytest.approx(0.3193, abs=1e-3)
    assert truth.effort[4] > 0.2
    assert truth.d_min == pytest.approx(0.0342, abs=1e-3)
    assert not truth.fallen
    assert np.isnan(truth.fallen_at)
    stamps = [seconds(m) for m in truths.messages]
    assert np.median(np.diff(stamps)) == pytest.approx(0.02, rel=0.1)


def test_servos_stand_where_the_joints_start_and_move_the_body(graph, link):
    truths = graph.subscribe(PLANT_STATE)
    start(graph, link, **{"servos.directions": [1, -1] + [1] * 9})
    port = open_port(link)

    def position(servo_id):
        data, result, _ = PACKETS.readTxRx(port, servo_id, 36, 2)
        return data[0] | data[1] << 8 if result == sdk.COMM_SUCCESS and len(data) == 2 else None

    for servo_id, angle in enumerate(START, start=1):
        ticks = wait_for(lambda i=servo_id: position(i), 10.0, f"servo {servo_id}")
        assert ticks == pytest.approx(512 + np.degrees(angle) / (300 / 1023), abs=0.51)

    group = sdk.GroupSyncWrite(port, PACKETS, 24, 1)
    for servo_id in range(1, 12):
        group.addParam(servo_id, bytes((1,)))
    group.txPacket()
    # Against its joint's direction: clockwise 50 ticks are +14.7 degrees of joint 2.
    PACKETS.write2ByteTxOnly(port, 2, 30, 512 - 50)

    wanted = np.radians(50 * 300 / 1023)
    graph.wait_for(
        lambda: truths.last and abs(truths.last.phi[1] - wanted) < 0.03, 20.0, "joint 2 at its goal"
    )
    port.closePort()
    # The raised head is heavy: the servo that carries it droops.
    graph.wait_for(lambda: truths.last.phi[4] < 1.1 - 0.01, 10.0, "joint 5 drooping")
    assert truths.last.phi[4] > 1.0


def test_without_a_hand_that_holds_it_the_head_sinks_before_torque(graph, link):
    truths = graph.subscribe(PLANT_STATE)
    start(graph, link, held_until_torque_on=False)

    graph.wait_for(lambda: truths.last and truths.last.phi[4] < 1.0, 30.0, "the head sinking")


@pytest.mark.parametrize("way", ["interrupt", "terminate"])
def test_a_signal_ends_it_and_takes_its_link_away(graph, link, way):
    process = start(graph, link)
    getattr(process, way)()

    assert process.wait(10.0) == 0
    assert not os.path.lexists(link)
    assert "Traceback" not in process.output()


def test_after_a_kill_the_next_one_takes_the_link_over(graph, link):
    process = start(graph, link)
    process.kill()
    process.wait(10.0)
    stale = os.readlink(link)

    start(graph, link, held_until_torque_on=True)
    graph.wait_for(lambda: os.readlink(link) != stale or os.path.exists(link), 30.0, "a new port")
    port = open_port(link)
    wait_for(lambda: PACKETS.ping(port, 1)[1] == sdk.COMM_SUCCESS, 10.0, "an answer")
    port.closePort()


def test_an_occupied_path_is_a_clear_error(graph, link):
    link.write_text("keep me")
    process = graph.start("mock_bus", params_files=[PAPER_ROBOT], params={"port": str(link)})

    assert process.wait(30.0) == 1
    assert "no symbolic link" in process.output()
    assert "Traceback" not in process.output()


def test_faults_come_and_go_by_service(graph, link):
    start(graph, link)
    port = open_port(link)

    def answers(servo_id):
        return PACKETS.ping(port, servo_id)[1] == sdk.COMM_SUCCESS

    def inject(**fields):
        return graph.call("mock_bus", INJECT_FAULT, INJECT_FAULT.type.Request(**fields))

    wait_for(lambda: answers(2), 10.0, "an answer")
    response = inject(fault="no_reply", ids=[2])
    assert (response.success, response.message) == (True, "no_reply servo 2 until cleared")
    assert not answers(2)
    wait_for(lambda: answers(3), 10.0, "an answer of another servo")
    for fields, why in (
        ({"fault": "gremlins"}, "known are no_reply"),
        ({"fault": "no_reply", "ids": [99]}, "on the bus are"),
        ({"fault": "late_reply", "value": 99.0}, "delay [s]"),
        ({"fault": "pose_jump", "ids": [2]}, "concerns the motion capture"),
    ):
        refused = inject(**fields)
        assert not refused.success
        assert why in refused.message
    cleared = graph.call("mock_bus", CLEAR_FAULTS, CLEAR_FAULTS.type.Request())
    assert (cleared.success, cleared.message) == (True, "1 faults ended")
    wait_for(lambda: answers(2), 10.0, "an answer again")
    port.closePort()


@pytest.mark.parametrize(
    ("params", "field"),
    [
        ({"mocap_rate_hz": 500.0}, "mocap_rate_hz"),
        ({"friction_torque_nm": 2.0}, "friction_torque_nm"),
        ({"servos.zero_offsets_rad": [2.6]}, "robot.joint_limits_rad"),
        # In wheel mode a joint may turn beyond the sensor's range, but not start there.
        (
            {"servos.zero_offsets_rad": [2.6], "servos.velocity_modes": ["wheel"]},
            "start_joint_angles_rad[4]",
        ),
    ],
)
def test_a_configuration_that_cannot_be_is_refused(graph, link, params, field):
    process = graph.start(
        "mock_bus", params_files=[PAPER_ROBOT], params={"port": str(link), **params}
    )

    assert process.wait(30.0) != 0
    assert field in process.output()
    assert not os.path.lexists(link)
