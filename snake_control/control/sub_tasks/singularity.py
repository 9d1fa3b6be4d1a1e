"""The paper's sub-task against singular postures (30)."""

from __future__ import annotations

import math

from snake_control.control.sub_tasks.sub_task import Array, SubTask
from snake_control.model.posture import Posture

_LARGEST = math.log(1e100)


class Singularity(SubTask):
    """V = V_b1 = det(E_tilde E_tilde^T) (30).

    Its unit and size belong to one robot (1e8 for the paper's, 1e31 for one of 48 links): see
    ``WheelAxes`` and ``LogSingularity`` for others. The gradient is bounded: a V_b1 above 1e100
    counts as 1e100, and in a singular posture it is 0.
    """

    def value(self, posture: Posture) -> float:
        """Return V_b1."""
        return posture.V_b1

    def gradient(self, posture: Posture) -> Array:
        """Return the gradient of V_b1, as V_b1 times that of its logarithm."""
        return posture.log_V_b1_gradient * math.exp(min(posture.log_V_b1, _LARGEST))

    def by_base(self, posture: Posture) -> Array:
        """Return the part of the base joints."""
        return posture.log_V_b1_by_base * math.exp(min(posture.log_V_b1, _LARGEST))
