"""Away from the ends of the joints' ranges."""

from __future__ import annotations

import numpy as np

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.sub_tasks.sub_task import Array, SubTask
from snake_control.model.posture import Posture


class JointRange(SubTask):
    """V = -sum(e_i^2) / 2, where e_i rises from 0 to 1 over the margin before either end.

    Zero and without influence while all joints are further than
    ``controller.joint_range_margin_rad`` from the ends of their ranges (of a range of less than
    two margins, half of it is taken). V has no unit, its gradient is in 1/rad: continuous, and 1 /
    margin at an end of a range. It acts on head joints among ``head_sub_tasks``, on base joints
    among ``base_sub_tasks``.
    """

    def __init__(self, robot: RobotConfig, controller: ControllerConfig) -> None:
        super().__init__(robot, controller)
        bounds = np.array(robot.joint_limits_rad).reshape(-1, 2)
        self._middle = bounds.mean(axis=1)
        half = np.ptp(bounds, axis=1) / 2
        self._margin = np.minimum(controller.joint_range_margin_rad, half)
        self._free = half - self._margin

    def value(self, posture: Posture) -> float:
        """Return V."""
        excess, _ = self._excess(posture)
        return -0.5 * float(excess @ excess)

    def gradient(self, posture: Posture) -> Array:
        """Return the gradient of V."""
        excess, side = self._excess(posture)
        by_q = np.zeros(len(posture.g.q))
        by_q[6:] = -side * excess / self._margin
        return by_q

    def _excess(self, posture: Posture) -> tuple[Array, Array]:
        deviation = posture.g.q[6:] - self._middle
        excess = np.maximum(np.abs(deviation) - self._free, 0.0) / self._margin
        return excess, np.sign(deviation)
