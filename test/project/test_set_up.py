"""Set-up explains itself, and says in one line what is missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BASH = shutil.which("bash") or "/bin/bash"


def _run(*command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command,
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.fixture
def tools(tmp_path):
    """Return a function that makes a PATH with the named programs and no others."""

    def make(*names: str) -> str:
        for name in names:
            (tmp_path / name).symlink_to(shutil.which(name) or name)
        return str(tmp_path)

    return make


@pytest.mark.parametrize("arguments", [[], ["help"]])
def test_help_names_every_target(arguments):
    make = shutil.which("make")
    if make is None:
        pytest.skip("make is not installed")
    done = _run(make, "-C", str(ROOT), *arguments)
    assert done.returncode == 0, done.stderr
    for target in ("demo", "test", "lint", "bench", "clean"):
        assert f"make {target}" in done.stdout


@pytest.mark.parametrize(
    ("absent", "what", "package"),
    [
        ("cc", "a C compiler", "build-essential"),
        ("c++", "a C++ compiler", "build-essential"),
        ("cmake", "cmake", "cmake"),
    ],
)
def test_a_missing_tool_is_named_in_one_line(tools, absent, what, package):
    present = {"cc", "c++", "cmake"} - {absent}
    path = tools("awk", "paste", *present)
    done = _run(BASH, "scripts/check_tools.sh", PATH=path, CC="", CXX="")
    assert done.returncode != 0
    assert done.stderr == f"Missing: {what}; install: sudo apt install {package}\n"


def test_tools_that_are_there_are_not_complained_about(tools):
    done = _run(BASH, "scripts/check_tools.sh", PATH=tools("cc", "c++", "cmake"), CC="", CXX="")
    assert (done.returncode, done.stderr) == (0, "")


def test_a_python_that_does_not_run_is_named_in_one_line():
    done = _run(BASH, "scripts/find_python.sh", PYTHON="/nonexistent/python")
    assert done.returncode != 0
    assert done.stderr.count("\n") == 1
    assert "PYTHON=/nonexistent/python" in done.stderr
    assert "install" in done.stderr


def test_a_python_of_the_right_version_is_found():
    done = _run(BASH, "scripts/find_python.sh", PYTHON=sys.executable)
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()).exists()


def test_another_ros_distribution_is_refused():
    done = _run(BASH, "scripts/world.sh", ROS_DISTRO="humble")
    assert done.returncode != 0
    assert "humble" in done.stderr


@pytest.mark.parametrize(("distribution", "world"), [("", "wheels"), ("jazzy", "jazzy")])
def test_the_source_of_ros_is_told(distribution, world):
    done = _run(BASH, "scripts/world.sh", ROS_DISTRO=distribution)
    assert done.stdout.strip() == world


def test_the_output_of_a_failing_step_is_shown(tmp_path):
    log = tmp_path / "step.log"
    done = _run(BASH, "scripts/quietly.sh", str(log), "a step", BASH, "-c", "echo why; exit 7")
    assert done.returncode == 7
    assert "why" in done.stderr
    assert str(log) in done.stderr


def test_the_wheels_point_to_headers_that_exist():
    world = Path(sys.prefix, "world")
    if not (world.is_file() and world.read_text(encoding="utf-8").startswith("wheels ")):
        pytest.skip("not an environment with the ROS wheels that set-up made")
    files = list(Path(sys.prefix, "share").glob("**/cmake/*.cmake"))
    assert files
    assert [p for p in files if "/opt/python/cp3" in p.read_text(encoding="utf-8")] == []
