"""From a pose of the motion capture to bytes on the bus, beside a bare rclpy relay.

Three messages between four processes: this one sends the pose, ``pose_input`` the odometry,
``scp_controller`` the command, and ``bus_driver`` writes goals. The robot follows its line the
while, the mock at the other end of the port. How long a message waited for a tick of the
controller or the driver (and for the transaction that was on the bus) the nodes say themselves;
all else is the rest. What the controller works out while a message waits is in the waiting.

The relay has as many messages between as many processes, as often as there are commands. It runs
all the time: beside the robot, between the robot's poses, so that both meet the same machine at the
same load; and alone before, which says what that load is worth.

What the nodes take of the processor the while is measured, too, beside a link of that relay, which
is a node that does nothing with a message but pass it on, 50 times a second.
"""

from __future__ import annotations

import itertools
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from snake_interfaces.msg import BusState, ControllerState

from snake_control.cli.node_processes import NodeProcesses
from snake_control.cli.processor import ProcessorWatch
from snake_control.cli.ros_domain import own_domain
from snake_control.nodes import topics
from snake_control.nodes.transport import without_shared_memory

POSES_HZ = 100.0
COMMANDS_HZ = 50.0
RELAY_S = 8.0
ROBOT_S = 24.0
SETTLE_S = 4.0
"""Left out at the start of each part: discovery, and the robot's first steps."""

_ROOT = Path(__file__).parents[1]
_START_S = 60.0
_END_S = 5.0
_RAW = "mocap/raw"
_Times = dict[str, list[float]]
_FOLLOWING = (ControllerState.STATUS_TRACKING, ControllerState.STATUS_LIMITED)


