"""From the pose that a motion capture system reports to the pose of the head.

The system tracks markers that sit somewhere on link 1: their frame M has the pose
``(position, rotation)`` in the head's frame H. With the measured pose of M in the world,

    R_H = R_M R_HM^T,    p_H = p_M - R_H p_HM,

so that a head that only turns does not seem to move, and one whose markers stand still while it
turns about them does. Errors go the same way: a small turn of the measured attitude by ``e``, in
the world, moves the head by ``(R_H p_HM) x e``.

Where y points up, both the room and the tracked body are turned by ``C = R_x(90 deg)``:
``p = C p'``, ``R = C R' C^T``. A body that was made in line with the axes of the room has no
rotation before and none after.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from snake_control.model.rotation import rotation_from_rpy

Array = NDArray[np.float64]

# (x, y, z) with y up becomes (x, -z, y).
_Z_UP_FROM_Y_UP = Rotation.from_euler("x", math.pi / 2)


class MarkerMount:
    """Where the markers are on the head, and which way the motion capture looks at the world."""

    def __init__(self, position: ArrayLike, rpy: ArrayLike, y_up: bool = False) -> None:
        """Take what was measured on the robot.

        Args:
            position: origin of the tracked body in link 1, (3,) [m].
            rpy: its roll, pitch and yaw in link 1, (3,) [rad].
            y_up: whether the motion capture's y axis points up.
        """
        self._position = np.asarray(position, dtype=float)
        self._head_from_marker = Rotation.from_matrix(rotation_from_rpy(rpy).T)
        self._y_up = y_up

    def head(
        self, position: Array, rotation: Rotation, covariance: Array
    ) -> tuple[Array, Rotation, Array]:
        """Return the pose of the head that a measured pose means.

        Args:
            position: of the tracked body, (3,) [m].
            rotation: its attitude.
            covariance: of position and small turns about the axes of the room, (6, 6)
                [m^2, m rad, rad^2].

        Returns:
            Position of the tip, attitude of the head, and their covariance, in the world, z up.
        """
        if self._y_up:
            position = _Z_UP_FROM_Y_UP.apply(position)
            rotation = _Z_UP_FROM_Y_UP * rotation * _Z_UP_FROM_Y_UP.inv()
            turn = np.kron(np.eye(2), _Z_UP_FROM_Y_UP.as_matrix())
            covariance = turn @ covariance @ turn.T
        head = rotation * self._head_from_marker
        lever = head.apply(self._position)
        x, y, z = lever
        effect = np.eye(6)
        effect[:3, 3:] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
        return position - lever, head, effect @ covariance @ effect.T
