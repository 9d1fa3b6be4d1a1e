"""The paper's experiment on a simulated robot, through real ROS 2 messages and servo bytes.

    python -m snake_control.cli.demo --case 3 --duration 60 --out out/demo

Starts the five nodes as processes, drives one case of the paper, stops the robot in order, and
writes ``summary.json``, ``series.csv`` and the paper's figures.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from snake_interfaces.msg import BusState, ControllerState, PoseStatus
from std_srvs.srv import SetBool, Trigger

from snake_control.cli.common import EXIT_FAILED, EXIT_OK, EXIT_USAGE, ending_signals
from snake_control.cli.demo_arguments import DemoArguments, parse_arguments
from snake_control.cli.demo_outcome import Outcome, RunJudge, progress_text
from snake_control.cli.memory import MemoryWatch
from snake_control.cli.node_processes import NodeProcesses
from snake_control.cli.processor import ProcessorWatch
from snake_control.cli.progress import ProgressLine
from snake_control.cli.ros_domain import own_domain
from snake_control.config import Config
from snake_control.errors import NodeDiedError, NotReadyError, SnakeError
from snake_control.experiment.series import Series
from snake_control.experiment.summary import Run, summarise, write_summary
from snake_control.experiment.table import format_summary
from snake_control.nodes.process import end_soon
from snake_control.nodes.recorder import FOLLOWING, STATUS_WORDS, Recorder
from snake_control.nodes.topics import ENABLE, START, STOP, Service
from snake_control.nodes.transport import without_shared_memory

_STOP_ORDER = (
    "scp_controller",
    "trajectory_generator",
    "pose_input",
    "bus_driver",
    "mock_bus",
    "description",
    "record",
)
_READY_TIMEOUT_S = 40.0
_SILENCE_TIMEOUT_S = 5.0
_SERVICE_TIMEOUT_S = 3.0
_NODE_STOP_TIMEOUT_S = 8.0
_GATHER_S = 0.04
_TAKE_S = 0.002
_BUS_STATES = {
    BusState.STATE_INACTIVE: "inactive",
    BusState.STATE_HOLDING: "holding",
    BusState.STATE_MOVING: "moving",
    BusState.STATE_TORQUE_OFF: "torque off",
    BusState.STATE_STOPPED: "stopped by a fault",
    BusState.STATE_EMERGENCY_STOP: "emergency stop",
    BusState.STATE_LOWERING: "lowering",
    BusState.STATE_DRY_RUN: "dry run",
}


class StopRequested(Exception):  # noqa: N818 - not an error: somebody pressed Ctrl-C
    """SIGINT or SIGTERM arrived.

    Attributes:
        number: which.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        super().__init__(f"interrupted by {signal.Signals(number).name}")


