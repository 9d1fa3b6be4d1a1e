"""The driver as a managed node, its dry run and the lowering before torque goes off."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("snake_interfaces")

from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from snake_interfaces.msg import BusState

from snake_control.nodes import topics
from support.driven_robot import NAMES, DrivenRobot, stamp
from support.scripted_servos import PING, READ, ScriptedServos

CHANGE = topics.Service("~/change_state", ChangeState)
GET = topics.Service("~/get_state", GetState)
TICK = math.radians(300.0 / 1023.0)
ON_THE_FLOOR = [-0.3, 0.0, -0.2, 0.0, 0.8]


def transition(robot: DrivenRobot, number: int) -> bool:
    request = ChangeState.Request(transition=Transition(id=number))
    return robot.graph.call("bus_driver", CHANGE, request).success


def label(robot: DrivenRobot) -> str:
    return robot.call(GET).current_state.label


def angle(robot: DrivenRobot, name: str) -> float:
    truth = robot.truth.last
    return truth.phi[truth.name.index(name)]


def torque(state: BusState) -> set[bool]:
    return {servo.torque_enabled for servo in state.servos}


def test_the_whole_lifecycle_without_autostart(tmp_path: Path) -> None:
    with DrivenRobot(tmp_path, driver={"autostart": False}, with_mock=False) as robot:
        assert robot.call(GET).current_state.id == State.PRIMARY_STATE_UNCONFIGURED
        assert not transition(robot, Transition.TRANSITION_CONFIGURE), "there is no port yet"
        assert label(robot) == "unconfigured"
        assert not robot.call(topics.RECOVER).success
        robot.start_mock()
        # A transition that the state does not have.
        assert not transition(robot, Transition.TRANSITION_ACTIVATE)
        assert transition(robot, Transition.TRANSITION_CONFIGURE)
        state = robot.wait_for_state(BusState.STATE_INACTIVE)
        assert torque(state) == {False}
        robot.graph.wait_for(lambda: robot.joint_states.last, 5.0, "joint states without torque")
        refused = robot.call(topics.RECOVER)
        assert (refused.success, refused.message) == (False, "not active")
        assert transition(robot, Transition.TRANSITION_ACTIVATE)
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.command(joint_9=0.3)
        robot.wait_for_state(BusState.STATE_MOVING)
        assert transition(robot, Transition.TRANSITION_DEACTIVATE)
        state = robot.wait_for_state(BusState.STATE_INACTIVE)
        assert torque(state) == {True}
        robot.let_pass(0.3)
        begin = angle(robot, "joint_9")
        robot.let_pass(0.5)
        assert abs(angle(robot, "joint_9") - begin) <= TICK, "it holds, whatever is commanded"
        assert transition(robot, Transition.TRANSITION_CLEANUP)
        robot.diagnostics.clear()
        last = robot.graph.wait_for(lambda: robot.diagnostics.last, 5.0, "/diagnostics")
        assert [status.level for status in last.status] == [DiagnosticStatus.STALE]
        robot.graph.wait_for(lambda: abs(angle(robot, "joint_5") - 1.1) > 0.3, 10.0, "the fall")
        assert not robot.call(topics.RECOVER).success
        robot.bus_state.clear()
        assert transition(robot, Transition.TRANSITION_CONFIGURE)
        state = robot.wait_for_state(BusState.STATE_INACTIVE)
        assert torque(state) == {False}
        assert transition(robot, Transition.TRANSITION_ACTIVATE)
        state = robot.wait_for_state(BusState.STATE_HOLDING)
        assert state.text == "holding: waiting for a zero command", "somebody commands all the time"


def test_an_emergency_stop_outlives_everything_but_its_reset(tmp_path: Path) -> None:
    with DrivenRobot(tmp_path) as robot:
        active = robot.graph.subscribe(topics.EMERGENCY_STOP_ACTIVE.of("bus_driver"))
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.graph.wait_for(lambda: active.last, 10.0, "what was latched before")
        assert not active.last.data
        assert robot.call(topics.EMERGENCY_STOP).success
        robot.wait_for_state(BusState.STATE_EMERGENCY_STOP)
        robot.graph.wait_for(lambda: active.last.data, 10.0, "the emergency stop")
        assert not robot.call(topics.RECOVER).success
        assert not robot.call(topics.SET_TORQUE, data=True).success
        assert transition(robot, Transition.TRANSITION_DEACTIVATE)
        state = robot.wait_for_state(BusState.STATE_INACTIVE)
        assert state.emergency_stop
        assert "emergency stop is latched" in state.text
        assert transition(robot, Transition.TRANSITION_CLEANUP)
        assert transition(robot, Transition.TRANSITION_CONFIGURE)
        assert transition(robot, Transition.TRANSITION_ACTIVATE)
        robot.wait_for_state(BusState.STATE_EMERGENCY_STOP)
        robot.mock.kill()
        robot.mock.wait()
        robot.graph.wait_for(
            lambda: "stopped working" in robot.bus_state.last.text, 10.0, "the loss of the port"
        )
        robot.start_mock()
        robot.graph.wait_for(
            lambda: "works again" in robot.bus_state.last.text, 20.0, "the port's return"
        )
        assert robot.bus_state.last.state == BusState.STATE_EMERGENCY_STOP
        assert robot.call(topics.RESET_EMERGENCY_STOP).success
        robot.wait_for_state(BusState.STATE_STOPPED)
        robot.graph.wait_for(lambda: not active.last.data, 10.0, "the end of the emergency stop")
        assert robot.call(topics.RECOVER).success
        robot.wait_for_state(BusState.STATE_HOLDING)


def test_an_activation_that_a_servo_refuses_can_be_tried_again(tmp_path: Path) -> None:
    with ScriptedServos(range(1, 12)) as servos:
        driver = {"autostart": False, "port": servos.path}
        with DrivenRobot(tmp_path, driver=driver, with_mock=False) as robot:
            assert transition(robot, Transition.TRANSITION_CONFIGURE)
            robot.wait_for_state(BusState.STATE_INACTIVE)
            servos.answer = lambda i, answer: b"" if i[2] == 4 else answer
            assert not transition(robot, Transition.TRANSITION_ACTIVATE)
            assert label(robot) == "inactive"
            assert {memory[24] for memory in servos.memory.values()} == {0}
            servos.answer = None
            assert transition(robot, Transition.TRANSITION_ACTIVATE)
            robot.wait_for_state(BusState.STATE_HOLDING)


def lowering(**more: Any) -> dict[str, Any]:
    # The base stays as it is at the start: only the head is lowered.
    base = [-0.349, 0.524, 0.524, -0.349, -0.524, -0.314]
    return {
        "lower_before_torque_off": True,
        "lowering_angles_rad": [*ON_THE_FLOOR, *base],
        "lowering_speed_rad_s": 0.3,
        **more,
    }


def test_the_head_is_lowered_before_torque_goes_off(tmp_path: Path) -> None:
    with DrivenRobot(tmp_path, driver=lowering()) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.command()
        robot.graph.wait_for(lambda: robot.truth.last, 10.0, "the truth")
        begin = [angle(robot, name) for name in NAMES]
        answer = robot.call(topics.SET_TORQUE, data=False)
        assert (answer.success, answer.message.split(";")[0]) == (True, "lowering")
        state = robot.wait_for_state(BusState.STATE_LOWERING)
        assert state.text.startswith("lowering before torque goes off")
        assert "~/emergency_stop ends that" in robot.call(topics.SET_TORQUE, data=False).message
        # Commands of motion do not disturb it.
        robot.ask(joint_9=1.0)
        first = robot.truth.last
        robot.graph.wait_for(
            lambda: abs(angle(robot, "joint_5") - begin[4]) > 0.15, 10.0, "half of the way"
        )
        last = robot.truth.last
        robot.wait_for_state(BusState.STATE_TORQUE_OFF)
        truths = robot.truth.messages
        speeds = [
            abs(b - a) / (stamp(last) - stamp(first))
            for a, b in zip(first.phi, last.phi, strict=True)
        ]
        assert max(speeds) < 0.4, "slowly"
        nearest = min(
            max(abs(a - b) for a, b in zip(truth.phi[:5], ON_THE_FLOOR, strict=True))
            for truth in truths
        )
        assert nearest < 0.1, "droop and tolerance are left"


def test_an_emergency_stop_ends_a_lowering_and_torque_stays_on(tmp_path: Path) -> None:
    with DrivenRobot(tmp_path, driver=lowering()) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        assert robot.call(topics.SET_TORQUE, data=False).success
        robot.wait_for_state(BusState.STATE_LOWERING)
        assert robot.call(topics.EMERGENCY_STOP).success
        state = robot.wait_for_state(BusState.STATE_EMERGENCY_STOP)
        assert torque(state) == {True}
        robot.let_pass(0.3)
        begin = angle(robot, "joint_5")
        robot.let_pass(0.5)
        assert abs(angle(robot, "joint_5") - begin) <= TICK
        # Under an emergency stop there is no motion: torque goes off at once, and it says so.
        answer = robot.call(topics.SET_TORQUE, data=False)
        assert answer.success
        assert "the robot was not lowered: emergency stop" in answer.message


def test_cleanup_lowers_the_robot_first(tmp_path: Path) -> None:
    with DrivenRobot(tmp_path, driver=lowering()) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        assert transition(robot, Transition.TRANSITION_DEACTIVATE)
        assert transition(robot, Transition.TRANSITION_CLEANUP)
        nearest = min(abs(truth.phi[4] - ON_THE_FLOOR[4]) for truth in robot.truth.messages)
        assert nearest < 0.1
        assert BusState.STATE_LOWERING in {state.state for state in robot.bus_state.messages}


def test_a_dry_run_reads_works_out_goals_and_writes_nothing(tmp_path: Path) -> None:
    with ScriptedServos(range(1, 12)) as servos:
        servos.memory[3][24] = 1
        before = {i: bytes(memory) for i, memory in servos.memory.items()}
        driver = {"dry_run": True, "torque_off_on_exit": True, "port": servos.path}
        with DrivenRobot(tmp_path, driver=driver, with_mock=False) as robot:
            state = robot.wait_for_state(BusState.STATE_DRY_RUN)
            assert "torque is on at joint_3" in state.text
            robot.graph.wait_for(lambda: robot.joint_states.messages, 10.0, "feedback")
            robot.ask()
            robot.graph.wait_for(
                lambda: "moving" in robot.bus_state.last.text, 10.0, "a command that is taken"
            )
            robot.ask(joint_7=0.5)
            robot.graph.wait_for(
                lambda: robot.bus_state.last.servos[6].goal_position > 0.15, 10.0, "a goal"
            )
            servo = robot.bus_state.last.servos[6]
            assert servo.goal_speed == pytest.approx(0.5, rel=0.05)
            robot.graph.wait_for(
                lambda: "dry run, not sent: joint_7 +0.5" in robot.driver.output(), 10.0, "a log"
            )
            for on in (True, False):
                refused = robot.call(topics.SET_TORQUE, data=on)
                assert (refused.success, refused.message.split(":")[0]) == (False, "dry run")
            assert transition(robot, Transition.TRANSITION_DEACTIVATE)
            assert transition(robot, Transition.TRANSITION_CLEANUP)
            robot.driver.interrupt()
            assert robot.driver.wait(20.0) == 0
        assert {packet[4] for packet in servos.packets} == {PING, READ}
        assert {i: bytes(memory) for i, memory in servos.memory.items()} == before
