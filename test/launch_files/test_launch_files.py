"""The launch files start the nodes that exist, with files that exist."""

import ast
import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOUR = {"bus_driver", "pose_input", "scp_controller", "trajectory_generator"}
LAUNCHED = {"mock.launch.py": FOUR | {"mock_bus"}, "robot.launch.py": FOUR}
ARGUMENTS = {
    "mock.launch.py": {"case", "params_file", "namespace"},
    "robot.launch.py": {"port", "params_file", "namespace"},
}


def _tree(name: str) -> ast.Module:
    return ast.parse((ROOT / "launch" / name).read_text(encoding="utf-8"), name)


def test_every_launch_file_is_checked_here():
    assert {path.name for path in (ROOT / "launch").glob("*.py")} == set(LAUNCHED)


@pytest.mark.parametrize("name", sorted(LAUNCHED))
def test_it_names_the_nodes(name):
    values = [
        ast.literal_eval(node.value)
        for node in _tree(name).body
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and node.targets[0].id == "NODES"
    ]
    assert len(values) == 1
    assert set(values[0]) == LAUNCHED[name]


@pytest.mark.parametrize("name", sorted(LAUNCHED))
def test_its_configuration_files_exist(name):
    words = [
        node.value
        for node in ast.walk(_tree(name))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]
    files = [word for word in words if re.fullmatch(r"\w+\.yaml", word)]
    assert files
    assert [file for file in files if not (ROOT / "config" / file).is_file()] == []


@pytest.mark.parametrize("name", sorted(LAUNCHED))
def test_the_description_declares_its_arguments(name):
    # Not "launch": this repository's folder of that name passes for a package.
    pytest.importorskip("launch.actions", reason="needs an installed ROS 2: not on PyPI")
    pytest.importorskip("launch_ros.actions", reason="needs an installed ROS 2: not on PyPI")
    spec = importlib.util.spec_from_file_location(name.split(".")[0], ROOT / "launch" / name)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    description = module.generate_launch_description()
    assert {a.name for a in description.get_launch_arguments()} == ARGUMENTS[name]