class Demo:
    """One run: the processes, a node that listens, and the way through the phases."""

    def __init__(self, arguments: DemoArguments, config: Config, directory: Path) -> None:
        """Prepare a run; ``run`` starts the processes.

        Args:
            arguments: the command line.
            config: what the nodes read from it.
            directory: private directory for the port link and rcl's own logs.
        """
        self._arguments = arguments
        self._config = config
        self._port = directory / "servo_bus"
        # In a domain that a robot shares, its topics must not meet ours.
        self._namespace = f"/demo_{os.getpid()}"
        self._signal: int | None = None
        self._progress = ProgressLine()
        os.environ.setdefault("ROS_LOG_DIR", str(directory))
        environment = os.environ | {
            "RCUTILS_COLORIZED_OUTPUT": "0",
            "PYTHONUNBUFFERED": "1",
            # Matrices of 12 x 12 gain nothing from more threads, and two cores lose.
            "OPENBLAS_NUM_THREADS": "1",
        }
        self.processes = NodeProcesses(arguments.out / "logs", environment)
        self.memory = MemoryWatch()
        self.processor = ProcessorWatch()
        self.series = Series(config.robot, arguments.out / "series.csv")
        self.startup_s: float | None = None
        self.stop_findings: list[str] = []
        self._node: Any = None
        self._clients: dict[str, Any] = {}
        self._executor: SingleThreadedExecutor | None = None
        self.recorder: Recorder | None = None

    def run(self) -> Outcome:
        """Go through the phases and return how it ended; the nodes have been stopped then."""
        try:
            outcome = self._follow()
        except StopRequested as request:
            outcome = Outcome(str(request), 128 + request.number)
        except (NodeDiedError, NotReadyError) as error:
            outcome = Outcome(str(error), EXIT_FAILED)
        finally:
            self._progress.close()
            self._stop_in_order()
        return outcome

    def _follow(self) -> Outcome:
        begin = time.monotonic()
        self._start_nodes()
        self._wait_until_ready()
        recorder = self._recorder()
        recorder.start()
        self._call("trajectory_generator", START, Trigger.Request(), _SERVICE_TIMEOUT_S)
        self.startup_s = time.monotonic() - begin
        self._progress.say(f"ready after {self.startup_s:.1f} s; the reference starts")
        return self._watch(recorder)

    def _start_nodes(self) -> None:
        self._progress.say("starting the nodes")
        # The processes are forked before rclpy has threads; the driver needs the mock's port.
        first = ("record", "description") if self._arguments.record else ()
        for kind in (*first, "mock_bus", "pose_input", "scp_controller", "trajectory_generator"):
            self._start(kind)
        deadline = time.monotonic() + _READY_TIMEOUT_S
        while not self._port.exists():
            self._check()
            if time.monotonic() > deadline:
                raise NotReadyError("the mock's port", _READY_TIMEOUT_S, f"no {self._port}")
            time.sleep(0.02)
        self._start("bus_driver")
        with without_shared_memory():
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
            self._node = rclpy.create_node("demo", namespace=self._namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self.recorder = Recorder(self._node, self.series)
        # Made long before they are used: a server loses the reply to a client that it has not
        # discovered yet.
        for node, service in (
            ("trajectory_generator", START),
            ("trajectory_generator", STOP),
            ("scp_controller", ENABLE),
        ):
            name = service.name.replace("~", node, 1)
            self._clients[name] = self._node.create_client(service.type, name)

    def _start(self, kind: str) -> None:
        given = ["--ros-args", "-r", f"__ns:={self._namespace}"]
        for path in self._arguments.all_params_files:
            given += ["--params-file", str(path)]
        single: dict[str, Any] = {}
        if kind in ("mock_bus", "bus_driver"):
            single["port"] = self._port
        if kind == "mock_bus":
            single |= self._arguments.mock_parameters
        if kind == "record":
            single |= {"file": self._arguments.recording, "strip_namespace": "true"}
        for name, value in single.items():
            # With the node's name: to rcl a file's section of this node outranks a bare -p.
            given += ["-p", f"{kind}:{name}:={value}"]
        self.processes.start(kind, given)

    def _wait_until_ready(self) -> None:
        recorder = self._recorder()
        deadline = time.monotonic() + _READY_TIMEOUT_S

        def wait(what: str, condition: Callable[[], bool], found: Callable[[], str]) -> None:
            if not self._spin_until(condition, deadline):
                raise NotReadyError(what, _READY_TIMEOUT_S, found())

        wait(
            "a valid head pose",
            lambda: recorder.head is not None and recorder.head.status == PoseStatus.STATUS_VALID,
            lambda: f"pose_input says: {recorder.head.text if recorder.head else 'nothing'}",
        )
        wait(
            "scp_controller to see joints and head",
            lambda: _has_inputs(recorder.controller),
            lambda: (
                "scp_controller says: "
                + (recorder.controller.text if recorder.controller else "nothing")
            ),
        )
        # The controller commands zeros until there is a reference. A driver that has just been
        # started wants one before it takes motion.
        wait(
            "bus_driver to take commands",
            lambda: recorder.bus is not None and recorder.bus.state == BusState.STATE_MOVING,
            lambda: _bus_text(recorder.bus),
        )

    def _watch(self, recorder: Recorder) -> Outcome:
        duration_s = self._arguments.duration_s
        judge = RunJudge(duration_s, self._config.controller.case)
        seen, heard = recorder.controller, time.monotonic()
        told = False
        while True:
            self._take_all(recorder)
            now = time.monotonic()
            self.memory.look(now, self.processes.pids())
            self.processor.look(now, self.processes.pids())
            if recorder.controller is not seen:
                seen, heard = recorder.controller, now
            elif now - heard > _SILENCE_TIMEOUT_S:
                raise NotReadyError(
                    "the next control step", _SILENCE_TIMEOUT_S, "controller_state fell silent"
                )
            if recorder.bus is not None and recorder.bus.state in (
                BusState.STATE_STOPPED,
                BusState.STATE_EMERGENCY_STOP,
            ):
                return Outcome(_bus_text(recorder.bus), EXIT_FAILED)
            step = recorder.latest
            if step is not None and self._progress.due:
                self._progress.show(progress_text(step, duration_s))
            if recorder.fell_at_s is not None and not told:
                told = True
                self._progress.say(f"the robot fell at {recorder.fell_at_s:.1f} s")
            assert seen is not None
            outcome = judge.outcome(
                now,
                None if step is None else step.t_s,
                recorder.fell_at_s,
                STATUS_WORDS[seen.status],
                seen.text,
            )
            if outcome is not None:
                return outcome

    def _stop_in_order(self) -> None:
        """Stop the reference, the controller and the driver, then the mock; never raises."""
        if self._executor is not None:
            if self.recorder is not None:
                self.recorder.finish()
            for node, service, request in (
                ("trajectory_generator", STOP, Trigger.Request()),
                ("scp_controller", ENABLE, SetBool.Request(data=False)),
            ):
                if not self.processes.is_running(node):
                    continue
                try:
                    self._call(node, service, request, _SERVICE_TIMEOUT_S, checked=False)
                except NotReadyError as error:
                    self.stop_findings.append(str(error))
        self.stop_findings += self.processes.stop(_STOP_ORDER, _NODE_STOP_TIMEOUT_S)
        self.series.close()
        if self._executor is not None:
            self._executor.shutdown()

    def leave(self) -> None:
        """Leave the graph; nothing else is left to do then."""
        if self._executor is not None:
            end_soon()
            self._node.destroy_node()
            rclpy.try_shutdown()

    def _call(
        self, node: str, service: Service, request: Any, timeout_s: float, checked: bool = True
    ) -> None:
        """Call a node's service; while ``checked``, signals and dead nodes end the waiting."""
        name = service.name.replace("~", node, 1)
        client = self._clients[name]
        deadline = time.monotonic() + timeout_s
        if not self._spin_until(client.service_is_ready, deadline, checked):
            raise NotReadyError(f"service {name}", timeout_s, "nobody offers it")
        future = client.call_async(request)
        if not self._spin_until(future.done, deadline, checked):
            raise NotReadyError(f"a reply of {name}", timeout_s, "no reply")
        response = future.result()
        if not response.success:
            raise NotReadyError(f"success of {name}", timeout_s, f"it says: {response.message}")

    def _spin_until(
        self, condition: Callable[[], bool], deadline: float, checked: bool = True
    ) -> bool:
        while not condition():
            if time.monotonic() > deadline:
                return False
            self._spin_once(checked)
        return True

    def _spin_once(self, checked: bool = True) -> None:
        if checked:
            self._check()
        assert self._executor is not None
        self._executor.spin_once(timeout_sec=0.05)

    def _take_all(self, recorder: Recorder) -> None:
        """Let messages gather for a moment, then take them all: half the work of one by one."""
        self._check()
        time.sleep(_GATHER_S)
        assert self._executor is not None
        before = -1
        while recorder.received > before:
            before = recorder.received
            # With a timeout of 0 rclpy returns at its own wake-ups and leaves messages waiting.
            self._executor.spin_once(timeout_sec=_TAKE_S)

    def _check(self) -> None:
        if self._signal is not None:
            raise StopRequested(self._signal)
        self.processes.check()

    def _recorder(self) -> Recorder:
        assert self.recorder is not None
        return self.recorder

    def on_signal(self, number: int, _frame: FrameType | None) -> None:
        """Take note that the run shall end (a signal handler)."""
        self._signal = number


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demo; return its exit code.

    0: done (Case 1 may also fall or be left behind); 1: fell, did not follow the reference, a node
    died or did not get ready; 2: bad arguments or configuration; 130, 143: stopped by SIGINT,
    SIGTERM.
    """
    arguments = parse_arguments(argv)
    try:
        config = arguments.load()
        arguments.prepare_out()
    except SnakeError as error:
        print(f"configuration error: {error}", file=sys.stderr)
        return EXIT_USAGE
    except OSError as error:
        print(f"cannot write to {arguments.out}: {error}", file=sys.stderr)
        return EXIT_USAGE
    with own_domain(), tempfile.TemporaryDirectory(prefix="snake_control_demo_") as directory:
        demo = Demo(arguments, config, Path(directory))
        # Also while the results are written: a second Ctrl-C must not lose them.
        with ending_signals(demo.on_signal):
            try:
                outcome = demo.run()
            finally:
                demo.processes.kill()
            _write_results(arguments, config, demo, outcome)
    demo.leave()
    return outcome.exit_code


def _write_results(arguments: DemoArguments, config: Config, demo: Demo, outcome: Outcome) -> None:
    # Here, because matplotlib takes a second to load and the robot shall not wait for it.
    from snake_control.experiment.figures import draw_all

    run = Run(
        case=config.controller.case,
        K=config.controller.K,
        ended=outcome.ended.splitlines()[0],
        parameters=arguments.summary_parameters(config),
        bus=demo.recorder.bus_totals() if demo.recorder else None,
    )
    summary = summarise(demo.series, run)
    summary["exit_code"] = outcome.exit_code
    summary["startup_s"] = demo.startup_s
    summary["memory"] = demo.memory.growth()
    summary["processor"] = demo.processor.shares()
    summary["stop_findings"] = demo.stop_findings
    write_summary(summary, arguments.out / "summary.json")
    figures = draw_all(demo.series, run.case, arguments.out)
    if outcome.exit_code != EXIT_OK:
        print(outcome.ended, file=sys.stderr)
    for finding in demo.stop_findings:
        print(f"while stopping: {finding}", file=sys.stderr)
    print(f"\n{format_summary(summary)}\n")
    recordings = (arguments.recording,) if arguments.record else ()
    tables = (arguments.out / "summary.json", arguments.out / "series.csv")
    for path in (*tables, *recordings, *figures):
        print(path)
    print(f"{arguments.out / 'logs'}{os.sep}")


def _bus_text(bus: BusState | None) -> str:
    if bus is None:
        return "bus_driver says nothing"
    return f"bus_driver is {_BUS_STATES.get(bus.state, bus.state)}: {bus.text}"


def _has_inputs(controller: ControllerState | None) -> bool:
    return (
        controller is not None
        and controller.status in (ControllerState.STATUS_WAITING, *FOLLOWING)
        and math.isfinite(controller.joint_states_age)
        and math.isfinite(controller.head_age)
    )


if __name__ == "__main__":
    sys.exit(main())
