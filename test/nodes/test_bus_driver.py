"""The driver as a process, on real DDS, against the mock servos as another process."""

from __future__ import annotations

import itertools
import math
import statistics
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("snake_interfaces")

from diagnostic_msgs.msg import DiagnosticStatus
from snake_interfaces.msg import BusState

from snake_control.nodes import topics
from support.driven_robot import NAMES, DrivenRobot, stamp
from support.scripted_servos import PING, SYNC_WRITE, WRITE, ScriptedServos

UNIT = 0.111 * math.tau / 60.0
TICK = math.radians(300.0 / 1023.0)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DrivenRobot]:
    with DrivenRobot(tmp_path_factory.mktemp("robot")) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        yield robot


@pytest.fixture
def robot(shared: DrivenRobot) -> Iterator[DrivenRobot]:
    """The shared robot, holding; every test leaves it so."""
    yield shared
    shared.fall_silent()
    shared.wait_for_state(BusState.STATE_HOLDING)


def joint(message: Any, name: str) -> float:
    return message.phi[message.name.index(name)]


def test_activation_seeds_without_motion(tmp_path: Path) -> None:
    with DrivenRobot(tmp_path) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.let_pass(1.0)
        first, last = robot.truth.messages[0], robot.truth.last
        for name in NAMES:
            moved = abs(joint(last, name) - joint(first, name))
            # Joints that carry the head settle into their compliance; the others stay.
            carries = name in ("joint_1", "joint_3", "joint_5")
            assert moved <= (34 if carries else 2) * TICK, name
        assert all(servo.torque_enabled and servo.online for servo in robot.bus_state.last.servos)


def test_joint_states_are_complete_and_in_step_with_the_truth(robot: DrivenRobot) -> None:
    robot.let_pass(1.0)
    states = robot.joint_states.messages
    last = states[-1]
    assert tuple(last.name) == NAMES
    assert len(last.position) == len(last.velocity) == len(last.effort) == len(NAMES)
    for name, position in zip(last.name, last.position, strict=True):
        assert position == pytest.approx(joint(robot.truth.last, name), abs=2 * TICK)
    # In whole nanoseconds: a servo that missed its turn leaves the oldest reading what it was, and
    # the next stamp is one nanosecond later.
    stamps = [(m.header.stamp.sec, m.header.stamp.nanosec) for m in states]
    assert all(b > a for a, b in itertools.pairwise(stamps))
    assert robot.bus_state.last.servos[0].voltage == pytest.approx(11.1, abs=0.5)


def undisturbed(robot: DrivenRobot, seconds: float) -> tuple[Any, Any]:
    """The truth before and after some time in which every cycle had a fresh command."""
    for _ in range(5):
        robot.bus_state.clear()
        begin = robot.truth.last
        robot.let_pass(seconds)
        end = robot.truth.last
        if {state.state for state in robot.bus_state.messages} == {BusState.STATE_MOVING}:
            return begin, end
    raise AssertionError("this machine is too busy to send commands every 0.1 s")


@pytest.mark.parametrize("direction", [1, -1])
def test_joints_move_at_the_commanded_average_speed(robot: DrivenRobot, direction: int) -> None:
    units = {"joint_6": 0.3, "joint_7": -1.7, "joint_9": 20.0, "joint_2": 0.7}
    velocities = {name: direction * u * UNIT for name, u in units.items()}
    robot.command(**velocities)
    robot.wait_for_state(BusState.STATE_MOVING)
    robot.let_pass(0.5)
    begin, end = undisturbed(robot, 2.0)
    elapsed = stamp(end) - stamp(begin)
    for name, velocity in velocities.items():
        average = (joint(end, name) - joint(begin, name)) / elapsed
        assert average == pytest.approx(velocity, abs=0.25 * UNIT + 0.02 * abs(velocity)), name
    assert abs(joint(end, "joint_10") - joint(begin, "joint_10")) <= TICK


