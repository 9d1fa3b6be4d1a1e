"""The head stays where it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from snake_control.control.reference import Reference


class Hold:
    """Keeps one pose for ever."""

    def __init__(self, pose: ArrayLike) -> None:
        """Hold ``pose`` = [x, y, z, R, P, Y], shape (6,) [m, rad]."""
        self._reference = Reference(np.array(pose, dtype=float), np.zeros(6))

    def sample(self, t: float) -> Reference:
        """Return the pose with zero rate, whatever ``t``."""
        return self._reference
