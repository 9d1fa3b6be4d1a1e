"""A trajectory that begins where the head is, at rest, and passes over into another."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.control.reference import Reference
from snake_control.model.rotation import unwrap_near
from snake_control.trajectory.head_trajectory import HeadTrajectory

Array = NDArray[np.float64]


class Approach:
    """w_d = (1 - s) w(0) + s w_goal(t), with s from 0 to 1 in the given time.

    s is the polynomial of degree 5 that starts and ends with rate and acceleration 0, so w_d starts
    at rest and is smooth up to its acceleration where the other's is. Far from its reference a
    controller would ask for as much speed at once as its gains make of the error.
    """

    def __init__(
        self, goal: HeadTrajectory, head: ArrayLike, start: float, duration: float
    ) -> None:
        """Define the approach.

        Args:
            goal: the trajectory to pass over into.
            head: head pose at ``start``, [x, y, z, R, P, Y], (6,) [m, rad].
            start: time at which it starts [s]; before it the head pose is held.
            duration: after this long the goal is followed, > 0 [s].
        """
        self._goal = goal
        self._start = start
        self._duration = duration
        self._head = np.array(head, dtype=float)
        # By the shorter way round.
        self._head[3:] = unwrap_near(self._head[3:], goal.sample(start).w_d[3:])

    def sample(self, t: float) -> Reference:
        """Return pose, rate and acceleration at time ``t`` [s]."""
        x = min(max((t - self._start) / self._duration, 0.0), 1.0)
        s = x**3 * (10 - 15 * x + 6 * x * x)
        s_dot = 30 * x**2 * (1 - x) ** 2 / self._duration
        s_ddot = 60 * x * (1 - x) * (1 - 2 * x) / self._duration**2
        goal = self._goal.sample(max(t, self._start))
        way = goal.w_d - self._head
        return Reference(
            self._head + s * way,
            s * goal.w_d_dot + s_dot * way,
            s * goal.w_d_ddot + 2 * s_dot * goal.w_d_dot + s_ddot * way,
        )
