"""Postures by name: the only group whose names are free."""

from __future__ import annotations

import math

import pytest

from snake_control.config import RobotConfig, from_parameters, known_parameters, load
from snake_control.config.postures import postures_from
from snake_control.errors import ConfigError
from support.robots import CONFIG

PAPER = CONFIG / "paper_robot.yaml"


def test_flat_and_start_are_there_for_every_robot_in_config():
    for file in ("paper_robot.yaml", "planar_snake.yaml"):
        config = load(CONFIG / file)
        start = config.robot.start_joint_angles_rad
        assert config.postures.angles("", "start") == start
        assert config.postures.angles("", "flat") == (0.0,) * len(start)


def test_the_papers_robot_has_more():
    config = load(PAPER)
    assert config.postures.names == ("flat", "start", "lying", "look_ahead")
    base = config.robot.start_joint_angles_rad[5:]
    assert config.postures.angles("", "lying") == (0.0,) * 5 + base
    # Up at the neck's foot, down again at the head: it looks ahead.
    assert config.postures.angles("", "look_ahead")[:5] == (-1.1, 0.0, 0.0, 0.0, 1.1)


def test_a_name_of_ones_own_in_any_section_and_the_last_one_wins(tmp_path):
    own = tmp_path / "own.yaml"
    own.write_text(
        "/**: {ros__parameters: {postures: {My_2nd: [0.25], lying: [0.5]}}}\n"
        "/**/scp_controller: {ros__parameters: {postures.up: 1}}\n"
    )
    postures = load(PAPER, own).postures
    assert postures.angles("", "My_2nd") == (0.25,) * 11
    assert postures.angles("", "lying") == (0.5,) * 11
    assert postures.angles("", "up") == (1.0,) * 11


def test_the_nodes_that_need_them_declare_them():
    given = {"postures.up": [0.5], "robot.links": 12}
    for node, known in (("scp_controller", True), ("bus_driver", True), ("pose_input", False)):
        assert ("postures.up" in known_parameters((node,), given)) is known
    assert from_parameters("scp_controller", given).postures.angles("", "up") == (0.5,) * 11
    with pytest.raises(ConfigError, match=r"postures\.up = \[0\.5\]: unknown parameter"):
        from_parameters("pose_input", {"postures.up": [0.5]})


def test_the_driver_lowers_to_a_posture_by_name(tmp_path):
    own = tmp_path / "own.yaml"
    own.write_text("/**/bus_driver: {ros__parameters: {lowering_posture: lying}}\n")
    config = load(PAPER, own)
    assert config.bus_driver.lowering_angles_rad == config.postures.angles("", "lying")


def test_a_robot_that_cannot_stretch_out_has_no_flat_posture():
    limits = (0.2, 2.0, *(-2.0, 2.0) * 10)
    robot = RobotConfig(joint_limits_rad=limits, start_joint_angles_rad=(0.3,))
    assert postures_from(robot, {}).names == ("start",)


def test_an_unknown_name_is_told_with_those_that_there_are():
    with pytest.raises(ConfigError, match=r"^posture = 'up': no such posture; there are: flat, s"):
        load(PAPER).postures.angles("posture", "up")


def test_no_angle_that_is_no_number():
    for value in (math.nan, math.inf):
        with pytest.raises(ConfigError, match=r"^postures\.up\[0\]"):
            postures_from(RobotConfig(), {"postures.up": [value]})
