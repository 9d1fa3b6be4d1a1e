"""The margin against falling without the size of the robot."""

from __future__ import annotations

from snake_control.control.sub_tasks.sub_task import Array, SubTask
from snake_control.model.posture import Posture


class RelativeFall(SubTask):
    """V = d_min / l, without unit: ``Fall`` in half lengths of a link."""

    def value(self, posture: Posture) -> float:
        """Return d_min / l."""
        return posture.support.d_min / self.robot.half_length_m

    def gradient(self, posture: Posture) -> Array:
        """Return the gradient of d_min / l."""
        return posture.support.gradient / self.robot.half_length_m

    def by_base(self, posture: Posture) -> Array:
        """Return the part of the base joints."""
        return posture.support.by_base / self.robot.half_length_m
