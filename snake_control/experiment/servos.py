"""What stands between the controller and the joints in lockstep: nothing, or an AX-12's limits.

No bytes and no firmware here (the mock bus has those), only what the servos do to numbers: so that
an experiment can say which of its errors come from them.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig

Array = NDArray[np.float64]

TICK_RAD = np.deg2rad(300.0 / 1023.0)
"""Resolution of an AX-12's position: 0.29 degrees."""
SPEED_UNIT_RAD_S = 0.111 * 2.0 * np.pi / 60.0
"""Resolution of its Moving Speed: 0.111 rpm."""


class Servos(Protocol):
    """Turns the controller's joint velocities into those of the joints, once each control cycle.

    Order in a cycle: ``measure`` what the controller will read, then ``command`` what it decided.
    """

    def reset(self, phi: ArrayLike) -> None:
        """Start anew at joint angles ``phi``, (n-1,) [rad], at rest."""

    def measure(self, phi: Array) -> Array:
        """Return the joint angles that the controller reads, (n-1,) [rad]."""

    def command(self, u: Array, phi: Array, period_s: float) -> Array:
        """Return the joint velocities of the cycle that begins, (n-1,) [rad/s].

        Args:
            u: joint velocities that the controller decided now, (n-1,) [rad/s].
            phi: true joint angles now, (n-1,) [rad].
            period_s: length of the cycle [s].
        """


class PerfectServos:
    """Joints follow at once and exactly, as the paper's equations assume; no limits at all."""

    def reset(self, phi: ArrayLike) -> None:
        """Nothing is kept; see ``Servos.reset``."""

    def measure(self, phi: Array) -> Array:
        """Return the true angles."""
        return phi

    def command(self, u: Array, phi: Array, period_s: float) -> Array:
        """Return ``u``."""
        return u


class LimitedServos:
    """An AX-12 as numbers: whole position ticks, whole speed units, a range, and a late command.

    * Angles are read in ticks of 0.29 degrees.
    * A command decided in one cycle is in force in the next: reading, computing and writing take a
      cycle.
    * Speeds are whole units of 0.111 rpm. The rounding remainder is carried into the next cycle
      (as ``bus_driver`` does), so that any speed is right on average; or it is lost.
    * No joint exceeds its speed limit or leaves its range; at an end it stops.

    The whole vector has been scaled to the speed limits by the controller before
    (``JointLimits``), which keeps the wheels rolling; the limit here is the servo's own.
    """

    def __init__(self, robot: RobotConfig, carry_remainder: bool = True) -> None:
        """Make the servos of a robot.

        Args:
            robot: ranges and speed limits of its joints.
            carry_remainder: whether what rounding a speed leaves is added to the next one.
        """
        bounds = np.array(robot.joint_limits_rad).reshape(-1, 2)
        self._lower, self._upper = bounds[:, 0], bounds[:, 1]
        speed = np.array(robot.joint_speed_limits_rad_s)
        self._most_units = np.floor(speed / SPEED_UNIT_RAD_S + 1e-9)
        self._carry = carry_remainder
        self.reset(np.zeros(robot.joints))

    def reset(self, phi: ArrayLike) -> None:
        """Forget what was commanded; see ``Servos.reset``."""
        self._next = np.zeros(np.shape(phi))
        self._missing = np.zeros(np.shape(phi))

    def measure(self, phi: Array) -> Array:
        """Return the angles in whole ticks."""
        return np.round(phi / TICK_RAD) * TICK_RAD

    def command(self, u: Array, phi: Array, period_s: float) -> Array:
        """Return what the servos do with the command of the cycle before; keep ``u`` for later."""
        now, self._next = self._next, self._whole_units(u)
        return np.clip(now, (self._lower - phi) / period_s, (self._upper - phi) / period_s)

    def _whole_units(self, u: Array) -> Array:
        wanted = u / SPEED_UNIT_RAD_S + self._missing
        units = np.clip(np.round(wanted), -self._most_units, self._most_units)
        if self._carry:
            # Within one unit: what a joint at its speed limit lacks must not pile up.
            self._missing = np.clip(wanted - units, -1.0, 1.0)
        return units * SPEED_UNIT_RAD_S
