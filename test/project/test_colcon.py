"""colcon finds both packages, from the root and without arguments."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def _colcon() -> str:
    beside = Path(sys.executable).with_name("colcon")
    found = str(beside) if beside.exists() else shutil.which("colcon")
    if not found:
        pytest.skip("colcon is not installed")
    return found


def test_both_packages_are_found_and_no_other():
    done = subprocess.run(
        [_colcon(), "list", "--base-paths", ".", "snake_interfaces"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    found = sorted(line.split("\t") for line in done.stdout.splitlines())
    assert found == [
        ["snake_control", ".", "(ros.ament_python)"],
        ["snake_interfaces", "snake_interfaces", "(ros.ament_cmake)"],
    ]