def test_without_commands_the_joints_hold_soon(robot: DrivenRobot) -> None:
    velocity = 0.5
    robot.command(joint_11=-velocity)
    robot.wait_for_state(BusState.STATE_MOVING)
    robot.let_pass(0.4)
    robot.fall_silent()
    silent_at = stamp(robot.truth.last)
    begin = joint(robot.truth.last, "joint_11")
    state = robot.wait_for_state(BusState.STATE_HOLDING)
    assert state.text == "holding: no command for 0.10 s"
    robot.let_pass(0.7)
    end = joint(robot.truth.last, "joint_11")
    # Time-out, one command under way, two cycles.
    assert -0.2 * velocity - 4 * TICK <= end - begin <= 0.0
    rest = [
        joint(message, "joint_11")
        for message in robot.truth.messages
        if stamp(message) > silent_at + 0.35
    ]
    assert len(rest) > 5
    assert max(rest) - min(rest) <= 2 * TICK


def ancient_age(robot: DrivenRobot) -> str:
    """First digits of the time since the epoch."""
    return str(robot.graph.node.get_clock().now().nanoseconds)[:6]


def invalid_commands(robot: DrivenRobot) -> dict[str, Any]:
    good = dict.fromkeys(NAMES, 0.2)
    short = robot.message(good)
    short.velocity = short.velocity[:-1]
    twice = robot.message(good)
    twice.name[1] = "joint_1"
    old = robot.message(good)
    old.header.stamp.sec -= 1
    ahead = robot.message(good)
    ahead.header.stamp.sec += 1
    ancient = robot.message(good)
    ancient.header.stamp.sec = -1
    return {
        "missing: joint_11": robot.message(dict.fromkeys(NAMES[:-1], 0.2)),
        "no such joint: elbow": robot.message(good | {"elbow": 0.2}),
        "velocity of joint_3 is nan": robot.message(good | {"joint_3": math.nan}),
        "velocity of joint_3 is inf": robot.message(good | {"joint_3": math.inf}),
        "11 names but 10 velocities": short,
        "a joint is named twice": twice,
        "its stamp is 1.": old,
        f"its stamp is {ancient_age(robot)}": ancient,
        "ahead: are the clocks in step?": ahead,
    }


def test_invalid_commands_are_ignored_and_named(robot: DrivenRobot) -> None:
    robot.wait_for_state(BusState.STATE_HOLDING)
    robot.let_pass(0.5)
    begin = robot.truth.last
    for why, message in invalid_commands(robot).items():
        robot.commands.publish(message)
        robot.graph.wait_for(lambda why=why: why in robot.bus_state.last.text, 5.0, why)
        assert robot.bus_state.last.state == BusState.STATE_HOLDING
    robot.let_pass(0.3)
    for name in NAMES:
        assert abs(joint(robot.truth.last, name) - joint(begin, name)) <= TICK, name
    assert "command ignored" in robot.driver.output()


def test_names_count_not_their_order(robot: DrivenRobot) -> None:
    velocities = dict.fromkeys(NAMES, 0.0) | {"joint_8": 0.3}
    begin = joint(robot.truth.last, "joint_8")

    def moved() -> bool:
        robot.commands.publish(robot.message(dict(reversed(velocities.items()))))
        return joint(robot.truth.last, "joint_8") - begin > 0.05

    robot.graph.wait_for(moved, 10.0, "joint_8 to move")


def test_torque_off_and_on_does_not_jump(tmp_path: Path) -> None:
    with DrivenRobot(tmp_path) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        assert robot.call(topics.SET_TORQUE, data=False).success
        state = robot.wait_for_state(BusState.STATE_TORQUE_OFF)
        assert not any(servo.torque_enabled for servo in state.servos)
        robot.ask(joint_7=0.5)
        robot.let_pass(0.5)
        assert robot.bus_state.last.state == BusState.STATE_TORQUE_OFF
        robot.fall_silent()
        # The head sinks; that is no jump.
        robot.graph.wait_for(
            lambda: max(map(abs, robot.truth.last.phi_dot)) < 0.01, 20.0, "all joints at rest"
        )
        begin = robot.truth.last
        answer = robot.call(topics.SET_TORQUE, data=True)
        assert answer.success, answer.message
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.let_pass(1.0)
        for name in NAMES:
            assert abs(joint(robot.truth.last, name) - joint(begin, name)) <= 4 * TICK, name


