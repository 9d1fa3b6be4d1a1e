"""What gravity asks of the joints of a robot whose base stands level on the floor."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.model.floor import gravity_efforts, head_pose_on_floor
from snake_control.model.geometry import geometry


def holding_torques(robot: RobotConfig, phi: ArrayLike) -> NDArray[np.float64]:
    """Return the torque that each joint applies to hold the robot still.

    Args:
        robot: the robot.
        phi: joint angles, (n-1,) [rad].

    Returns:
        (n-1,) [N m], positive in the joint's positive direction; 0 for the joints of the base.
    """
    angles = np.asarray(phi, dtype=float)
    w = head_pose_on_floor(robot, angles, np.zeros(3))
    return gravity_efforts(geometry(robot, np.concatenate((w, angles))))
