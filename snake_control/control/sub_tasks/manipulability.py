"""The paper's sub-task of the head: away from postures in which B_tilde has no inverse (29)."""

from __future__ import annotations

import numpy as np

from snake_control.control.sub_tasks.sub_task import Array, SubTask
from snake_control.model.posture import Posture


class Manipulability(SubTask):
    """V = V_h = |det B_tilde| [m^(n_b - m_b + 1)] (29); its gradient is finite everywhere."""

    def value(self, posture: Posture) -> float:
        """Return V_h."""
        return posture.V_h

    def gradient(self, posture: Posture) -> Array:
        """Return the gradient of V_h, from cofactors: no division by V_h."""
        return posture.V_h_gradient

    def by_head(self, posture: Posture) -> Array:
        """Return the part of the head joints."""
        return np.array(posture.V_h_by_head)
