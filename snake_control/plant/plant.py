"""The seam behind which bodies stand: kinematic now, rigid-body physics later."""

from __future__ import annotations

import dataclasses
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class PlantState:
    """Ground truth of the robot's body.

    Attributes:
        w: head pose [x_h, y_h, z_h, R, P, Y], (6,) [m, rad].
        w_dot: its rate, (6,) [m/s, rad/s].
        phi: joint angles, (n-1,) [rad].
        phi_dot: joint velocities, (n-1,) [rad/s].
        effort: torque each joint's servo has to apply, (n-1,) [N m].
        slip: sideways velocity of each wheeled base link, ascending, (n_b - m_b,) [m/s].
        d_min: signed distance from P_G to the nearest edge of the support polygon [m].
        fallen: whether d_min has been negative at any time since the last reset.
    """

    w: Array
    w_dot: Array
    phi: Array
    phi_dot: Array
    effort: Array
    slip: Array
    d_min: float
    fallen: bool


class Plant(Protocol):
    """A body that joint commands move."""

    def reset(self, phi: ArrayLike, w: ArrayLike | None = None) -> PlantState:
        """Put the robot on the floor.

        Args:
            phi: joint angles, (n-1,) [rad].
            w: head pose of which x_h, y_h, Y are used (the floor decides the rest); default 0.
        """

    def step(self, joint_command: ArrayLike, dt: float) -> PlantState:
        """Advance by ``dt`` seconds.

        Args:
            joint_command: joint velocities, (n-1,) [rad/s] (torques where a plant takes them).
            dt: time step [s].
        """
