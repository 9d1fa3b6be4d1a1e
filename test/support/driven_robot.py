"""A mock robot with its driver on a ROS domain of their own, and a publisher of velocities."""

from __future__ import annotations

import json
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from snake_interfaces.msg import BusState

from snake_control.nodes import topics
from support.graph import CONFIG, Graph
from support.process import Process

NAMES = tuple(f"joint_{i}" for i in range(1, 12))


class DrivenRobot:
    """Context manager around mock_bus and bus_driver.

    Attributes:
        graph: where they run.
        mock, driver: the processes.
        joint_states, bus_state, truth, diagnostics: recorders.
    """

    def __init__(
        self,
        directory: Path,
        driver: Mapping[str, Any] | None = None,
        mock: Mapping[str, Any] | None = None,
        with_mock: bool = True,
        with_driver: bool = True,
    ) -> None:
        """Prepare.

        Args:
            directory: for the port's link and the parameter file.
            driver, mock: parameters of the two nodes.
            with_mock, with_driver: whether there are a mock and a driver from the start.
        """
        port = str(directory / "port")
        self.port = Path(port)
        self._file = directory / "test.yaml"
        self._file.write_text(
            json.dumps(  # JSON is YAML; PyYAML would write aliases, which rcl refuses
                {
                    "/**/mock_bus": {"ros__parameters": {"port": port, **(mock or {})}},
                    "/**/bus_driver": {"ros__parameters": {"port": port, **(driver or {})}},
                }
            )
        )
        self._with_mock = with_mock
        self._with_driver = with_driver
        self._velocities: tuple[float, ...] | None = None
        self._obeyed = False
        self._lock = threading.Lock()

    def __enter__(self) -> DrivenRobot:
        self.graph = Graph().__enter__()
        try:
            self.joint_states = self.graph.subscribe(topics.JOINT_STATES)
            self.bus_state = self.graph.subscribe(topics.BUS_STATE)
            self.truth = self.graph.subscribe(topics.PLANT_STATE)
            self.diagnostics = self.graph.subscribe(topics.DIAGNOSTICS)
            self.commands = self.graph.publisher(topics.JOINT_VELOCITY_COMMAND)
            self.graph.node.create_timer(0.02, self._publish)
            if self._with_mock:
                self.start_mock()
            if self._with_driver:
                self.driver = self.start_driver()
        except BaseException:
            self.graph.__exit__(None, None, None)
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        self.graph.__exit__(*exception)

    def start_mock(self) -> None:
        """Start the mock and wait for its port."""
        self.mock = self._start("mock_bus")
        self.graph.wait_for(self.port.exists, 30.0, "the mock's port")

    def start_driver(self) -> Process:
        """Start a driver."""
        self._obeyed = False
        return self._start("bus_driver")

    def wait_for_state(self, state: int, timeout_s: float = 30.0) -> Any:
        """Wait for a bus state with this state and return it."""

        def found() -> Any:
            last = self.bus_state.last
            return last if last is not None and last.state == state else None

        return self.graph.wait_for(found, timeout_s, f"bus state {state}")

    def command(self, **velocities: float) -> None:
        """Publish these velocities at 50 Hz from now on, 0 for the other joints.

        A driver that has just been started wants to see a zero command first.
        """
        if not self._obeyed:
            self._set((0.0,) * len(NAMES))
            self.wait_for_state(BusState.STATE_MOVING)
            self._obeyed = True
        self.ask(**velocities)

    def ask(self, **velocities: float) -> None:
        """Do as ``command``, but without the zero before: the driver may well refuse."""
        self._set(tuple(velocities.get(name, 0.0) for name in NAMES))

    def _set(self, velocities: tuple[float, ...] | None) -> None:
        with self._lock:
            self._velocities = velocities

    def fall_silent(self) -> None:
        """Publish no command any more."""
        self._set(None)

    def let_pass(self, seconds: float) -> None:
        """Wait until the mock's robot is this much older."""
        begin = self.graph.wait_for(lambda: self.truth.last, 30.0, "the mock's ground truth")

        def passed() -> bool:
            return stamp(self.truth.last) - stamp(begin) >= seconds

        self.graph.wait_for(passed, 10.0 * seconds + 10.0, f"{seconds} s to pass")

    def message(self, velocities: Mapping[str, float]) -> Any:
        """A command with the stamp of now."""
        message = topics.JOINT_VELOCITY_COMMAND.type()
        message.header.stamp = self.graph.node.get_clock().now().to_msg()
        message.name = list(velocities)
        message.velocity = [float(value) for value in velocities.values()]
        return message

    def call(self, service: Any, **request: Any) -> Any:
        """Call a service of the driver."""
        return self.graph.call("bus_driver", service, service.type.Request(**request))

    def _start(self, kind: str) -> Process:
        return self.graph.start(kind, params_files=[CONFIG / "paper_robot.yaml", self._file])

    def _publish(self) -> None:
        with self._lock:
            velocities = self._velocities
        if velocities is not None:
            self.commands.publish(self.message(dict(zip(NAMES, velocities, strict=True))))


def stamp(message: Any) -> float:
    """The stamp of a message [s]."""
    time = message.header.stamp
    return float(time.sec + 1e-9 * time.nanosec)