def test_an_emergency_stop_latches_until_reset(robot: DrivenRobot) -> None:
    robot.command(joint_8=-0.3)
    robot.wait_for_state(BusState.STATE_MOVING)
    assert robot.call(topics.EMERGENCY_STOP).success
    robot.wait_for_state(BusState.STATE_EMERGENCY_STOP)
    robot.let_pass(0.3)
    begin = joint(robot.truth.last, "joint_8")
    robot.let_pass(0.5)  # commands still arrive
    assert abs(joint(robot.truth.last, "joint_8") - begin) <= TICK
    assert robot.bus_state.last.state == BusState.STATE_EMERGENCY_STOP
    refused = robot.call(topics.SET_TORQUE, data=True)
    assert not refused.success
    assert "reset_emergency_stop" in refused.message
    assert robot.call(topics.RESET_EMERGENCY_STOP).success
    state = robot.wait_for_state(BusState.STATE_HOLDING)
    assert state.text == "holding: waiting for a zero command"
    robot.command()
    robot.wait_for_state(BusState.STATE_MOVING)
    robot.command(joint_8=0.3)
    robot.graph.wait_for(
        lambda: joint(robot.truth.last, "joint_8") - begin > 0.05, 10.0, "joint_8 to move"
    )


def test_diagnostics_have_one_status_of_the_bus_and_one_of_each_servo(robot: DrivenRobot) -> None:
    robot.diagnostics.clear()
    robot.graph.wait_for(lambda: len(robot.diagnostics.messages) > 1, 10.0, "/diagnostics")
    statuses = robot.diagnostics.last.status
    assert [s.name for s in statuses] == ["bus_driver: bus", *(f"bus_driver: {n}" for n in NAMES)]
    # Joint 5 carries the raised head.
    carries = [s for s in statuses if s.name == "bus_driver: joint_5"]
    assert [s.level for s in carries] == [DiagnosticStatus.WARN]
    assert "should carry 0.3 N m for long" in carries[0].message
    assert all(s.level == DiagnosticStatus.OK for s in statuses if s not in carries), statuses
    state = robot.bus_state.last
    assert state.servos[4].expected_torque == pytest.approx(0.4, abs=0.1)
    assert state.servos[4].text == carries[0].message
    assert [servo.level for servo in state.servos] == [0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]
    assert state.communication_error_rate < 0.1
    assert not state.emergency_stop
    for posture in ("start posture", "posture found"):
        warning = f"in the {posture} gravity asks more than the 0.3 N m"
        assert robot.driver.output().count(warning) == 1


def test_recover_on_a_healthy_bus_holds(robot: DrivenRobot) -> None:
    answer = robot.call(topics.RECOVER)
    assert answer.success, answer.message
    robot.wait_for_state(BusState.STATE_HOLDING)


def test_a_lost_port_stops_and_recovers(tmp_path: Path) -> None:
    with DrivenRobot(tmp_path) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.mock.kill()
        robot.mock.wait()
        state = robot.wait_for_state(BusState.STATE_STOPPED)
        assert "stopped working" in state.text or "no reply" in state.text
        assert robot.driver.running
        refused = robot.call(topics.RECOVER)
        assert not refused.success
        assert robot.bus_state.last.state == BusState.STATE_STOPPED
        robot.start_mock()
        # By itself, with the readings; torque and motion have to be asked for.
        robot.graph.wait_for(
            lambda: "the port works again; needs ~/recover" in robot.bus_state.last.text,
            20.0,
            "the port's return",
        )
        state = robot.bus_state.last
        assert (state.state, state.reconnections) == (BusState.STATE_STOPPED, 1)
        assert all(servo.online and not servo.torque_enabled for servo in state.servos)
        robot.joint_states.clear()
        robot.graph.wait_for(lambda: robot.joint_states.messages, 10.0, "joint_states")
        answer = robot.call(topics.RECOVER)
        assert answer.success, answer.message
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.command()
        robot.wait_for_state(BusState.STATE_MOVING)


@pytest.mark.parametrize("stop", ["interrupt", "terminate"])
def test_a_signal_while_the_servos_are_checked_arms_none(tmp_path: Path, stop: str) -> None:
    started = threading.Event()

    def answer(instruction: bytes, answer: bytes) -> bytes:
        if instruction[2] == 11 and instruction[4] == PING and started.wait(10.0):
            getattr(robot.driver, stop)()
        return answer

    with ScriptedServos(range(1, 12)) as servos:
        servos.answer = answer
        own = {"port": servos.path}
        with DrivenRobot(tmp_path, driver=own, with_mock=False) as robot:
            started.set()
            assert robot.driver.wait(30.0) == 0
            assert len(servos.instructions(PING)) >= 11
            assert servos.instructions(WRITE) == servos.instructions(SYNC_WRITE) == []
            assert "Traceback" not in robot.driver.output()


