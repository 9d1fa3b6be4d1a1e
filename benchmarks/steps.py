"""One control step and one step of the kinematic plant."""

from __future__ import annotations

import numpy as np

from benchmarks.common import Call, start_posture
from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ScpController
from snake_control.plant.kinematic import KinematicPlant

W_D = np.array([0.0, 0.0, 0.2, np.pi / 8, np.pi / 8, 0.0])
W_D_DOT = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])


def control_step(robot: RobotConfig) -> Call:
    """Return a call of the whole velocity control step of Case 3.

    All of (22), (25), (27), with the gradients of V_h, V_b1 and d_min.
    """
    controller = ScpController(robot, ControllerConfig(case=3))
    q = start_posture(robot)
    reference = Reference(W_D, W_D_DOT)
    return lambda: controller.step(q, None, reference, 0.0)


def plant_step(robot: RobotConfig) -> Call:
    """Return a call of one step of the kinematic plant, joints at rest."""
    plant = KinematicPlant(robot)
    plant.reset(robot.start_joint_angles_rad)
    still = np.zeros(robot.joints)
    return lambda: plant.step(still, 1e-3)
