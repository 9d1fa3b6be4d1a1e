"""How a process ends whose middleware does not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from snake_control.cli.ros_domain import own_domain
from snake_control.experiment.cases import config_directory

# Fast DDS hears others in threads of its own, for as long as a node is in the graph. PyDLL keeps
# the interpreter's lock, as rclpy does while it destroys a node.
_PROGRAM = """
import ctypes
import sys
from pathlib import Path

import rclpy
from rclpy.node import Node

from snake_control.nodes.managed import ManagedNode
from snake_control.nodes.process import run


def hearing():
    threads = [path.read_text() for path in Path("/proc/self/task").glob("*/comm")]
    return sum(name.startswith("dds.udp") for name in threads)


class Leaving(ManagedNode if "managed" in sys.argv else Node):
    def __init__(self, **overrides):
        super().__init__("pose_input", **overrides)
        # As a signal that comes at once.
        self.create_timer(0.01, rclpy.try_shutdown)
        self.heard = hearing()

    def close(self):
        print("closed, hearing" if self.heard else "closed", flush=True)

    def destroy_node(self):
        if "stuck" in sys.argv:
            ctypes.PyDLL(None).sleep(600)
        super().destroy_node()


arguments = ["test", "--ros-args", "--params-file", sys.argv[1]]
code = run(Leaving, "pose_input", arguments)
print("hearing" if hearing() else "gone", flush=True)
if "teardown" in sys.argv:
    ctypes.PyDLL(None).sleep(600)
sys.exit(code)
"""


def leave(tmp_path: Path, *how: str, **more: Any) -> subprocess.CompletedProcess[str]:
    program = tmp_path / "leaving.py"
    program.write_text(_PROGRAM)
    command = [sys.executable, str(program), str(config_directory() / "paper_robot.yaml"), *how]
    with own_domain():
        return subprocess.run(command, timeout=60, stdout=subprocess.PIPE, text=True, **more)


@pytest.mark.parametrize("kind", ["plain", "managed"])
def test_a_node_has_left_the_graph_before_its_process_ends(tmp_path: Path, kind: str) -> None:
    ended = leave(tmp_path, kind, stderr=subprocess.PIPE)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.splitlines() == ["closed, hearing", "gone"]


@pytest.mark.parametrize("where", ["stuck", "teardown"])
def test_a_process_that_cannot_leave_the_graph_ends_nevertheless(
    tmp_path: Path, where: str
) -> None:
    ended = leave(tmp_path, where, stderr=subprocess.PIPE)
    assert ended.returncode == 1
    assert "closed" in ended.stdout
    assert ("destroy_node" if where == "stuck" else "<module>") in ended.stderr, "where it hung"


def test_nobody_needs_to_hear_where_it_hung(tmp_path: Path) -> None:
    ended = leave(tmp_path, "stuck", preexec_fn=lambda: os.close(2))
    assert ended.returncode == 1
    assert "closed" in ended.stdout
