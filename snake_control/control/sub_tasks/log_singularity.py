"""V_b1 without its scale."""

from __future__ import annotations

from snake_control.control.sub_tasks.sub_task import Array, SubTask
from snake_control.model.posture import Posture


class LogSingularity(SubTask):
    """V = log V_b1 (30), without unit.

    V and its gradient are finite in every posture. The gradient grows as 1 / sigma_min towards a
    singular one, down to the threshold of ``model/damping.py``, and shrinks below it. Where V_b1
    is 0, round-off decides what V is, -345 at least; the gradient is that of what stays regular.

    It does not reliably keep a robot from turning singular: V_b1 also counts how much motions grow
    along the body, and may rise while the body folds up (docs/sub_tasks.md). ``WheelAxes`` looks at
    the singular shapes alone.
    """

    def value(self, posture: Posture) -> float:
        """Return log V_b1, within +-345."""
        return posture.log_V_b1

    def gradient(self, posture: Posture) -> Array:
        """Return the gradient of log V_b1."""
        return posture.log_V_b1_gradient

    def by_base(self, posture: Posture) -> Array:
        """Return the part of the base joints."""
        return posture.log_V_b1_by_base
