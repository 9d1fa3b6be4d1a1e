"""What the nodes talk through, and that others hear them."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import sys
from pathlib import Path

import pytest

from snake_control.errors import ConfigError
from snake_control.nodes import topics, transport
from snake_control.nodes.transport import without_shared_memory
from support.graph import CONFIG, ROOT, Graph
from support.process import Process

# A node of anybody's, with what Fast DDS does by itself.
_STRANGER = """
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

rclpy.init()
node = rclpy.create_node("stranger")
qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
publisher = node.create_publisher(String, "heard", qos)
node.create_subscription(String, "robot_description", publisher.publish, qos)
rclpy.spin(node)
"""
_NAMES = (
    "FASTDDS_BUILTIN_TRANSPORTS",
    "FASTRTPS_DEFAULT_PROFILES_FILE",
    "ROS_AUTOMATIC_DISCOVERY_RANGE",
    "ROS_DISCOVERY_SERVER",
    "ROS_LOCALHOST_ONLY",
    "ROS_STATIC_PEERS",
    "SKIP_DEFAULT_XML_FILE",
)


@pytest.fixture
def surroundings(monkeypatch, tmp_path):
    """An environment that says nothing of transports, in an empty directory."""
    for name in _NAMES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    return monkeypatch


def environment() -> dict[str, str]:
    return {name: os.environ[name] for name in _NAMES if name in os.environ}


def shares_memory(process: Process) -> bool:
    return "/dev/shm/fastrtps" in Path(f"/proc/{process.pid}/maps").read_text()


def hears_datagrams(process: Process) -> bool:
    for path in Path(f"/proc/{process.pid}/task").glob("*/comm"):
        # A thread may end meanwhile.
        with contextlib.suppress(OSError):
            if path.read_text().startswith("dds.udp"):
                return True
    return False


@pytest.mark.parametrize("reach", ["LOCALHOST", "SUBNET"])
def test_a_node_shares_no_memory(reach):
    with Graph() as graph:
        graph.environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = reach
        logs = Path(graph.environment["ROS_LOG_DIR"])
        node = graph.start("description", params_files=[CONFIG / "paper_robot.yaml"])
        stranger = Process(
            "stranger",
            [sys.executable, "-c", _STRANGER],
            log=logs / "stranger.txt",
            cwd=ROOT,
            environment=graph.environment,
        )
        try:
            graph.wait_for(lambda: shares_memory(stranger), 20.0, "a stranger's shared memory")
            if reach == "LOCALHOST":
                heard = graph.subscribe(dataclasses.replace(topics.ROBOT_DESCRIPTION, name="heard"))
                graph.wait_for(lambda: heard.messages, 20.0, "what a stranger hears")
            graph.wait_for(lambda: hears_datagrams(node), 20.0, "the node to be in the graph")
            assert not shares_memory(node), node.report()
        finally:
            stranger.kill()
            stranger.wait()


def test_who_is_discovered_stays(surroundings):
    surroundings.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    surroundings.setenv("ROS_STATIC_PEERS", "192.0.2.7;localhost")
    before = environment()
    with without_shared_memory():
        assert environment() != before
        profile = Path(os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"]).read_text()
        assert [line.count("<udpv4>") for line in profile.splitlines() if "<udpv4>" in line] == [3]
        assert "<address>192.0.2.7</address>" in profile
    assert environment() == before


def test_a_peer_without_an_address_is_named(surroundings):
    surroundings.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    surroundings.setenv("ROS_STATIC_PEERS", "nobody.invalid")
    wrong = pytest.raises(ConfigError, match=r"ROS_STATIC_PEERS = 'nobody.invalid': no address")
    with wrong, without_shared_memory():
        pass


@pytest.mark.parametrize("peer", ["nobody..invalid", "x" * 70])
def test_a_peer_that_cannot_be_a_name_is_named(surroundings, peer):
    surroundings.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    surroundings.setenv("ROS_STATIC_PEERS", peer)
    with pytest.raises(ConfigError, match="ROS_STATIC_PEERS"), without_shared_memory():
        pass


def test_no_place_for_the_profile_is_told(surroundings, tmp_path):
    surroundings.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    surroundings.setattr("tempfile.tempdir", str(tmp_path / "none"))
    with pytest.raises(ConfigError, match="TMPDIR"), without_shared_memory():
        pass


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST", "FASTRTPS_DEFAULT_PROFILES_FILE"),
        # As rcl understands them.
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "localhost", "FASTRTPS_DEFAULT_PROFILES_FILE"),
        ("ROS_LOCALHOST_ONLY", "1", "FASTRTPS_DEFAULT_PROFILES_FILE"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET", "FASTDDS_BUILTIN_TRANSPORTS"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", "FASTDDS_BUILTIN_TRANSPORTS"),
        ("ROS_LOCALHOST_ONLY", "0", "FASTDDS_BUILTIN_TRANSPORTS"),
    ],
)
def test_each_range_has_its_way(surroundings, name, value, words):
    surroundings.setenv(name, value)
    with without_shared_memory():
        found = environment()
        assert words in found
        assert found.get("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4") == "UDPv4"
        assert found.get("ROS_LOCALHOST_ONLY") != "1"
    assert environment() == {name: value}


@pytest.mark.parametrize(
    ("name", "reach"),
    [
        ("FASTRTPS_DEFAULT_PROFILES_FILE", "LOCALHOST"),
        ("ROS_DISCOVERY_SERVER", "LOCALHOST"),
        ("FASTDDS_BUILTIN_TRANSPORTS", "SUBNET"),
    ],
)
def test_a_choice_of_the_user_stands(surroundings, name, reach):
    surroundings.setenv(name, "chosen")
    surroundings.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", reach)
    before = environment()
    with without_shared_memory():
        assert environment() == before


def test_transports_that_rmw_ignores_are_no_choice(surroundings):
    surroundings.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    surroundings.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with without_shared_memory():
        assert "FASTRTPS_DEFAULT_PROFILES_FILE" in environment()


@pytest.mark.parametrize("skip", [False, True])
def test_a_profile_beside_the_process_stands_if_it_is_read(surroundings, tmp_path, skip):
    (tmp_path / "DEFAULT_FASTRTPS_PROFILES.xml").write_text("<dds/>")
    surroundings.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    if skip:
        surroundings.setenv("SKIP_DEFAULT_XML_FILE", "1")
    with without_shared_memory():
        assert ("FASTRTPS_DEFAULT_PROFILES_FILE" in environment()) == skip


def test_another_middleware_is_left_alone(surroundings):
    surroundings.setattr(transport, "get_rmw_implementation_identifier", lambda: "rmw_other")
    with without_shared_memory():
        assert environment() == {}
