"""Every topic and field that a layout names is one that the robot has."""

from __future__ import annotations

import importlib
import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import Any

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry, Path
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from snake_control.cli import layouts
from snake_control.nodes import topics
from snake_control.nodes.markers import RobotMarkers
from support.robots import CONFIG, PAPER

TOPICS = {
    t.name if t.name.startswith("/") else f"/{t.name}": t for t in topics.ALL if t.type is not Twist
}
NUMBERS = re.compile(r"(double|float|boolean|u?int\d+|octet)$")
ARRAY = re.compile(
    r"(?:sequence<(?P<sequence>[\w/]+)(?:, \d+)?>|(?P<array>[\w/]+)\[(?P<size>\d+)\])$"
)
# One part of a path: a field, with an index, or with a filter on another field of the same element.
PART = re.compile(
    r"(?P<field>\w+)(?:\[(?P<index>\d+|:)\])?(?:\{(?P<key>\w+)==\"(?P<value>[^\"]+)\"\})?"
)


def message_type(name: str) -> type:
    package, _, own = name.partition("/")
    return getattr(importlib.import_module(f"{package}.msg"), own.rpartition("/")[2])


def leaf(type_: type, parts: list[str]) -> str:
    """Return the kind of the field that a path leads to; fails if it leads nowhere."""
    kind = ""
    for i, part in enumerate(parts):
        match = PART.fullmatch(part)
        assert match is not None, part
        fields = type_.get_fields_and_field_types()
        assert match["field"] in fields, f"{type_.__name__} has no {match['field']}"
        kind = fields[match["field"]]
        array = ARRAY.match(kind)
        assert (array is None) == (match["index"] is None), f"{part}: {kind}"
        if array is not None:
            kind = array["sequence"] or array["array"]
            # The sequences that are plotted have one entry for each joint.
            size = int(array["size"] or PAPER.joints)
            assert match["index"] == ":" or int(match["index"]) < size, part
        if match["key"] is not None:
            assert leaf(message_type(kind), [match["key"]]) == "string"
            assert match["value"] in PAPER.joint_names
        if i + 1 < len(parts):
            type_ = message_type(kind)
    return kind


def topic_of(path: str) -> topics.Topic:
    """Return the topic that a path begins with; names may have slashes inside."""
    names = [name for name in TOPICS if path == name or path.startswith((f"{name}/", f"{name}."))]
    assert names, f"no such topic: {path}"
    return TOPICS[max(names, key=len)]


def foxglove() -> dict[str, Any]:
    return json.loads((CONFIG / "layouts" / "foxglove.json").read_text(encoding="utf-8"))


def foxglove_paths() -> Iterator[tuple[str, bool]]:
    """Yield the message paths of all panels, and whether they are plotted."""
    for panel, config in foxglove()["configById"].items():
        for path in config.get("paths", ()):
            yield path["value"], panel.startswith("Plot!")
        if "topicPath" in config:
            yield config["topicPath"], False


@pytest.mark.parametrize(("path", "plotted"), list(foxglove_paths()))
def test_foxglove_paths_lead_to_fields(path, plotted):
    topic = topic_of(path)
    rest = path.removeprefix(f"/{topic.name}").removeprefix(".")
    kind = leaf(topic.type, rest.split("."))
    assert not plotted or NUMBERS.match(kind), kind


def test_foxglove_panels_are_laid_out_and_their_topics_exist():
    layout = foxglove()
    panels = layout["configById"]

    def leaves(node) -> Iterator[str]:
        if isinstance(node, str):
            yield node
        else:
            assert node["direction"] in ("row", "column")
            yield from leaves(node["first"])
            yield from leaves(node["second"])

    assert sorted(leaves(layout["layout"])) == sorted(panels)
    kinds = {"3D", "Plot", "StateTransitions", "RawMessages", "DiagnosticSummary"}
    assert {panel.partition("!")[0] for panel in panels} == kinds
    robot = panels["3D!robot"]
    drawn = {name: TOPICS[name].type for name in robot["topics"]}
    assert drawn == {
        "/markers": MarkerArray,
        "/head/planned_path": Path,
        "/head/odometry": Odometry,
        "/robot_description": String,
    }
    assert robot["topics"]["/markers"]["visible"] is True
    assert robot["followTf"] == "world"
    models = [layer for layer in robot["layers"].values() if layer["layerId"] == "foxglove.Urdf"]
    assert [TOPICS[model["topic"]].type for model in models] == [String]
    summary = panels["DiagnosticSummary!servos"]
    assert TOPICS[summary["topicToRender"]].type is DiagnosticArray


def plotjuggler() -> ElementTree.Element:
    return ElementTree.parse(CONFIG / "layouts" / "plotjuggler.xml").getroot()


