"""Robots in namespaces have frames and ports of their own."""

from snake_control.config import from_parameters
from snake_control.config.namespaces import robot_parameters


def test_the_only_robot_needs_nothing():
    assert robot_parameters("") == robot_parameters("/") == {}


def test_parameters_are_those_of_the_nodes_and_differ_between_robots():
    one, two = robot_parameters("/team/one"), robot_parameters("two")
    assert set(one) == set(two)
    configs = {}
    for node, values in one.items():
        configs[node] = getattr(from_parameters(node, values), node)
        assert all(two[node][name] != value for name, value in values.items())
    assert configs["description"].frame_prefix == "team/one/"
    assert configs["pose_input"].child_frame_id == "team/one/link_1"
    assert configs["mock_bus"].port == configs["bus_driver"].port
    assert configs["mock_bus"].port == "/tmp/snake_control_mock_bus_team_one"
