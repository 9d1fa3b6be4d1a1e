"""What is given last on a command line wins, whatever section it stands in."""

from __future__ import annotations

import pytest

from snake_control.config import parameter_files, parameters_of_node
from snake_control.errors import ConfigError, ConfigFileError


@pytest.fixture
def files(tmp_path):
    first = tmp_path / "first.yaml"
    first.write_text(
        "/**: {ros__parameters: {a: 1, b: 1}}\n"
        "/**/node: {ros__parameters: {port: first, c: 1}}\n"
        "/other: {ros__parameters: {port: other}}\n"
    )
    second = tmp_path / "second.yaml"
    second.write_text("/**: {ros__parameters: {port: second, b: 2}}\n")
    return ["node", "--ros-args", "--params-file", str(first), "--params-file", str(second)]


def test_later_file_wins_over_the_section_of_the_node(files):
    assert parameters_of_node(files, "node") == {"a": 1, "b": 2, "c": 1, "port": "second"}
    assert parameter_files(files) == [files[3], files[5]]


def test_rule_wins_when_it_comes_last(files):
    rules = ["-p", "port:=/tmp/x", "--param", "node:c:=[1.5, 2.0]", "-p", "other:a:=7"]
    found = parameters_of_node(files + rules, "node")
    assert (found["port"], found["c"], found["a"]) == ("/tmp/x", [1.5, 2.0], 1)
    first = parameters_of_node(["node", "--ros-args", *rules, *files[2:]], "node")
    assert first["port"] == "second"


@pytest.mark.parametrize("text", ["1e-11", "1.0e-11"])
def test_rule_reads_numbers_as_rcl_does(text):
    assert parameters_of_node(["n", "--ros-args", "-p", f"x:={text}"], "n") == {"x": 1e-11}


def test_renamed_node_in_a_namespace(files):
    renamed = [*files, "-r", "__node:=other", "-r", "__ns:=/robot"]
    assert parameters_of_node(renamed, "node") == {"a": 1, "b": 2, "port": "second"}
    in_root = [*files[:4], "--remap", "__node:=other"]
    assert parameters_of_node(in_root, "node")["port"] == "other"


def test_outside_of_ros_arguments_nothing_counts(files):
    assert parameters_of_node(["n", "-p", "x:=1"], "n") == {}
    assert parameters_of_node(["n", "--ros-args", "--", "-p", "x:=1"], "n") == {}


def test_bad_rules_are_named():
    with pytest.raises(ConfigFileError, match="name:=value"):
        parameters_of_node(["n", "--ros-args", "-p", "port"], "n")
    with pytest.raises(ConfigError, match=r"K = .*0 as 0\.0"):
        parameters_of_node(["n", "--ros-args", "-p", "K:=[0.1, 0]"], "n")