@pytest.mark.parametrize("curve", [c.attrib["name"] for c in plotjuggler().iter("curve")])
def test_plotjuggler_curves_are_numbers_that_arrive(curve):
    topic = topic_of(curve)
    parts = curve.removeprefix(f"/{topic.name}/").split("/")
    if topic.type is JointState:
        # PlotJuggler names these by joint.
        joint, field = parts
        assert joint in PAPER.joint_names
        parts = [f"{field}[0]"]
    assert NUMBERS.match(leaf(topic.type, parts))


def test_plotjuggler_subscribes_to_what_it_draws():
    root = plotjuggler()
    needed = {f"/{topic_of(c.attrib['name']).name}" for c in root.iter("curve")}
    assert needed == {"/controller_state", "/joint_states", "/bus_state"}
    chosen = [set(e.attrib["value"].split(";")) for e in root.iter("selected_topics")]
    assert chosen == [needed, needed]
    assert root.find("previouslyLoaded_Streamer").attrib["name"] == "ROS2 Topic Subscriber"
    for splitter in root.iter("DockSplitter"):
        count = int(splitter.attrib["count"])
        assert count == len(splitter) == len(splitter.attrib["sizes"].split(";"))


def rviz() -> dict[str, Any]:
    text = (CONFIG / "snake.rviz").read_text(encoding="utf-8")
    return yaml.safe_load(text)["Visualization Manager"]


def test_rviz_displays_are_of_the_topics_types_and_qos():
    manager = rviz()
    assert manager["Global Options"]["Fixed Frame"] == "world"
    shown = {}
    for display in manager["Displays"]:
        assert display["Enabled"] is True
        chosen = display.get("Topic") or display.get("Description Topic")
        if chosen is None:
            continue
        topic = TOPICS[chosen["Value"]]
        shown[display["Class"].rpartition("/")[2]] = topic.type
        latched = topic.qos.durability is DurabilityPolicy.TRANSIENT_LOCAL
        assert chosen["Durability Policy"] == ("Transient Local" if latched else "Volatile")
        reliable = topic.qos.reliability is ReliabilityPolicy.RELIABLE
        assert chosen["Reliability Policy"] == ("Reliable" if reliable else "Best Effort")
    assert shown == {
        "RobotModel": String,
        "MarkerArray": MarkerArray,
        "Path": Path,
        "Odometry": Odometry,
    }


def test_rviz_knows_the_namespaces_of_the_markers():
    markers = next(d for d in rviz()["Displays"] if d["Class"].endswith("/MarkerArray"))
    painter = vars(RobotMarkers(PAPER, "world")).values()
    lists = [value if isinstance(value, list) else [value] for value in painter]
    drawn = {marker.ns for value in lists for marker in value if hasattr(marker, "ns")}
    assert set(markers["Namespaces"]) == drawn
    # What the model and the display of the path draw.
    off = [ns for ns, on in markers["Namespaces"].items() if not on]
    assert off == ["links", "planned_path", "wheels"]


def test_layouts_for_a_namespace_name_its_topics_and_frames(tmp_path, capsys):
    assert layouts.main(["--namespace", "/robot_1", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out.split()
    assert [FilePath(path).name for path in printed] == [
        "robot_1_snake.rviz",
        "robot_1_foxglove.json",
        "robot_1_plotjuggler.xml",
    ]
    for path, name in zip(printed, layouts.LAYOUTS, strict=True):
        before = (CONFIG / name).read_text(encoding="utf-8")
        after = FilePath(path).read_text(encoding="utf-8")
        of_robots = [topic for topic in TOPICS if topic != "/diagnostics"]
        pattern = rf"""(?<=[" ;])({"|".join(map(re.escape, of_robots))})(?![\w])"""
        named = re.findall(pattern, before)
        assert named
        assert re.findall(pattern, after) == []
        moved = re.findall(pattern.replace('(?<=[" ;])', "(?<=/robot_1)"), after)
        assert moved == named
        # Nothing else has changed but the frames.
        back = after.replace("/robot_1/", "/")
        for prefix in ('TF Prefix: "{}"', '"framePrefix": "{}"'):
            for robot in ("robot_1", "robot_1/"):
                back = back.replace(prefix.format(robot), prefix.format(""))
        assert back == before
    rviz_text = (tmp_path / "robot_1_snake.rviz").read_text()
    assert 'TF Prefix: "robot_1"' in rviz_text
    assert '"framePrefix": "robot_1/"' in (tmp_path / "robot_1_foxglove.json").read_text()


def test_layouts_without_a_namespace_are_the_shipped_ones(tmp_path):
    assert layouts.main(["--out", str(tmp_path)]) == 0
    for name in layouts.LAYOUTS:
        assert (tmp_path / FilePath(name).name).read_text() == (CONFIG / name).read_text()


def test_a_place_that_cannot_be_written_is_named(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert layouts.main(["--out", str(tmp_path / "file")]) == 1
    assert str(tmp_path / "file") in capsys.readouterr().err
