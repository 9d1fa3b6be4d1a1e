"""The head follows velocity commands, within limits, and comes to rest when they stop."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from snake_control.control.reference import Reference
from snake_control.model.rotation import rpy_rate_map
from snake_control.trajectory.motion_limits import PITCH_LIMIT_RAD, MotionLimits, shorten

Array = NDArray[np.float64]

# Longer times between samples are integrated in steps of at most this.
_STEP_S = 0.02


@dataclasses.dataclass(frozen=True)
class HeadVelocityCommand:
    """How the head shall move.

    Attributes:
        linear: velocity of the tip, shape (3,) [m/s].
        angular: angular velocity of the head, shape (3,) [rad/s].
        in_heading_frame: both are given in the frame that has the head's yaw and is otherwise
            level (x ahead, y left, z up); else in the world.
    """

    linear: Array
    angular: Array
    in_heading_frame: bool = False

    @property
    def is_zero(self) -> bool:
        """Whether the head shall stand still."""
        return not (self.linear.any() or self.angular.any())


class Teleop:
    """Integrates velocity commands from a pose and rate that are given at the start.

    Speed and acceleration are limited. A command counts until the next one or ``release``. Without
    any command the head is brought to rest, from the motion given at the start too, which is how a
    running trajectory is stopped.
    """

    def __init__(self, start: Reference, t: float, limits: MotionLimits) -> None:
        """Start at time ``t`` [s] with the pose and rate of ``start``."""
        self._pose = np.array(start.w_d, dtype=float)
        self._rate = np.array(start.w_d_dot, dtype=float)
        self._t = t
        self._limits = limits
        self._command: HeadVelocityCommand | None = None

    def command(self, command: HeadVelocityCommand) -> None:
        """Follow ``command`` from the next sample on."""
        self._command = command

    def release(self) -> None:
        """Bring the head to rest from the next sample on: nobody commands any more."""
        self._command = None

    @property
    def commanded(self) -> bool:
        """Whether a command counts."""
        return self._command is not None

    @property
    def at_rest(self) -> bool:
        """Whether no command counts and the head has stopped."""
        return self._command is None and not self._rate.any()

    def sample(self, t: float) -> Reference:
        """Integrate to time ``t`` [s] and return pose and rate there."""
        # Rounding of t must not turn one step into two.
        steps = math.ceil((t - self._t) / _STEP_S - 1e-6)
        if t > self._t and steps > 0:
            dt = (t - self._t) / steps
            for _ in range(steps):
                self._step(dt)
            self._t = t
        return Reference(self._pose.copy(), self._rate.copy())

    def _step(self, dt: float) -> None:
        wanted = np.zeros(6) if self._command is None else self._wanted_rate(self._command, dt)
        rate = self._limits.approach(self._rate, wanted, dt)
        self._pose += (self._rate + rate) / 2 * dt
        self._rate = rate

    def _wanted_rate(self, command: HeadVelocityCommand, dt: float) -> Array:
        linear = shorten(command.linear, self._limits.linear_speed)
        angular = shorten(command.angular, self._limits.angular_speed)
        _, pitch, yaw = self._pose[3:]
        if command.in_heading_frame:
            c, s = math.cos(yaw), math.sin(yaw)
            to_world = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            linear = to_world @ linear
            angular = to_world @ angular
        # Beyond the pitch limit, where a given pose may lie, the map is taken at the limit.
        rpy = self._pose[3:].copy()
        rpy[1] = min(max(pitch, -PITCH_LIMIT_RAD), PITCH_LIMIT_RAD)
        rates = np.linalg.solve(rpy_rate_map(rpy), angular)
        stop = self._limits.rate_to_stop_within
        rates[1] = min(
            max(rates[1], -stop(PITCH_LIMIT_RAD + pitch, -self._rate[4], dt)),
            stop(PITCH_LIMIT_RAD - pitch, self._rate[4], dt),
        )
        return np.concatenate([linear, rates])