class _Bench(Node):
    def __init__(self) -> None:
        super().__init__("latency_bench")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)
        self.steps: dict[int, ControllerState] = {}
        self.cycles: dict[int, BusState] = {}
        self.following = self.bus_active = False
        self.text = self.bus_text = ""

    def spin(self, until: Callable[[], object], timeout_s: float) -> bool:
        deadline = time.monotonic() + timeout_s
        while not until():
            if time.monotonic() > deadline:
                return False
            self._executor.spin_once(timeout_sec=0.05)
        return True

    def spin_for(self, seconds: float) -> None:
        self.spin(lambda: False, seconds)

    def now(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9

    def stamp(self, message: PoseStamped) -> PoseStamped:
        message.header.stamp = self.get_clock().now().to_msg()
        return message

    def hear_step(self, message: ControllerState) -> None:
        self.following, self.text = message.status in _FOLLOWING, message.text
        if self.following:
            self.steps[_ns(message.header.stamp)] = message

    def hear_cycle(self, message: BusState) -> None:
        self.bus_text = message.text
        self.bus_active = message.state in (BusState.STATE_HOLDING, BusState.STATE_MOVING)
        # Of a command that serves two cycles the first counts.
        self.cycles.setdefault(_ns(message.command_stamp), message)


def _ns(stamp) -> int:  # type: ignore[no-untyped-def]
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


class _Relay:
    """Three processes that pass poses on; how long it took is known when they have ended."""

    def __init__(self, bench: _Bench, directory: Path) -> None:
        times = directory / "relay.json"
        ends = (["relay_0", "relay_1"], ["relay_1", "relay_2"], ["relay_2", "--times", str(times)])
        self._times = times
        self._bench = bench
        self._processes = [
            subprocess.Popen([sys.executable, "-m", "benchmarks.relay", *end], cwd=_ROOT)
            for end in ends
        ]
        t = topics.MOCAP_POSE
        self._publisher = bench.create_publisher(t.type, "relay_0", t.qos)

    def pids(self) -> dict[str, int]:
        return {f"relay_{k}": process.pid for k, process in enumerate(self._processes)}

    def await_start(self) -> None:
        if not self._bench.spin(self._publisher.get_subscription_count, _START_S):
            raise RuntimeError("the relay does not start")

    def send(self) -> None:
        self._publisher.publish(self._bench.stamp(PoseStamped()))

    def times(self) -> list[tuple[float, float]]:
        """Return when each pose was sent, on the clock of stamps, and how long it took [s].

        The last process writes them when it ends.
        """
        return [(sent, taken) for sent, taken in json.loads(self._times.read_text())]

    def end(self) -> None:
        for process in self._processes:
            process.send_signal(signal.SIGINT)
        for process in self._processes:
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                # The middleware may hang while nodes disappear at the same time; the times were
                # written before.
                process.kill()
                process.wait()
        self._bench.destroy_publisher(self._publisher)


def _relay_alone(bench: _Bench, relay: _Relay) -> tuple[float, float]:
    """Send poses through the relay for a while; return when that began and ended."""
    timer = bench.create_timer(1.0 / COMMANDS_HZ, relay.send)
    bench.spin_for(SETTLE_S)
    begun = bench.now()
    bench.spin_for(RELAY_S)
    bench.destroy_timer(timer)
    return begun, bench.now()


class _Run(NamedTuple):
    """What the robot did.

    Attributes:
        times: of all commands that followed a pose and reached the bus [s].
        span: when that began and ended [s].
        shares: of a core that each process took meanwhile, the relay's included.
    """

    times: _Times
    span: tuple[float, float]
    shares: dict[str, float]


def _robot(bench: _Bench, relay: _Relay, directory: Path) -> _Run:
    """Let the robot follow its line, poses going through the relay, too."""
    processes = NodeProcesses(directory, os.environ | {"ROS_LOG_DIR": str(directory)})
    config = _ROOT / "config"
    files = ["--params-file", str(config / "paper_robot.yaml")]
    files += ["--params-file", str(config / "case_3.yaml")]
    link = str(directory / "bus")
    own = {
        "mock_bus": ["-p", f"port:={link}", "-r", f"{topics.MOCAP_POSE.name}:={_RAW}"],
        "pose_input": [],
        "scp_controller": [],
        # Not before they run: nodes that start keep two processors from the mock and from it.
        "bus_driver": ["-p", f"port:={link}"],
        "trajectory_generator": ["-p", "autostart:=true", "-p", "start_from:=head"],
    }
    t = topics.MOCAP_POSE
    pose = bench.create_publisher(t.type, t.name, t.qos)

    turns = itertools.cycle([True] + [False] * (round(POSES_HZ / COMMANDS_HZ) - 1))

    def pass_on(message: PoseStamped) -> None:
        pose.publish(bench.stamp(message))
        if next(turns):
            between.reset()

    def send_between() -> None:
        between.cancel()
        relay.send()

    between = bench.create_timer(0.5 / POSES_HZ, send_between)
    bench.create_subscription(t.type, _RAW, pass_on, t.qos)
    for t, heard in (
        (topics.CONTROLLER_STATE, bench.hear_step),
        (topics.BUS_STATE, bench.hear_cycle),
    ):
        bench.create_subscription(t.type, t.name, heard, t.qos)
    try:
        for kind, more in own.items():
            processes.start(kind, ["--ros-args", *files, *more])
            if kind == "mock_bus" and not bench.spin(lambda: os.path.lexists(link), _START_S):
                raise RuntimeError("the mock does not start")
            if kind == "scp_controller" and not bench.spin(lambda: bench.text, _START_S):
                raise RuntimeError("the controller does not start")
            if kind == "bus_driver" and not bench.spin(lambda: bench.bus_active, _START_S):
                raise RuntimeError(f"the driver does not start: {bench.bus_text}")
        if not bench.spin(lambda: bench.following, _START_S):
            raise RuntimeError(f"the robot does not follow: {bench.text}")
        bench.spin_for(SETTLE_S)
        bench.steps.clear()
        watch, pids = ProcessorWatch(0.0), processes.pids() | relay.pids()
        begun = bench.now()
        watch.look(begun, pids)
        bench.spin_for(ROBOT_S)
        ended = bench.now()
        watch.look(ended, pids)
        processes.check()
    finally:
        processes.stop(reversed(own), 8.0)
    found: _Times = {
        name: [] for name in ("end_to_end", "waiting", "rest", "to_controller", "to_bus", "step")
    }
    for stamp, cycle in bench.cycles.items():
        step = bench.steps.get(stamp)
        if step is None:
            continue
        whole = (_ns(cycle.goals_sent) - stamp) * 1e-9 + step.head_age
        waiting = step.head_waited + cycle.command_waited
        found["end_to_end"].append(whole)
        found["waiting"].append(waiting)
        found["rest"].append(whole - waiting)
        to_controller = step.head_age - step.head_waited
        found["to_controller"].append(to_controller)
        found["to_bus"].append(whole - waiting - to_controller)
        found["step"].append(step.step_time)
    if not found["rest"]:
        raise RuntimeError(f"the robot did not follow: {bench.text}")
    return _Run(found, (begun, ended), watch.shares() or {})


def _figures(name: str, times: list[float]) -> dict[str, float]:
    return {
        f"{name}_p50_ms": 1e3 * statistics.median(times),
        f"{name}_p99_ms": 1e3 * float(np.percentile(times, 99)),
    }


def measure(_blocks: int, _calls: int) -> dict[str, dict[str, float]]:
    """Measure the relay alone, then robot and relay beside each other."""
    with tempfile.TemporaryDirectory(prefix="bench_") as name, own_domain():
        directory = Path(name)
        with without_shared_memory():
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
            bench = _Bench()
        try:
            relay = _Relay(bench, directory)
            try:
                relay.await_start()
                alone = _relay_alone(bench, relay)
                run = _robot(bench, relay, directory)
            finally:
                relay.end()
            poses = relay.times()
        finally:
            bench.destroy_node()
            rclpy.shutdown()

    def taken(span: tuple[float, float]) -> list[float]:
        return [each for sent, each in poses if span[0] <= sent <= span[1]]

    robot, beside = run.times, run.span
    rest = statistics.median(robot["rest"])
    shares = dict(run.shares)
    of_relay = statistics.median(shares.pop(f"relay_{k}") for k in range(3))
    of_mock = shares.pop("mock_bus")
    return {
        "robot": {
            "commands": float(len(robot["rest"])),
            **_figures("end_to_end", robot["end_to_end"]),
            **_figures("waiting", robot["waiting"]),
            **_figures("rest", robot["rest"]),
            **_figures("of_it_to_controller", robot["to_controller"]),
            **_figures("of_it_to_bus", robot["to_bus"]),
            **_figures("of_that_step", robot["step"]),
            "rest_to_relay": rest / statistics.median(taken(beside)),
            "rest_to_relay_alone": rest / statistics.median(taken(alone)),
        },
        "relay": {
            "poses": float(len(taken(beside))),
            **_figures("beside", taken(beside)),
            **_figures("alone", taken(alone)),
        },
        "processor": {
            **{f"{name}_percent_of_a_core": 100.0 * share for name, share in shares.items()},
            "all_nodes_percent_of_a_core": 100.0 * sum(shares.values()),
            "mock_percent_of_a_core": 100.0 * of_mock,
            "one_relay_percent_of_a_core": 100.0 * of_relay,
            "all_nodes_to_one_relay": sum(shares.values()) / of_relay,
        },
    }
