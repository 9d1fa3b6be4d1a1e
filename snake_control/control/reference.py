"""What the head shall do at one moment: the seam between trajectories and controllers."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Reference:
    """Wanted head pose, its rate and its acceleration.

    Attributes:
        w_d: [x_h, y_h, z_h, R, P, Y], (6,) [m, rad].
        w_d_dot: its time derivative (rates of R, P, Y, no angular velocity), (6,) [m/s, rad/s];
            at full speed, where the motion is slowed.
        w_d_ddot: the second time derivative, which torque control feeds forward, (6,)
            [m/s^2, rad/s^2]; default 0.
        time_scale: how much slower than planned the reference moves at present, 0..1: its rate is
            time_scale * w_d_dot.
        phi_tilde_dot_d: wanted SCP velocities, as they are at present, H-SCPs first, (m,) [rad/s];
            ``None`` to let the sub-tasks decide.
    """

    w_d: Array
    w_d_dot: Array
    w_d_ddot: Array = dataclasses.field(default_factory=lambda: np.zeros(6))
    time_scale: float = 1.0
    phi_tilde_dot_d: Array | None = None
