"""The base links keep away from circles on the floor."""

from __future__ import annotations

import numpy as np

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.sub_tasks.sub_task import Array, SubTask
from snake_control.model.clearance import Clearances, clearances, gradient_of_clearances
from snake_control.model.posture import Posture


class Obstacles(SubTask):
    """V = -sum(e^2) / 2 over base links and circles; e = 1 - clearance / margin, at least 0.

    The clearance is the distance from a circle to a link's body, the strip along the link out to
    its wheels; negative when they overlap [m]. The circles come from
    ``controller.obstacles_file``, the margin from ``controller.obstacle_margin_m``. V has no unit;
    it is zero and without influence beyond the margin. Its gradient is continuous except where a
    link's centre line runs through a circle's centre, and bounded.
    """

    def __init__(self, robot: RobotConfig, controller: ControllerConfig) -> None:
        super().__init__(robot, controller)
        circles = controller.obstacles or ()
        self._centers = np.array([(c.x_m, c.y_m) for c in circles]).reshape(-1, 2)
        self._radii = np.array([c.radius_m for c in circles])

    def value(self, posture: Posture) -> float:
        """Return V."""
        return -0.5 * float(np.sum(self._excess(self._found(posture)) ** 2))

    def gradient(self, posture: Posture) -> Array:
        """Return the gradient of V."""
        found = self._found(posture)
        weights = self._excess(found) / self.controller.obstacle_margin_m
        return gradient_of_clearances(posture.g, found, weights)

    def _found(self, posture: Posture) -> Clearances:
        return clearances(posture.g, self._centers, self._radii)

    def _excess(self, found: Clearances) -> Array:
        return np.maximum(1.0 - found.clearance / self.controller.obstacle_margin_m, 0.0)
