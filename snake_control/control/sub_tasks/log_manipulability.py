"""Manipulability of the head without the scale of the robot."""

from __future__ import annotations

import math

import numpy as np

from snake_control.control.sub_tasks.sub_task import Array, SubTask
from snake_control.model.posture import Posture

_FLOOR = 1e-6


class LogManipulability(SubTask):
    """V = log(v^2 + floor^2) / 2 with v = V_h / l^(n_b - m_b + 1), both without unit.

    V_h is the determinant of the 4 x 4 head block [m^2] times l^(n_b - m_b - 1) (see
    ``model/posture.py``), so v is ``Posture.head_determinant``: without the base's length and the
    size of the robot. Where the head is well shaped (v of the order of 0.01) the gradient is that
    of log V_h; the floor of 1e-6 bounds it, and it is 0 where V_h = 0.
    """

    def value(self, posture: Posture) -> float:
        """Return V."""
        return math.log(math.hypot(posture.head_determinant, _FLOOR))

    def gradient(self, posture: Posture) -> Array:
        """Return v / (v^2 + floor^2) times the gradient of v."""
        return _slope(posture) * posture.head_determinant_gradient

    def by_head(self, posture: Posture) -> Array:
        """Return the part of the head joints."""
        return _slope(posture) * np.array(posture.head_determinant_by_head)


def _slope(posture: Posture) -> float:
    v = posture.head_determinant
    return v / (v * v + _FLOOR * _FLOOR)
