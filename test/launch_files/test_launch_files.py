"""The launch files start the nodes that exist, with files that exist."""

import ast
import importlib.util
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from support.graph import Graph

ROOT = Path(__file__).resolve().parents[2]
ROBOT = {"bus_driver", "pose_input", "scp_controller", "trajectory_generator", "description"}
LAUNCHED = {
    "mock.launch.py": ROBOT | {"mock_bus"},
    "robot.launch.py": ROBOT,
    "view.launch.py": {"rviz2"},
}
ARGUMENTS = {
    "mock.launch.py": {"case", "params_file", "namespace", "record"},
    "robot.launch.py": {"port", "params_file", "namespace", "record"},
    "view.launch.py": {"namespace"},
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
    files = [word for word in words if re.fullmatch(r"\w+\.(yaml|rviz)", word)]
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


def test_the_driver_waits_for_the_port_of_the_mock():
    # Only this function: the rest needs launch, which is not on PyPI.
    parts = [
        node
        for node in _tree("mock.launch.py").body
        if (isinstance(node, ast.FunctionDef) and node.name == "once_ready")
        or (isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "READY")
    ]
    future = ast.parse("from __future__ import annotations").body
    names: dict = {}
    exec(compile(ast.Module(future + parts, []), "mock.launch.py", "exec"), names)
    said = names["once_ready"]("the driver")

    def output(text):
        return said(SimpleNamespace(text=text.encode()))

    assert output("[WARN] something else\n") is None
    assert output("[INFO] [mock_bus]: 11 ser") is None
    assert output("vos at /tmp/port (/dev/pts/3)\n") == "the driver"
    assert output("11 servos at /tmp/port\n") is None


def test_the_mock_says_what_its_launch_file_waits_for(tmp_path):
    with Graph() as graph:
        mock = graph.start("mock_bus", params={"port": str(tmp_path / "port")})
        ready = next(
            node.value.value
            for node in _tree("mock.launch.py").body
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "READY"
        )
        graph.wait_for(lambda: ready in mock.output(), 30.0, "the ready text")
