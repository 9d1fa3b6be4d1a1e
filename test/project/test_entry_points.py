"""The commands that setup.py installs exist."""

import importlib
import os
import subprocess
import sys
from distutils.core import run_setup
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NODES = {
    "bus_driver",
    "pose_input",
    "scp_controller",
    "trajectory_generator",
    "keyboard_teleop",
    "description",
    "record",
    "head_trajectory",
    "mock_bus",
}
COMMANDS = {"ax12", "demo", "evaluate", "experiment", "layouts", "recording", "scp_study"}


def _console_scripts() -> dict[str, str]:
    before = Path.cwd()
    os.chdir(ROOT)
    try:
        distribution = run_setup("setup.py", stop_after="init")
    finally:
        os.chdir(before)
    lines = distribution.entry_points["console_scripts"]
    return dict(tuple(part.strip() for part in line.split("=")) for line in lines)


def test_the_fixed_names_are_there():
    assert set(_console_scripts()) == NODES | COMMANDS


@pytest.mark.parametrize(("name", "target"), sorted(_console_scripts().items()))
def test_a_command_leads_to_a_function(name, target):
    module, function = target.split(":")
    assert callable(getattr(importlib.import_module(module), function)), name


def test_the_demo_explains_itself():
    done = subprocess.run(
        [sys.executable, "-m", "snake_control.cli.demo", "--help"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for flag in ("--case", "--duration", "--seed", "--out"):
        assert flag in done.stdout
