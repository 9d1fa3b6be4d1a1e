import numpy as np
import pytest

from snake_control.config import load
from snake_control.model.statics import holding_torques
from snake_control.plant.kinematic import KinematicPlant
from support.graph import CONFIG


def test_static_load_is_that_of_the_plant_in_any_posture() -> None:
    robot = load(CONFIG / "paper_robot.yaml").robot
    rng = np.random.default_rng(1)
    for _ in range(20):
        phi = np.array(robot.start_joint_angles_rad) + rng.uniform(-0.4, 0.4, robot.joints)
        expected = KinematicPlant(robot).reset(phi).effort
        assert holding_torques(robot, phi) == pytest.approx(expected, abs=1e-12)


def test_the_neck_of_the_papers_robot_carries_more_than_a_fifth_of_stall() -> None:
    # By hand, with all links level: joint 5 carries five links of 0.1 kg, centres 1, 3, .. 9 half
    # lengths of 0.034 m in front of it.
    robot = load(CONFIG / "paper_robot.yaml").robot
    level = holding_torques(robot, np.zeros(robot.joints))
    moment = 9.80665 * 0.1 * 0.034 * (1 + 3 + 5 + 7 + 9)
    assert abs(level[4]) == pytest.approx(moment, rel=1e-12)
    assert level[5:] == pytest.approx(0.0)
