"""The head of a robot on the kinematic plant whose joints swing gently, as poses and angles."""

from __future__ import annotations

import numpy as np

from snake_control.config import RobotConfig
from snake_control.model.rotation import quaternion_from_rpy
from snake_control.plant.kinematic import KinematicPlant

STEP_S = 0.01


class MovingHead:
    """Moves on in steps of 10 ms.

    Attributes:
        t: time since the beginning [s].
    """

    def __init__(self, robot: RobotConfig, fastest_rad_s: float = 0.1) -> None:
        self._plant = KinematicPlant(robot, STEP_S)
        self._state = self._plant.reset(robot.start_joint_angles_rad)
        self._u = np.linspace(-fastest_rad_s, fastest_rad_s, robot.joints)
        self._steps = 0

    @property
    def t(self) -> float:
        return self._steps * STEP_S

    def step(self) -> None:
        """Move on."""
        self._state = self._plant.step(self._u * np.cos(2.0 * self.t), STEP_S)
        self._steps += 1

    @property
    def position(self) -> np.ndarray:
        """Of the tip, (3,) [m]."""
        return np.array(self._state.w[:3])

    @property
    def quaternion(self) -> np.ndarray:
        """Attitude of the head, [x, y, z, w]."""
        return quaternion_from_rpy(self._state.w[3:])

    @property
    def phi(self) -> np.ndarray:
        return np.array(self._state.phi)

    @property
    def phi_dot(self) -> np.ndarray:
        return np.array(self._state.phi_dot)
