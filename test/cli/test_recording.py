"""What is said and drawn of a recording is what is in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mcap_ros2", reason="needs pip install mcap-ros2-support")

from rclpy.serialization import serialize_message
from snake_interfaces.msg import ControllerState

from snake_control.cli.recording import main
from snake_control.experiment.recording import read_recording
from snake_control.model.floor import head_pose_on_floor
from snake_control.nodes import topics
from snake_control.nodes.controller_messages import Step
from snake_control.nodes.markers import RobotMarkers
from snake_control.nodes.mcap_file import McapFile
from snake_control.nodes.message_definitions import definition, type_name
from support.robots import PAPER

STEPS = 101
RATE_HZ = 50


def record(path: Path, lost: dict[str, str] | None) -> None:
    """Write two seconds of a robot that stands still; ``lost`` is ``None`` if it breaks off."""
    file = McapFile(path)
    channels = {}
    for topic in (topics.CONTROLLER_STATE, topics.MARKERS):
        name = type_name(topic.type)
        channels[topic.name] = file.add_topic(f"/{topic.name}", name, definition(name), {})
    phi = np.array(PAPER.start_joint_angles_rad)
    q = np.concatenate((head_pose_on_floor(PAPER, phi, np.zeros(3)), phi))
    painter = RobotMarkers(PAPER, "world")
    for i in range(STEPS):
        stamp = 10**18 + i * 10**9 // RATE_HZ
        state = ControllerState(status=ControllerState.STATUS_TRACKING, v_b1=1e8 + i, d_min=0.03)
        state.error[0] = 1e-3 * i
        data = serialize_message(state)
        file.write(channels["controller_state"], data, stamp + 500, stamp, i)
        if i % 5 == 0:
            data = serialize_message(painter.draw(stamp, q, q[:6], Step.at(stamp, PAPER)))
            file.write(channels["markers"], data, stamp + 500, stamp, i)
    if lost is None:
        file.flush()
    else:
        file.finish(lost)


def test_overview_and_picture(tmp_path, capsys):
    path, picture = tmp_path / "run.mcap", tmp_path / "picture.png"
    record(path, {"lost": "0"})
    assert main([str(path), "--draw", str(picture), "--at", "1"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("2.0 s, 122 messages\n")
    assert "/controller_state                    101   50.0 Hz  snake_interfaces/msg/Con" in printed
    assert "none lost" in printed
    assert picture.read_bytes().startswith(b"\x89PNG")
    recording = read_recording(path, ["/controller_state"])
    assert [m.error[0] for m in recording.topics["/controller_state"].messages] == pytest.approx(
        [1e-3 * i for i in range(STEPS)]
    )
    assert recording.topics["/markers"].messages == []


def test_losses_and_a_broken_end_are_told(tmp_path, capsys):
    record(tmp_path / "lost.mcap", {"lost": "3", "lost /markers": "3"})
    assert main([str(tmp_path / "lost.mcap")]) == 0
    assert "lost: 3 of /markers" in capsys.readouterr().out
    whole = tmp_path / "whole.mcap"
    record(whole, None)
    content = whole.read_bytes()
    broken = tmp_path / "broken.mcap"
    # In the index behind the last chunk, in a chunk, in the file's first record.
    for size in (len(content) - 100, len(content) // 2, 12):
        broken.write_bytes(content[:size])
        assert main([str(broken)]) == 0
        assert "it breaks off" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "words"), [(b"no recording at all", "is no MCAP file"), (None, "No such file")]
)
def test_what_is_no_recording_is_refused(tmp_path, capsys, content, words):
    path = tmp_path / "x.mcap"
    if content is not None:
        path.write_bytes(content)
    assert main([str(path)]) == 1
    assert words in capsys.readouterr().err
    assert not (tmp_path / "x.png").exists()


def test_without_markers_nothing_is_drawn(tmp_path, capsys):
    path = tmp_path / "empty.mcap"
    McapFile(path).finish({"lost": "0"})
    assert main([str(path), "--draw", str(tmp_path / "x.png")]) == 1
    assert "no /markers in the recording" in capsys.readouterr().err
