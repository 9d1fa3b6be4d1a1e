"""Manipulability of the head without the scale of the robot."""

from __future__ import annotations

import math

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.sub_tasks.sub_task import Array, SubTask
from snake_control.model.posture import Posture
from snake_control.model.structure import structure

_FLOOR = 1e-6


class LogManipulability(SubTask):
    """V = log(v^2 + floor^2) / 2 with v = V_h / l^(n_b - m_b + 1), both without unit.

    V_h is the determinant of the 4 x 4 head block [m^2] times l^(n_b - m_b - 1) (see
    ``model/posture.py``), so v takes out the base's length as well as the size of the
    robot. Where the head is well shaped (v of the order of 0.01) the gradient is that of log V_h;
    the floor of 1e-6 bounds it, and it is 0 where V_h = 0.
    """

    def __init__(self, robot: RobotConfig, controller: ControllerConfig) -> None:
        super().__init__(robot, controller)
        # In logarithms: the power of a short length leaves the range of numbers on long robots.
        self._log_unit = (len(structure(robot).wheeled) + 1) * math.log(robot.half_length_m)

    def value(self, posture: Posture) -> float:
        """Return V."""
        return math.log(math.hypot(self._relative(posture), _FLOOR))

    def gradient(self, posture: Posture) -> Array:
        """Return v^2 / (v^2 + floor^2) times the gradient of log V_h."""
        v = self._relative(posture)
        if v == 0.0:
            return 0.0 * posture.V_h_gradient
        share = v * v / (v * v + _FLOOR * _FLOOR)
        return posture.V_h_gradient * (share / posture.V_h)

    def _relative(self, posture: Posture) -> float:
        return math.exp(math.log(posture.V_h) - self._log_unit) if posture.V_h > 0.0 else 0.0
