"""A mock robot with its driver, on which one scenario after the other is tried."""

from __future__ import annotations

import math
import os
import re
import signal
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from snake_interfaces.msg import BusState

from faults.check import Outcome, Record, judge
from faults.scenario import After, Expect, Scenario
from snake_control.config import Config, load
from snake_control.mock.simulation import LARGEST_LAG_S
from snake_control.nodes import topics
from snake_control.nodes.recorder import FOLLOWING
from support.driven_robot import NAMES, DrivenRobot, stamp
from support.graph import CONFIG
from support.process import Process
from support.whole_graph import WholeGraph

DRIVER = {"diagnostics_period_s": 0.2, "reconnect_first_s": 0.3, "reconnect_longest_s": 0.6}

SPEEDS = {"joint_2": 0.15, "joint_6": 0.2, "joint_7": 0.15, "joint_8": 0.4, "joint_10": 0.3}
"""Motion of a scenario: to and fro about where the joints started [rad/s]."""

SWING_RAD = 0.8
_WARM_UP_S = 0.8
_TRIES = 3


class Rig:
    """Keeps a robot ready; restarts it when a scenario left it unfit for the next one."""

    def __init__(self) -> None:
        self.config: Config = load(CONFIG / "paper_robot.yaml")
        self._directory = tempfile.TemporaryDirectory(prefix="faults_")
        self._count = 0
        self._robot: DrivenRobot | None = None
        self._wave: _Wave | None = None

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *exception: object) -> None:
        self._stop()
        self._directory.cleanup()

    def run(self, scenario: Scenario) -> Outcome:
        """Try a scenario and judge it; once more where the machine stalled, as that shows nothing.

        Of a mock that is itself stopped nothing else can be expected.
        """
        for _ in range(_TRIES):
            outcome = self._run(scenario)
            stalled = scenario.process != "mock_bus" and outcome.stalled_s > LARGEST_LAG_S
            if not (outcome.violations and stalled):
                break
            self._stop()
        return outcome

    def _run(self, scenario: Scenario) -> Outcome:
        if scenario.situation == "case_3":
            self._stop()
            return self._run_whole_graph(scenario)
        if scenario.situation == "start":
            self._stop()
            return self._run_start(scenario)
        try:
            return self._run_driven(scenario)
        except BaseException:
            self._stop()
            raise

    # One mock and one driver, commanded from here.

    def _run_driven(self, scenario: Scenario) -> Outcome:
        robot = self._ready_robot()
        wave = self._wave
        assert wave is not None
        if scenario.situation == "motion":
            robot.command()
            wave.begin()
            robot.let_pass(_WARM_UP_S)
            if scenario.timeout == "follow":
                # A reversal would begin the watch over a joint's way anew.
                robot.graph.wait_for(wave.just_turned, 10.0, "the beginning of a swing")
            assert robot.bus_state.last.state == BusState.STATE_MOVING, robot.bus_state.last.text
        if scenario.emergency:
            assert robot.call(topics.EMERGENCY_STOP).success
            robot.wait_for_state(BusState.STATE_EMERGENCY_STOP)
            robot.let_pass(0.3)
        speed = wave.speed if scenario.situation == "motion" else np.zeros(len(NAMES))
        robot.truth.clear()
        robot.bus_state.clear()
        robot.graph.wait_for(lambda: robot.truth.messages, 10.0, "ground truth")
        undo = self._begin(robot, scenario)
        fault_at = robot.graph.now_ns() * 1e-9
        self._watch(robot, scenario, fault_at)
        until = robot.graph.now_ns() * 1e-9
        refused = None
        if scenario.recover_refused:
            refused = robot.call(topics.RECOVER)
        record = self._record(robot, fault_at, until, speed, scenario)
        outcome = judge(scenario, record, self.config)
        if refused is not None and refused.success:
            outcome.violations.append("~/recover succeeded while the fault lasted")
        undo()
        self._come_back(robot, scenario, outcome)
        return outcome

    def _begin(self, robot: DrivenRobot, scenario: Scenario) -> Callable[[], None]:
        """Let the fault begin; return what ends it."""
        for injection in scenario.inject:
            request = topics.INJECT_FAULT.type.Request(
                fault=injection.fault,
                ids=list(injection.ids),
                duration=float(injection.duration),
                value=float(injection.value),
                probability=float(injection.probability),
            )
            response = robot.graph.call("mock_bus", topics.INJECT_FAULT, request)
            assert response.success, response.message
        if scenario.inject:
            return lambda: self._clear(robot)
        return self._signal(robot, scenario)

    def _clear(self, robot: DrivenRobot) -> None:
        request = topics.CLEAR_FAULTS.type.Request()
        response = robot.graph.call("mock_bus", topics.CLEAR_FAULTS, request)
        assert response.success, response.message

    def _signal(self, robot: DrivenRobot, scenario: Scenario) -> Callable[[], None]:
        wave = self._wave
        assert wave is not None
        if scenario.process == "commander":
            if scenario.signal == "NAN":
                wave.override = math.nan
            else:
                wave.silent = True
            return wave.restore
        process = robot.driver if scenario.process == "bus_driver" else robot.mock
        return _send(process, scenario)

    def _watch(self, robot: DrivenRobot, scenario: Scenario, fault_at: float) -> None:
        if scenario.process == "mock_bus":
            # Its ground truth stands still with it.
            end = fault_at + scenario.watch
            robot.graph.wait_for(
                lambda: robot.graph.now_ns() * 1e-9 > end, scenario.watch + 10.0, "time to pass"
            )
            return
        robot.graph.wait_for(
            lambda: stamp(robot.truth.last) > fault_at + scenario.watch,
            scenario.watch + 20.0,
            "time to pass",
        )

    def _record(
        self,
        robot: DrivenRobot,
        fault_at: float,
        until: float,
        speed: Any,
        scenario: Scenario,
    ) -> Record:
        truth = robot.truth.messages
        ended = {scenario.process} if scenario.signal in ("KILL", "TERM") else set()
        died = [
            process.name
            for process in (robot.mock, robot.driver)
            if not process.running and process.name not in ended
        ]
        return Record(
            fault_at=fault_at,
            until=until,
            time=np.array([stamp(m) for m in truth]),
            phi=np.array([m.phi for m in truth]),
            phi_dot=np.array([m.phi_dot for m in truth]),
            states=[(stamp(m), int(m.state), _texts(m)) for m in robot.bus_state.messages],
            speed=speed,
            died=died,
        )

    def _come_back(self, robot: DrivenRobot, scenario: Scenario, outcome: Outcome) -> None:
        """Get the robot going again as the scenario says."""
        wave = self._wave
        assert wave is not None
        try:
            if scenario.process == "mock_bus" and scenario.signal == "KILL":
                robot.start_mock()
            if scenario.process == "bus_driver" and scenario.signal != "STOP":
                robot.bus_state.clear()
                robot.driver = robot.start_driver()
                wave.pause()
                robot.wait_for_state(BusState.STATE_HOLDING)
                outcome.recovered = "restart of the driver"
            stopped = robot.bus_state.last.state in (
                BusState.STATE_STOPPED,
                BusState.STATE_EMERGENCY_STOP,
            )
            if scenario.emergency:
                assert robot.bus_state.last.emergency_stop, "the emergency stop is gone"
                assert robot.call(topics.RESET_EMERGENCY_STOP).success
            if scenario.after is After.RECOVER or (scenario.expect is Expect.SAFE and stopped):
                wave.pause()
                robot.graph.wait_for(
                    lambda: robot.call(topics.RECOVER).success, 20.0, "a recovery that succeeds"
                )
                outcome.recovered = "~/recover"
            elif not outcome.recovered:
                outcome.recovered = "by itself"
            if scenario.after is After.RESTART or scenario.limp:
                self._stop()
                return
            wave.pause()
            robot.command()
            robot.wait_for_state(BusState.STATE_MOVING, 10.0)
            robot.fall_silent()
            robot.wait_for_state(BusState.STATE_HOLDING)
        except AssertionError as error:
            outcome.recovered = "no"
            outcome.violations.append(f"did not come back: {str(error).splitlines()[0]}")
            self._stop()

    def _ready_robot(self) -> DrivenRobot:
        if self._robot is None:
            self._count += 1
            directory = Path(self._directory.name) / str(self._count)
            directory.mkdir()
            self._robot = DrivenRobot(directory, driver=DRIVER).__enter__()
            self._wave = _Wave(self._robot)
        self._robot.wait_for_state(BusState.STATE_HOLDING)
        return self._robot

    def _stop(self) -> None:
        if self._robot is not None:
            if self._wave is not None:
                self._wave.pause()
            self._robot.__exit__(None, None, None)
        self._robot = self._wave = None

    # The driver's start.

    def _run_start(self, scenario: Scenario) -> Outcome:
        self._count += 1
        directory = Path(self._directory.name) / str(self._count)
        directory.mkdir()
        outcome = Outcome()
        absent = scenario.signal == "ABSENT"
        with DrivenRobot(
            directory, driver=DRIVER, with_mock=not absent, with_driver=False
        ) as robot:
            if not absent:
                robot.graph.wait_for(lambda: robot.truth.messages, 20.0, "ground truth")
                self._begin(robot, scenario)
            driver = robot.start_driver()
            driver.let_end()
            code = driver.wait(30.0)
            text = driver.output()
            outcome.did = _refusal(text)
            if code != 1:
                outcome.violations.append(f"exit code {code}")
            if "Traceback" in text:
                outcome.violations.append("a traceback instead of a message")
            if not re.search(scenario.reported, text):
                outcome.violations.append(f"not reported: nothing like {scenario.reported!r}")
            if absent:
                robot.start_mock()
            else:
                phi = np.array([m.phi for m in robot.truth.messages])
                outcome.travel = float(np.abs(phi - phi[0]).max())
                if outcome.travel > 0.0:
                    outcome.violations.append("a joint moved, or was given torque")
                self._clear(robot)
            robot.driver = robot.start_driver()
            robot.wait_for_state(BusState.STATE_HOLDING)
            outcome.recovered = "restart of the driver"
        return outcome

    # All nodes, in Case 3.

    def _run_whole_graph(self, scenario: Scenario) -> Outcome:
        self._count += 1
        directory = Path(self._directory.name) / str(self._count)
        directory.mkdir()
        with WholeGraph(directory) as robot:
            bus = robot.graph.subscribe(topics.BUS_STATE)
            response = robot.graph.call(
                "trajectory_generator", topics.START, topics.START.type.Request()
            )
            assert response.success, response.message
            begin = robot.graph.now_ns() * 1e-9
            robot.graph.wait_for(
                lambda: stamp(robot.truth.last) > begin + 3.0, 30.0, "three seconds of Case 3"
            )
            robot.truth.clear()
            robot.states.clear()
            bus.clear()
            robot.graph.wait_for(lambda: robot.truth.messages, 10.0, "ground truth")
            before = np.abs(np.array(robot.truth.last.phi_dot))
            process = robot.processes[scenario.process]
            undo = _send(process, scenario)
            fault_at = robot.graph.now_ns() * 1e-9
            robot.graph.wait_for(
                lambda: stamp(robot.truth.last) > fault_at + scenario.watch, 30.0, "time to pass"
            )
            until = robot.graph.now_ns() * 1e-9
            truth = robot.truth.messages
            states = [(stamp(m), int(m.state), _texts(m)) for m in bus.messages]
            states += [(stamp(m), -1, m.text) for m in robot.states.messages]
            ended = {scenario.process} if scenario.signal == "KILL" else set()
            record = Record(
                fault_at=fault_at,
                until=until,
                time=np.array([stamp(m) for m in truth]),
                phi=np.array([m.phi for m in truth]),
                phi_dot=np.array([m.phi_dot for m in truth]),
                states=sorted(states),
                speed=np.maximum(before, 0.1),
                died=[k for k, p in robot.processes.items() if not p.running and k not in ended],
            )
            outcome = judge(scenario, record, self.config)
            undo()
            outcome.recovered = "restart"
            if scenario.signal == "STOP":
                outcome.recovered = "by itself"
                try:
                    robot.graph.wait_for(
                        lambda: (
                            robot.states.last.status in FOLLOWING
                            and bus.last.state == BusState.STATE_MOVING
                        ),
                        10.0,
                        "motion again",
                    )
                except AssertionError:
                    outcome.recovered = "no"
                    outcome.violations.append(
                        f"no motion again: the controller says {robot.states.last.text!r} "
                        f"(status {robot.states.last.status}), the driver {bus.last.text!r}"
                    )
            return outcome


