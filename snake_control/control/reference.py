"""What the head shall do at one moment: the seam between trajectories and controllers."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Reference:
    """Wanted head pose and its rate.

    Attributes:
        w_d: [x_h, y_h, z_h, R, P, Y], (6,) [m, rad].
        w_d_dot: its time derivative (rates of R, P, Y, no angular velocity), (6,) [m/s, rad/s].
    """

    w_d: Array
    w_d_dot: Array
