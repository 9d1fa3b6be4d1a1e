"""What is published is in the file, all of it, as it was; also if the recorder is killed."""

from __future__ import annotations

import dataclasses
import sys
from collections import Counter
from pathlib import Path

import pytest
import yaml
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from snake_interfaces.msg import BusState, ControllerState, ServoState

from snake_control.nodes import topics
from snake_control.nodes.message_definitions import type_name
from support.graph import Graph
from support.recordings import Recorded, read, recover

COUNT = 40
# Nodes that have nothing to do with the test log, too.
OWN = [t for t in topics.ALL if t.type is not Twist and t is not topics.ROSOUT]


def start(graph: Graph, path: Path, *arguments: str, **params):
    record = graph.start("record", params={"file": str(path), **params}, arguments=arguments)
    graph.wait_for(lambda: "recording to" in record.output(), 30.0, "the recorder")
    return record


def numbered(topic: topics.Topic, number: int):
    """A message of a topic that carries a number in its stamp, and some content."""
    message = topic.type()
    if hasattr(message, "header"):
        message.header.stamp.sec = number
    if isinstance(message, BusState):
        message.text = f"cycle {number}: über"
        message.servos = [ServoState(joint=f"joint_{i}", id=i, position=0.1 * i) for i in (1, 2, 3)]
    if isinstance(message, ControllerState):
        message.w = [float(number)] * 6
        message.u = [0.5, -0.25]
        message.speed_limited = ["joint_2"]
    return message


def in_robots_namespace(topic: topics.Topic) -> topics.Topic:
    """The topic as the robot's nodes offer it, with room for all that the test sends at once."""
    name = topic.name if topic.name.startswith("/") else f"/robot_1/{topic.name}"
    qos = QoSProfile(
        depth=2 * COUNT, reliability=topic.qos.reliability, durability=topic.qos.durability
    )
    return topics.Topic(name, topic.type, qos)


def test_every_message_of_every_topic_is_there_as_it_was_sent(tmp_path):
    path = tmp_path / "deep" / "run.mcap"
    with Graph() as graph:
        record = start(graph, path, "-r", "__ns:=/robot_1", flush_period_s=0.1)
        publishers = {
            topic.name: (topic, graph.publisher(topic)) for topic in map(in_robots_namespace, OWN)
        }
        for name, (_, publisher) in publishers.items():
            graph.wait_for(publisher.get_subscription_count, 20.0, f"the recorder on {name}")
        for number in range(COUNT):
            for topic, publisher in publishers.values():
                publisher.publish(numbered(topic, number))
        expected = COUNT * len(publishers)
        graph.wait_for(
            lambda: len(_of(path, *publishers)) == expected, 20.0, "everything in the file"
        )
        record.interrupt()
        assert record.wait(20.0) == 0, record.report()
        assert "none lost" in record.output()

    found = [entry for entry in read(path) if entry.channel.topic in publishers]
    assert Counter(e.channel.topic for e in found) == dict.fromkeys(publishers, COUNT)
    for name, (topic, _) in publishers.items():
        entries = [entry for entry in found if entry.channel.topic == name]
        assert {e.schema.name for e in entries} == {type_name(topic.type)}
        assert [e.message.sequence for e in entries] == list(range(1, COUNT + 1))
        times = [(e.message.publish_time, e.message.log_time) for e in entries]
        assert times == sorted(times)
        assert all(published <= logged for published, logged in times)
        for number, entry in enumerate(entries):
            sent = numbered(topic, number)
            assert deserialize_message(entry.message.data, topic.type) == sent
            if hasattr(sent, "header"):
                assert entry.decoded.header.stamp.sec == number
        (qos,) = yaml.safe_load(entries[0].channel.metadata["offered_qos_profiles"])
        assert qos["reliability"] == topic.qos.reliability.name.lower()
        assert qos["durability"] == topic.qos.durability.name.lower()
        assert qos["deadline"] == {"sec": 9223372036, "nsec": 854775807}
        assert entries[0].channel.metadata["topic_type_hash"].startswith("RIHS01_")
    state = next(e.decoded for e in found if e.schema.name.endswith("/ControllerState"))
    assert list(state.u) == [0.5, -0.25]
    assert state.speed_limited == ["joint_2"]
    bus = next(e.decoded for e in found if e.schema.name.endswith("/BusState"))
    assert [servo.joint for servo in bus.servos] == ["joint_1", "joint_2", "joint_3"]
    assert bus.text == "cycle 0: über"
    with path.open("rb") as stream:
        reader = pytest.importorskip("mcap.reader").make_reader(stream)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        # Of two types that one name may have, the one that is there.
        types = {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()}
        assert types["/robot_1/cmd_vel"] == type_name(TwistStamped)
        notes = {m.name: m.metadata for m in reader.iter_metadata()}
        assert notes == {"snake_control": {"lost": "0"}}