class _Wave:
    """Commands joints to and fro about where they were first, by the ground truth."""

    def __init__(self, robot: DrivenRobot) -> None:
        robot.graph.wait_for(lambda: robot.truth.messages, 20.0, "ground truth")
        self._robot = robot
        self._start = dict(zip(robot.truth.last.name, robot.truth.last.phi, strict=True))
        self._direction = dict.fromkeys(SPEEDS, 1.0)
        self._lock = threading.Lock()
        self._running = False
        self.override: float | None = None
        self.silent = False
        self.speed = np.array([SPEEDS.get(name, 0.0) for name in NAMES])
        robot.graph.every(0.1, self._turn)

    def begin(self) -> None:
        """Command motion from now on."""
        with self._lock:
            self._running = True
        self._turn()

    def just_turned(self) -> bool:
        """Whether joint 8 has most of its way before it."""
        truth = self._robot.truth.last
        away = truth.phi[truth.name.index("joint_8")] - self._start["joint_8"]
        return self._direction["joint_8"] * away < -0.4 * SWING_RAD

    def pause(self) -> None:
        """Command nothing."""
        with self._lock:
            self._running = False
            self.override, self.silent = None, False
        self._robot.fall_silent()

    def restore(self) -> None:
        """Command as before a lapse."""
        with self._lock:
            self.override, self.silent = None, False
        self._turn()

    def _turn(self) -> None:
        with self._lock:
            if not self._running:
                return
            if self.silent:
                self._robot.fall_silent()
                return
            truth = self._robot.truth.last
            if truth is None:
                return
            phi = dict(zip(truth.name, truth.phi, strict=True))
            for name in SPEEDS:
                away = phi[name] - self._start[name]
                if abs(away) > SWING_RAD:
                    self._direction[name] = -math.copysign(1.0, away)
            velocities = {name: self._direction[name] * v for name, v in SPEEDS.items()}
            if self.override is not None:
                velocities["joint_8"] = self.override
            self._robot.ask(**velocities)


def _send(process: Process, scenario: Scenario) -> Callable[[], None]:
    if scenario.signal == "STOP":
        os.kill(process.pid, signal.SIGSTOP)
        timer = threading.Timer(scenario.duration, os.kill, (process.pid, signal.SIGCONT))
        timer.start()
        return timer.join
    if scenario.signal == "TERM":
        process.terminate()
    else:
        process.kill()
        process.wait()
    return lambda: None


def _texts(message: BusState) -> str:
    servos = [
        f"{servo.joint}: {servo.text}{'' if servo.online else ' (lost)'}"
        for servo in message.servos
        if servo.level > 0 or not servo.online
    ]
    return " | ".join([message.text, *servos])


def _refusal(text: str) -> str:
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else ""
