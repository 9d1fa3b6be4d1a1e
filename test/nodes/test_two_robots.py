"""Two robots in one graph, each in its namespace: what one is told, the other does not do."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import yaml
from geometry_msgs.msg import TwistStamped
from snake_interfaces.msg import BusState

from snake_control.config import RobotConfig
from snake_control.nodes import topics
from snake_control.nodes.conversions import header, vector
from support.graph import CONFIG, Graph

ROBOTS = ("robot_1", "robot_2")
KINDS = ("mock_bus", "pose_input", "scp_controller", "trajectory_generator", "bus_driver")
START = np.array(RobotConfig().start_joint_angles_rad)
# The second robot starts as the first one's mirror image, so that their data differ.
STARTS = {"robot_1": START, "robot_2": START * np.where(np.arange(len(START)) > 4, -1.0, 1.0)}
# Ten processes want less of the machine so, and bear to be kept waiting.
EASY = {
    "/**": {
        "timeout_s": 0.5,
        "head_timeout_s": 0.5,
        "joint_states_timeout_s": 0.5,
        "reference_timeout_s": 0.5,
        "command_timeout_s": 0.5,
        "feedback_timeout_s": 0.5,
        "cmd_vel_timeout_s": 1.0,
    },
    "/**/mock_bus": {"mocap_rate_hz": 50.0, "step_hz": 100.0, "wire_time": False},
    "/**/bus_driver": {
        "rate_hz": 20.0,
        "diagnostics_period_s": 0.5,
        "reply_timeout_s": 0.1,
        "retries": 5,
        "unheard_timeout_s": 10.0,
        "follow_timeout_s": 10.0,
    },
    "/**/scp_controller": {"rate_hz": 20.0},
    "/**/trajectory_generator": {"rate_hz": 20.0},
}


class Robot:
    """One robot's nodes and what is heard of it."""

    def __init__(self, graph: Graph, name: str, directory: Path) -> None:
        self.name = name
        self._graph = graph
        self._port = directory / name
        self._files = [CONFIG / "paper_robot.yaml", directory / "easy.yaml"]
        self.truth, self.states, self.bus, self.commands, self.references, self.joints = (
            graph.subscribe(self.own(topic))
            for topic in (
                topics.PLANT_STATE,
                topics.CONTROLLER_STATE,
                topics.BUS_STATE,
                topics.JOINT_VELOCITY_COMMAND,
                topics.HEAD_REFERENCE,
                topics.JOINT_STATES,
            )
        )
        self._start("mock_bus", port=str(self._port))

    def own(self, topic: topics.Topic) -> topics.Topic:
        return dataclasses.replace(topic, name=f"/{self.name}/{topic.name}")

    def start_the_others(self) -> None:
        self._graph.wait_for(self._port.exists, 30.0, f"the port of {self.name}")
        for kind in KINDS[1:]:
            port = {"port": str(self._port)} if kind == "bus_driver" else {}
            self._start(kind, **port)

    def _start(self, kind: str, **params: str) -> None:
        angles = {"robot.start_joint_angles_rad": STARTS[self.name].tolist()}
        self._graph.start(
            kind,
            params_files=self._files,
            params=angles | params,
            arguments=["-r", f"__ns:=/{self.name}"],
        )

    @property
    def ready(self) -> bool:
        return (
            self.bus.last is not None
            and self.bus.last.state == BusState.STATE_MOVING
            and self.states.last is not None
            and self.states.last.text == "waiting for head/reference"
        )

    @property
    def way(self) -> float:
        """How far its head is from where it was first [m]."""
        w = [np.array(self.truth.messages[i].w[:3]) for i in (0, -1)]
        return float(np.linalg.norm(w[1] - w[0]))


def test_only_the_robot_that_is_told_moves_and_each_tells_of_itself(tmp_path):
    easy = {section: {"ros__parameters": values} for section, values in EASY.items()}
    (tmp_path / "easy.yaml").write_text(yaml.safe_dump(easy))
    with Graph() as graph:
        diagnostics = graph.subscribe(topics.DIAGNOSTICS)
        first, second = robots = [Robot(graph, name, tmp_path) for name in ROBOTS]
        for robot in robots:
            robot.start_the_others()
        graph.wait_for(lambda: first.ready and second.ready, 60.0, "both robots")
        cmd_vel = graph.publisher(first.own(topics.CMD_VEL), wait=True)

        def drive() -> None:
            message = TwistStamped(header=header(0))
            message.twist.linear = vector((0.05, 0.0, 0.0))
            cmd_vel.publish(message)

        for robot in robots:
            robot.truth.clear()
        graph.wait_for(lambda: first.truth.last and second.truth.last, 10.0, "both bodies")
        graph.every(0.1, drive)
        graph.wait_for(lambda: first.way > 0.02, 30.0, "the first robot's head to move")
        assert second.way < 1e-3
        assert second.references.messages == []
        assert {tuple(c.velocity) for c in second.commands.messages} == {(0.0,) * len(START)}
        assert any(np.any(c.velocity) for c in first.commands.messages)

        for robot in robots:
            # The head may have sunk while one servo after the other got its torque.
            found = np.array(robot.joints.messages[0].position)
            np.testing.assert_allclose(found[5:], STARTS[robot.name][5:], atol=0.02)
        told = {status.name: status for m in diagnostics.messages for status in m.status}
        parts = ("bus", *(f"joint_{joint}" for joint in range(1, len(START) + 1)))
        whose = [f"bus_driver: {part}" for part in parts] + ["pose_input: head pose"]
        assert set(told) == {f"{name}/{what}" for name in ROBOTS for what in whose}
        for name in ROBOTS:
            assert told[f"{name}/bus_driver: joint_3"].hardware_id == f"{name}: AX-12 id 3"
            port = f"{name}: {tmp_path / name}"
            assert told[f"{name}/bus_driver: bus"].hardware_id == port

        # Nothing of the package is absolute but what serves the whole graph.
        shared = {"/rosout", "/parameter_events", "/diagnostics", "/tf"}
        names = {name for name, _ in graph.node.get_topic_names_and_types()} - shared
        owners: dict[str, set[str]] = {name: set() for name in ROBOTS}
        for name in names:
            _, owner, own = name.split("/", 2)
            owners[owner].add(own)
        assert owners["robot_1"] == owners["robot_2"]
        assert owners["robot_1"] >= {"controller_state", "joint_states", "head/odometry", "markers"}
        services = {name for name, _ in graph.node.get_service_names_and_types()}
        assert {name.split("/")[1] for name in services} <= {*ROBOTS, graph.node.get_name()}
