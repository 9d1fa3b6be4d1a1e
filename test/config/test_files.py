"""The shipped files say what the paper says, and later files win."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from snake_control.config import ControllerConfig, RobotConfig, load
from snake_control.errors import ConfigError
from support.robots import CONFIG

PAPER = CONFIG / "paper_robot.yaml"


def test_paper_robot_is_the_default():
    config = load(PAPER)
    assert config.robot == RobotConfig()
    assert config.controller == ControllerConfig()
    assert config.bus_driver.port == "/dev/ttyUSB0"


def test_table_1():
    config = load(PAPER)
    assert config.robot.start_joint_angles_rad == pytest.approx(
        [-0.11, 0, 0, 0, 1.1, *(np.pi * np.array([-1 / 9, 1 / 6, 1 / 6, -1 / 9, -1 / 6, -1 / 10]))]
    )
    assert config.controller.K == (0.4, 0.25, 0.5, 0.1, 0.1, 0.1)
    generator = config.trajectory_generator
    assert generator.start_pose == pytest.approx([0, 0, 0.2, np.pi / 8, np.pi / 8, 0])
    assert generator.velocity == (0.01, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_scps_of_the_paper():
    robot = load(PAPER).robot
    assert robot.head_scp_joints == (3,)
    assert robot.base_scp_joints == (6, 8, 10)
    assert robot.wheeled_links == (6, 8, 10, 12)
    assert robot.joint_names[0] == "joint_1"
    assert robot.joint_names[-1] == "joint_11"


def test_planar_snake():
    config = load(CONFIG / "planar_snake.yaml")
    assert config.robot.planar
    assert config.robot.controlled == (0, 1, 5)
    assert config.robot.scp_joints == config.robot.base_scp_joints == (3, 6)
    assert config.robot.wheeled_links == (2, 3, 5, 6, 8, 9, 10)
    # Case 1 given after it stops the SCPs: its weight a_b stands above a_prime.
    assert load(CONFIG / "planar_snake.yaml", CONFIG / "case_1.yaml").controller.a_b == 0.0


@pytest.mark.parametrize("case", [1, 2, 3])
def test_case_files(case):
    controller = load(PAPER, CONFIG / f"case_{case}.yaml").controller
    assert controller.case == case
    weights = (controller.a_h, controller.a_b, controller.a_prime, controller.b_prime)
    assert (
        weights
        == {
            1: (0.0, 0.0, 0.0, 0.0),
            2: (1e5, 1.0, 1e-11, 0.0),
            3: (1e5, 1.0, 1e-11, 3.0),
        }[case]
    )
    assert controller.head_sub_tasks == ("manipulability",)
    assert controller.head_weights == (1.0,)
    assert controller.base_sub_tasks == ("singularity", "fall")
    assert controller.base_weights == weights[2:]
    assert controller.scp_law == "gradient"


def test_explicit_weight_wins_over_the_case(tmp_path):
    path = tmp_path / "weights.yaml"
    path.write_text("/**: {ros__parameters: {controller: {a_h: 5.0}}}\n")
    controller = load(PAPER, CONFIG / "case_1.yaml", path).controller
    assert controller.a_h == 5.0
    assert controller.a_b == 0.0


def test_mock_file_sets_one_port_for_both_ends():
    config = load(PAPER, CONFIG / "mock.yaml")
    assert config.bus_driver.port == config.mock_bus.port != "/dev/ttyUSB0"


def test_snapshots_are_frozen():
    config = load(PAPER)
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.robot.links = 5  # type: ignore[misc]


def test_error_carries_its_data():
    with pytest.raises(ConfigError) as caught:
        RobotConfig(head_links=3)
    assert (caught.value.field, caught.value.value) == ("robot.head_links", 3)
    assert isinstance(caught.value, ValueError)
