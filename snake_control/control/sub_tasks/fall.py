"""The paper's sub-task against falling (30)."""

from __future__ import annotations

from snake_control.control.sub_tasks.sub_task import Array, SubTask
from snake_control.model.posture import Posture


class Fall(SubTask):
    """V = V_b2 = d_min [m] (30): signed distance from P_G to the edge of the support polygon.

    The gradient is that of the nearest edge, so it jumps where two edges are equally near; its
    norm is at most the length of the robot.
    """

    def value(self, posture: Posture) -> float:
        """Return d_min."""
        return posture.support.d_min

    def gradient(self, posture: Posture) -> Array:
        """Return the gradient of d_min."""
        return posture.support.gradient

    def by_base(self, posture: Posture) -> Array:
        """Return the part of the base joints."""
        return posture.support.by_base