def test_a_driver_whose_clock_does_not_run_publishes_and_says_why_it_holds(
    tmp_path: Path,
) -> None:
    with DrivenRobot(tmp_path, driver={"use_sim_time": True}) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.ask(joint_7=0.2)
        robot.graph.wait_for(
            lambda: "ahead: are the clocks in step?" in robot.bus_state.last.text,
            10.0,
            "the reason",
        )
        assert robot.driver.running


@pytest.mark.parametrize("stop", ["interrupt", "terminate"])
def test_a_signal_stops_the_joints_in_order(tmp_path: Path, stop: str) -> None:
    with DrivenRobot(tmp_path) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.command(joint_8=0.4)
        robot.wait_for_state(BusState.STATE_MOVING)
        robot.let_pass(0.3)
        getattr(robot.driver, stop)()
        assert robot.driver.wait(10.0) == 0
        begin = joint(robot.truth.last, "joint_8")
        robot.let_pass(0.5)
        # It still holds, and has no goal ahead of it to run to.
        assert abs(joint(robot.truth.last, "joint_8") - begin) <= 2 * TICK
        assert "Traceback" not in robot.driver.output()


def test_a_killed_driver_leaves_no_more_than_the_look_ahead(tmp_path: Path) -> None:
    velocity = 0.4
    with DrivenRobot(tmp_path) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.command(joint_8=velocity)
        robot.wait_for_state(BusState.STATE_MOVING)
        robot.let_pass(0.3)
        robot.driver.kill()
        robot.driver.wait()
        begin = joint(robot.truth.last, "joint_8")
        robot.let_pass(1.5)
        assert joint(robot.truth.last, "joint_8") - begin <= 36 * TICK + 0.25 * velocity
        end = joint(robot.truth.last, "joint_8")
        robot.let_pass(0.5)
        assert abs(joint(robot.truth.last, "joint_8") - end) <= 2 * TICK


def test_servos_missing_at_start_give_one_message_and_an_exit_code(tmp_path: Path) -> None:
    ids = [*range(1, 10), 98, 99]
    with DrivenRobot(tmp_path, driver={"servos": {"ids": ids}}) as robot:
        assert robot.driver.wait(30.0) == 1
        lines = [line for line in robot.driver.output().splitlines() if "does not answer" in line]
        assert len(lines) == 1
        assert "joint_10 (servo id 98): does not answer" in lines[0]
        assert "joint_11 (servo id 99): does not answer" in lines[0]
        assert "Traceback" not in robot.driver.output()
        assert robot.bus_state.last is None


def test_no_port_gives_one_message_and_an_exit_code(tmp_path: Path) -> None:
    with DrivenRobot(tmp_path, with_mock=False) as robot:
        assert robot.driver.wait(30.0) == 1
        assert "no such port" in robot.driver.output()
        assert "Traceback" not in robot.driver.output()


def test_one_joint_in_wheel_mode(tmp_path: Path) -> None:
    modes = {"servos": {"velocity_modes": ["joint"] * 10 + ["wheel"]}}
    with DrivenRobot(tmp_path, driver=modes, mock=modes) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.command(joint_11=1.2, joint_7=0.2)
        robot.wait_for_state(BusState.STATE_MOVING)
        robot.let_pass(0.5)
        begin, end = undisturbed(robot, 0.7)
        elapsed = stamp(end) - stamp(begin)
        # Output, not speed: friction takes its share.
        speed = (joint(end, "joint_11") - joint(begin, "joint_11")) / elapsed
        assert speed > 0.5
        told = [
            message.velocity[10]
            for message in robot.joint_states.messages
            if stamp(begin) <= stamp(message) <= stamp(end)
        ]
        assert statistics.median(told) == pytest.approx(speed, rel=0.1)
        assert (joint(end, "joint_7") - joint(begin, "joint_7")) / elapsed == pytest.approx(
            0.2, abs=0.02
        )
        robot.fall_silent()
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.let_pass(0.3)
        begin = robot.truth.last
        robot.let_pass(0.5)
        assert abs(joint(robot.truth.last, "joint_11") - joint(begin, "joint_11")) <= 2 * TICK
