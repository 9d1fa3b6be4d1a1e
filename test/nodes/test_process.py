"""How a process ends whose middleware does not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from snake_control.cli.ros_domain import own_domain
from snake_control.experiment.cases import config_directory

# PyDLL keeps the interpreter's lock, as rclpy does while it destroys a node.
_PROGRAM = """
import ctypes
import sys

import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter

from snake_control.nodes.process import run


class Leaving(Node):
    def __init__(self, **overrides):
        super().__init__("pose_input", **overrides)
        # As a signal that comes at once.
        self.create_timer(0.01, rclpy.try_shutdown)

    def close(self):
        print("closed", flush=True)

    def destroy_node(self):
        if "stuck" in sys.argv:
            ctypes.PyDLL(None).sleep(600)
        super().destroy_node()


arguments = ["test", "--ros-args", "--params-file", sys.argv[1]]
sys.exit(run(Leaving, "pose_input", arguments))
"""


@pytest.mark.parametrize("how", ["well", "stuck"])
def test_a_node_that_cannot_leave_the_graph_ends_nevertheless(tmp_path: Path, how: str) -> None:
    program = tmp_path / "leaving.py"
    program.write_text(_PROGRAM)
    files = str(config_directory() / "paper_robot.yaml")
    with own_domain():
        ended = subprocess.run(
            [sys.executable, str(program), files, how], capture_output=True, text=True, timeout=60
        )
    assert "closed" in ended.stdout
    if how == "well":
        assert ended.returncode == 0, ended.stderr
    else:
        assert ended.returncode == 1
        assert "destroy_node" in ended.stderr, "it says where it was"
