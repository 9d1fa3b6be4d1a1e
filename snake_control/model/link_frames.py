"""Where the frames ``link_1`` .. ``link_n`` stand: at each link's front end, x to the head."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from snake_control.config import RobotConfig
from snake_control.model.rotation import rotation_from_rpy

Array = NDArray[np.float64]

_AXES = {"pitch": (0.0, 1.0, 0.0), "yaw": (0.0, 0.0, 1.0)}


def joint_quaternions(robot: RobotConfig, phi: ArrayLike) -> Array:
    """Return the rotation from link i to link i+1 for every joint, [x, y, z, w], (n-1, 4).

    Args:
        robot: the robot.
        phi: joint angles, (n-1,) [rad].
    """
    half = np.asarray(phi, dtype=float) / 2.0
    axes = np.array([_AXES[axis] for axis in robot.joint_axes])
    return np.column_stack((np.sin(half)[:, np.newaxis] * axes, np.cos(half)))


def link_frames(robot: RobotConfig, q: ArrayLike) -> tuple[Array, Array]:
    """Return origins and orientations of all link frames in the world.

    Args:
        robot: the robot.
        q: [w, phi], (n+5,) [m, rad].

    Returns:
        Origins, (n, 3) [m], and quaternions [x, y, z, w], (n, 4).
    """
    q = np.asarray(q, dtype=float)
    rotation, origin = rotation_from_rpy(q[3:6]), q[:3]
    turns = Rotation.from_quat(joint_quaternions(robot, q[6:])).as_matrix()
    rotations, origins = [rotation], [origin]
    for turn in turns:
        origin = origin - 2.0 * robot.half_length_m * rotation[:, 0]
        rotation = rotation @ turn
        rotations.append(rotation)
        origins.append(origin)
    quaternions: Array = Rotation.from_matrix(np.array(rotations)).as_quat()
    return np.array(origins), quaternions