def test_what_a_killed_recorder_heard_is_readable_and_losses_are_told(tmp_path):
    path, second = tmp_path / "killed.mcap", tmp_path / "second.mcap"
    topic = topics.CONTROLLER_STATE
    with Graph() as graph:
        record = start(graph, path, flush_period_s=0.05)
        publisher = graph.publisher(
            dataclasses.replace(topic, qos=QoSProfile(depth=2 * COUNT)), wait=True
        )
        for number in range(COUNT):
            publisher.publish(numbered(topic, number))
        # What is complete in the file now outlasts the kill.
        graph.wait_for(
            lambda: len(_of(path, f"/{topic.name}")) == COUNT, 20.0, "the messages in the file"
        )
        record.kill()
        record.wait()
        numbers = [e.decoded.header.stamp.sec for e in _of(path, f"/{topic.name}")]
        assert numbers == list(range(COUNT))

        again = graph.start("record", params={"file": str(path)})
        again.let_end()
        assert again.wait(20.0) == 2, again.report()
        assert f"file = '{path}': it exists" in again.output()

        # A queue of one message loses most of a burst that comes while the recorder is away.
        slow = start(graph, second, "-r", "__ns:=/slow", queue=1, flush_period_s=0.1)
        name = f"/slow/{topic.name}"
        publisher = graph.publisher(dataclasses.replace(topic, name=name), wait=True)
        publisher.publish(numbered(topic, 0))
        graph.wait_for(lambda: _of(second, name), 20.0, "a message in the file")
        slow.pause()
        for number in range(1, COUNT):
            publisher.publish(numbered(topic, number))
        slow.resume()

        def newest_arrived() -> bool:
            return _of(second, name)[-1].decoded.header.stamp.sec == COUNT - 1

        graph.wait_for(newest_arrived, 20.0, "the newest message in the file")
        slow.interrupt()
        assert slow.wait(20.0) == 0, slow.report()
        kept = len([e for e in read(second) if e.channel.topic == name])
        assert 0 < kept < COUNT
        assert f"lost: {COUNT - kept} of {name}" in slow.output()


def test_without_the_package_it_says_what_to_install(tmp_path):
    (tmp_path / "mcap").mkdir()
    (tmp_path / "mcap" / "__init__.py").write_text("raise ModuleNotFoundError(name='mcap')\n")
    with Graph() as graph:
        path = str(tmp_path)
        graph.environment["PYTHONPATH"] = ":".join([path, *filter(None, sys.path)])
        record = graph.start("record", params={"file": str(tmp_path / "x.mcap")})
        record.let_end()
        assert record.wait(30.0) == 2, record.report()
        assert "pip install mcap, or record with ros2 bag" in record.output()
        assert "Traceback" not in record.output()


def _of(path: Path, *names: str) -> list[Recorded]:
    return [entry for entry in recover(path) if entry.channel.topic in names]


@pytest.mark.parametrize("topic", topics.ALL, ids=lambda topic: topic.name)
def test_names_are_relative_but_for_those_of_the_whole_graph(topic):
    whole_graph = ("/diagnostics", "/rosout", "/tf")
    assert topic.name in whole_graph or not topic.name.startswith(("/", "~"))
