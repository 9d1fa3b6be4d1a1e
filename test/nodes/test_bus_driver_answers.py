"""While the driver works on something long it answers, and what goes wrong in there is told."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("snake_interfaces")

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from snake_interfaces.msg import BusState
from std_srvs.srv import Trigger

from snake_control.errors import SnakeError
from snake_control.nodes import topics
from snake_control.nodes.bus_driver import BusDriver
from support.driven_robot import DrivenRobot
from support.graph import Graph
from support.scripted_servos import PING, SYNC_WRITE, WRITE, ScriptedServos

CHANGE = topics.Service("~/change_state", ChangeState)
GET = topics.Service("~/get_state", GetState)
POSE = [-0.3, 0.0, -0.2, 0.0, 0.8, -0.349, 0.524, 0.524, -0.349, -0.524, -0.314]
LOWERING = {
    "lower_before_torque_off": True,
    "lowering_angles_rad": POSE,
    "lowering_speed_rad_s": 0.1,
}


def begin(robot: DrivenRobot, number: int) -> Any:
    """Ask for a transition; the future of its answer."""
    client = robot.graph.node.create_client(ChangeState, "/bus_driver/change_state")
    robot.graph.wait_for(client.service_is_ready, 30.0, "change_state")
    robot.call(GET)  # by now the driver knows the client
    return client.call_async(ChangeState.Request(transition=Transition(id=number)))


def test_an_emergency_stop_ends_a_cleanup_that_lowers_the_robot(tmp_path: Path) -> None:
    with DrivenRobot(tmp_path, driver=LOWERING) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        deactivated = begin(robot, Transition.TRANSITION_DEACTIVATE)
        robot.graph.wait_for(deactivated.done, 10.0, "inactive")
        cleaned_up = begin(robot, Transition.TRANSITION_CLEANUP)
        robot.wait_for_state(BusState.STATE_LOWERING)
        assert robot.call(topics.EMERGENCY_STOP).success
        robot.graph.wait_for(cleaned_up.done, 10.0, "the end of the cleanup")
        assert not cleaned_up.result().success
        assert robot.call(GET).current_state.label == "inactive"
        state = robot.bus_state.last
        assert state.emergency_stop
        assert all(servo.torque_enabled for servo in state.servos)
        assert "no cleanup: lowering ended, torque stays on: emergency stop" in (
            robot.driver.output()
        )
        # Now the operator knows, and may let go without a motion.
        assert "not lowered: emergency stop" in robot.call(topics.SET_TORQUE, data=False).message
        cleaned_up = begin(robot, Transition.TRANSITION_CLEANUP)
        robot.graph.wait_for(cleaned_up.done, 10.0, "the second cleanup")
        assert cleaned_up.result().success


def test_an_emergency_stop_ends_the_lowering_of_a_driver_that_ends(tmp_path: Path) -> None:
    with DrivenRobot(tmp_path, driver=LOWERING | {"torque_off_on_exit": True}) as robot:
        robot.wait_for_state(BusState.STATE_HOLDING)
        robot.graph.wait_for(lambda: robot.truth.last, 10.0, "the truth")
        # Known to the driver before it is asked for in a hurry.
        stop = robot.graph.node.create_client(
            topics.EMERGENCY_STOP.type, "/bus_driver/emergency_stop"
        )
        robot.graph.wait_for(stop.service_is_ready, 30.0, "the emergency stop")
        robot.call(GET)
        robot.driver.interrupt()
        robot.wait_for_state(BusState.STATE_LOWERING)
        answer = stop.call_async(topics.EMERGENCY_STOP.type.Request())
        robot.graph.wait_for(answer.done, 10.0, "an answer of a driver that ends")
        assert robot.driver.wait(10.0) == 0
        assert "lowering ended, torque stays on: emergency stop" in robot.driver.output()
        assert "Traceback" not in robot.driver.output()
        head = [robot.truth.last.phi[i] for i in (0, 2, 4)]
        robot.let_pass(1.0)
        for before, i in zip(head, (0, 2, 4), strict=True):
            assert robot.truth.last.phi[i] == pytest.approx(before, abs=0.02), "it is held"


@contextmanager
def driver_on(graph: Graph, port: str, *, autostart: bool = False) -> Iterator[BusDriver]:
    """A driver in this process, so that a test can break it, with an executor of its own."""
    given = {"port": port, "autostart": autostart}
    driver = BusDriver(
        context=graph.node.context,
        parameter_overrides=[Parameter(name, value=value) for name, value in given.items()],
        automatically_declare_parameters_from_overrides=True,
    )
    executor = SingleThreadedExecutor(context=graph.node.context)
    executor.add_node(driver)
    stop = threading.Event()

    def spin() -> None:
        while not stop.is_set():
            executor.spin_once(timeout_sec=0.1)

    with ThreadPoolExecutor(1) as threads:
        spinning = threads.submit(spin)
        try:
            yield driver
        finally:
            stop.set()
            try:
                spinning.result()
            finally:
                driver.close()
                driver.destroy_node()
                executor.shutdown()


def changed(graph: Graph, number: int) -> bool:
    request = ChangeState.Request(transition=Transition(id=number))
    return graph.call("bus_driver", CHANGE, request).success


def state_of(graph: Graph) -> str:
    return graph.call("bus_driver", GET, GetState.Request()).current_state.label


def test_a_mistake_in_a_transition_leaves_the_servos_holding_and_the_port_closed(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def fail() -> None:
        raise AttributeError("a mistake of the program")

    with (
        ScriptedServos(range(1, 12)) as servos,
        Graph() as graph,
        driver_on(graph, servos.path) as driver,
    ):
        assert changed(graph, Transition.TRANSITION_CONFIGURE)
        assert changed(graph, Transition.TRANSITION_ACTIVATE)
        assert {memory[24] for memory in servos.memory.values()} == {1}
        with monkeypatch.context() as patch:
            patch.setattr(driver._loop, "deactivate", fail)
            assert not changed(graph, Transition.TRANSITION_DEACTIVATE)
        assert state_of(graph) == "unconfigured"
        assert "a mistake of the program" in capfd.readouterr().err
        assert {memory[24] for memory in servos.memory.values()} == {1}, "they hold"
        # The port is free, and the driver begins anew.
        assert changed(graph, Transition.TRANSITION_CONFIGURE)
        assert state_of(graph) == "inactive"


def test_the_driver_answers_while_it_waits_for_servos_that_are_silent() -> None:
    asked = threading.Event()

    def silent(instruction: bytes, answer: bytes) -> bytes:
        if instruction[4] == PING:
            asked.set()
        return b""

    with ScriptedServos(range(1, 12)) as servos, Graph() as graph:
        servos.answer = silent
        with driver_on(graph, servos.path):
            client = graph.node.create_client(ChangeState, "/bus_driver/change_state")
            graph.wait_for(client.service_is_ready, 30.0, "change_state")
            assert state_of(graph) == "unconfigured"
            request = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CONFIGURE))
            configured = client.call_async(request)
            assert asked.wait(10.0)
            assert graph.call(
                "bus_driver", topics.EMERGENCY_STOP, topics.EMERGENCY_STOP.type.Request()
            ).success
            assert not configured.done(), "the check of eleven silent servos takes seconds"
            graph.wait_for(configured.done, 20.0, "the end of the check")
            assert not configured.result().success
        assert servos.instructions(WRITE) == servos.instructions(SYNC_WRITE) == []


def test_the_driver_answers_while_it_starts_by_itself() -> None:
    asked = threading.Event()

    def silent(instruction: bytes, answer: bytes) -> bytes:
        asked.set()
        return b""

    def start(graph: Graph, port: str) -> None:
        with driver_on(graph, port, autostart=True) as driver:
            assert graph.call("bus_driver", topics.EMERGENCY_STOP, Trigger.Request()).success
            assert asked.is_set()
            assert not driver._step.done(), "it still looks for eleven servos, 0.2 s each"
            graph.wait_for(driver._step.done, 20.0, "the end of the start")
            graph.wait_for(lambda: driver._starter.is_canceled(), 5.0, "the failure to be raised")

    with ScriptedServos(range(1, 12)) as servos, Graph() as graph:
        servos.answer = silent
        with pytest.raises(SnakeError, match="answer"):
            start(graph, servos.path)
