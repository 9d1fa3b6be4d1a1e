"""Away from the singular shapes of Fig. 5: wheel axes parallel, or through one point."""

from __future__ import annotations

import math

from snake_control.control.sub_tasks.sub_task import Array, SubTask
from snake_control.model.posture import Posture
from snake_control.model.wheel_axes import axis_spread

_FLOOR = 1e-6


class WheelAxes(SubTask):
    """V = log(D + 1e-6): D is how well spread the wheel axes are, 0..1, 0 in a singular shape.

    D (``model/wheel_axes.py``) has no unit and hangs on the angles of the base alone: neither
    size nor length nor place of the robot changes it, so one gain suits all. It counts the wheels'
    axes and not, as V_b1 does, how much motions grow along the body. The floor bounds the
    gradient: it is 0 in a singular shape, and largest where D = 1e-6.
    """

    def value(self, posture: Posture) -> float:
        """Return V, -13.8..0."""
        return math.log(axis_spread(posture.g)[0] + _FLOOR)

    def gradient(self, posture: Posture) -> Array:
        """Return the gradient of V."""
        spread, by_q = axis_spread(posture.g)
        return by_q / (spread + _FLOOR)
