"""Where PyYAML and rcl read the same file differently, and what rcl would abort on."""

from __future__ import annotations

from pathlib import Path

import pytest

from snake_control.config import load, matches
from snake_control.errors import ConfigError, ConfigFileError


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "parameters.yaml"
    path.write_text(text)
    return path


def shared(tmp_path: Path, lines: str) -> Path:
    indented = "\n".join("    " + line for line in lines.splitlines())
    return write(tmp_path, f"/**:\n  ros__parameters:\n{indented}\n")


@pytest.mark.parametrize("text", ["1e-11", "1.0e-11", "1E-11", "+1.e-11", "10e-12"])
def test_exponents_are_numbers(tmp_path, text):
    config = load(shared(tmp_path, f"controller: {{a_prime: {text}}}"))
    assert config.controller.a_prime == pytest.approx(1e-11)


def test_positive_exponent_without_sign(tmp_path):
    assert load(shared(tmp_path, "controller: {a_h: 1.0e5}")).controller.a_h == 1e5


def test_mixed_list_is_refused_because_rcl_aborts(tmp_path):
    with pytest.raises(ConfigError, match=r"controller.K.*0 as 0\.0"):
        load(shared(tmp_path, "controller: {K: [0.4, 0.25, 0, 0.1, 0.1, 0.1]}"))


def test_integers_for_decimals_are_accepted(tmp_path):
    config = load(shared(tmp_path, "controller: {b_prime: 3, K: [1, 1, 1, 1, 1, 1]}"))
    assert config.controller.b_prime == 3.0
    assert config.controller.K == (1.0,) * 6


def test_empty_list_is_refused_because_ros_ignores_it(tmp_path):
    with pytest.raises(ConfigError, match=r"robot\.wheelless_links"):
        load(shared(tmp_path, "robot: {wheelless_links: []}"))


def test_list_of_maps_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"robot\.joint_axes"):
        load(shared(tmp_path, "robot: {joint_axes: [{a: 1}]}"))


def test_one_number_stands_for_all(tmp_path):
    config = load(shared(tmp_path, "robot: {link_mass_kg: 0.2, joint_limits_rad: 2.3}"))
    assert config.robot.link_mass_kg == (0.2,) * 12
    assert config.robot.joint_range(11) == (-2.3, 2.3)


def test_zero_stands_for_none(tmp_path):
    lines = "robot: {wheelless_links: [0]}"
    assert load(shared(tmp_path, lines)).robot.wheelless_links == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("/**: [", "not valid YAML"),
        ("- 1\n- 2\n", "no map"),
        ("robot: 5\n", "ros__parameters"),
        ("/**: {ros__parameters: 5}\n", "no map"),
    ],
)
def test_files_that_are_no_parameter_files(tmp_path, text, message):
    path = write(tmp_path, text)
    with pytest.raises(ConfigFileError, match=message) as caught:
        load(path)
    assert str(path) in str(caught.value)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigFileError, match=r"nowhere\.yaml: cannot be read"):
        load(tmp_path / "nowhere.yaml")


def test_empty_file_changes_nothing(tmp_path):
    assert load(write(tmp_path, "")) == load()


def test_misspelt_node_is_refused_and_foreign_nodes_are_ignored(tmp_path):
    with pytest.raises(ConfigError, match="bus_driver"):
        load(write(tmp_path, "bus_drver: {ros__parameters: {port: /dev/null}}"))
    with pytest.raises(ConfigError, match="bus_driver"):
        load(write(tmp_path, "/**/bus_dirver: {ros__parameters: {port: /dev/null}}"))
    for foreign in ("twist_mux", "/**/mocap_bus", "/bus_driver_left"):
        assert load(write(tmp_path, f"{foreign}: {{ros__parameters: {{a: 1}}}}")) == load()


def test_two_robots_in_one_file(tmp_path):
    path = write(
        tmp_path,
        "/one/**: {ros__parameters: {robot: {half_length_m: 0.05}}}\n"
        "/two/**: {ros__parameters: {robot: {half_length_m: 0.06}}}\n"
        "/two/driver: {ros__parameters: {port: /dev/two}}\n",
    )
    assert load(path).robot.half_length_m == 0.034
    assert load(path, namespace="/one").robot.half_length_m == 0.05
    two = load(path, namespace="/two", names={"bus_driver": "driver"})
    assert two.robot.half_length_m == 0.06
    assert two.bus_driver.port == "/dev/two"


@pytest.mark.parametrize(
    ("pattern", "node", "expected"),
    [
        ("/**", "/bus_driver", True),
        ("/**", "/a/b/bus_driver", True),
        ("/**/bus_driver", "/bus_driver", True),
        ("/**/bus_driver", "/a/b/bus_driver", True),
        ("/bus_driver", "/bus_driver", True),
        ("/bus_driver", "/a/bus_driver", False),
        ("/*/bus_driver", "/a/bus_driver", True),
        ("/*/bus_driver", "/bus_driver", False),
        ("/**/bus_driver", "/mock_bus", False),
    ],
)
def test_section_patterns(pattern, node, expected):
    assert matches(pattern, node) is expected
