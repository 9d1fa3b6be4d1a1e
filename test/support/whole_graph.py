"""The five nodes as processes, with the mock robot: what a user starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from numpy.typing import NDArray
from snake_interfaces.msg import BusState, PlantState, PoseStatus

from snake_control.nodes import topics
from snake_control.nodes.conversions import header, stamp_ns, vector
from support.graph import CONFIG, Graph


class WholeGraph:
    """Context manager around the five nodes, ready to follow references.

    Attributes:
        graph: where they run.
        processes: by kind of node.
        truth, commands, references, states, bus: recorders.
    """

    def __init__(self, directory: Path, **params: Mapping[str, Any]) -> None:
        """Prepare; ``directory`` is for the port's link, ``params`` are by kind of node."""
        self._port = directory / "servo_bus"
        self._params = params
        self._velocity: tuple[float, float, float] | None = None

    def __enter__(self) -> WholeGraph:
        self.graph = graph = Graph().__enter__()
        try:
            self.truth = graph.subscribe(topics.PLANT_STATE)
            self.commands = graph.subscribe(topics.JOINT_VELOCITY_COMMAND)
            self.references = graph.subscribe(topics.HEAD_REFERENCE)
            self.states = graph.subscribe(topics.CONTROLLER_STATE)
            self.bus, head = graph.subscribe(topics.BUS_STATE), graph.subscribe(topics.HEAD_STATUS)
            self._cmd_vel = graph.publisher(topics.CMD_VEL)
            self.processes = {}
            for kind in (
                "mock_bus",
                "bus_driver",
                "pose_input",
                "scp_controller",
                "trajectory_generator",
            ):
                port = {"port": str(self._port)} if kind in ("mock_bus", "bus_driver") else {}
                self.processes[kind] = graph.start(
                    kind,
                    params_files=[CONFIG / "paper_robot.yaml"],
                    params={**port, **self._params.get(kind, {})},
                )
                if kind == "mock_bus":
                    graph.wait_for(self._port.exists, 30.0, "the port of the mock")
            graph.wait_for(
                lambda: head.last and head.last.status == PoseStatus.STATUS_VALID,
                20.0,
                "a valid head pose",
            )
            graph.wait_for(
                lambda: (
                    self.truth.last
                    and self.states.last
                    and self.states.last.text == "waiting for head/reference"
                ),
                20.0,
                "the controller waiting for a reference only",
            )
            # It commands zeros meanwhile, and a driver wants one before it takes motion.
            graph.wait_for(
                lambda: self.bus.last and self.bus.last.state == BusState.STATE_MOVING,
                40.0,
                "the driver to take commands",
            )
            graph.wait_for(self._cmd_vel.get_subscription_count, 20.0, "the trajectory generator")
            graph.every(0.05, self._publish)
        except BaseException:
            graph.__exit__(None, None, None)
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        self.graph.__exit__(*exception)

    @property
    def w(self) -> NDArray[np.float64]:
        """True head pose, shape (6,)."""
        return np.array(self.truth.last.w)

    def drive(self, velocity: tuple[float, float, float] | None) -> None:
        """Send ``cmd_vel`` with this velocity in the world, as if typed by hand; ``None`` stops."""
        self._velocity = velocity

    def truth_after(self, time_ns: int) -> list[PlantState]:
        """Ground truth stamped later than ``time_ns``."""
        return [state for state in self.truth.messages if stamp_ns(state) > time_ns]

    def wait_truth(self, condition: Callable[[PlantState], bool], timeout_s: float, what: str):
        """Wait until the newest ground truth fulfils a condition."""
        self.graph.wait_for(lambda: condition(self.truth.last), timeout_s, what)

    def _publish(self) -> None:
        if self._velocity is not None:
            message = TwistStamped(header=header(0))
            message.twist.linear = vector(self._velocity)
            self._cmd_vel.publish(message)
