"""What both velocity modes share: limits, and whole units whose average is the velocity wanted."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

from snake_control.ax12.units import MAX_RAW, MAX_TICKS


class Present(NamedTuple):
    """A measured angle [rad], its rate [rad/s] and age [s], and the output seen with it.

    Attributes:
        load: Present Load as a fraction of the largest output, counter-clockwise positive; NaN if
            it is not known.
    """

    angle: float
    rate: float
    age: float
    load: float = math.nan

    def after(self, longest: float, fastest: float) -> float:
        """The angle extrapolated to the present time, by a limited time and speed only."""
        return self.angle + min(max(self.rate, -fastest), fastest) * min(self.age, longest)


class GoalAndSpeed(NamedTuple):
    """Register values of one cycle; no goal in wheel mode."""

    goal_ticks: int | None
    speed_raw: int


@dataclasses.dataclass(frozen=True)
class VelocityLimits:
    """What bounds one servo's motion.

    Attributes:
        lower_ticks, upper_ticks: range of goals (joint mode).
        speed: largest speed [rad/s].
        acceleration: largest change of the commanded speed [rad/s^2], 0 for none.
        period: nominal time between two cycles [s].
        look_ahead: how far the goal is ahead of the joint, as time at its speed [s].
        compliance_ticks: margin + slope, in which the servo does not move at its speed.
        goal_ticks: first and last goal that the servo accepts; it refuses others, and goes on to
            the goal it had (joint mode).
    """

    lower_ticks: int
    upper_ticks: int
    speed: float
    acceleration: float
    period: float
    look_ahead: float
    compliance_ticks: int
    goal_ticks: tuple[int, int] = (0, MAX_TICKS)


class SigmaDelta:
    """Whole numbers of units whose average over time is the velocity."""

    def __init__(self, unit: float, period: float) -> None:
        self._unit = unit
        self._period = period
        self._missing = 0.0  # [units * s]
        self._wanted = 0.0
        self._sent = 0

    def reset(self) -> None:
        """Forget what is missing."""
        self._missing = self._wanted = 0.0
        self._sent = 0

    def elapse(self, dt: float) -> float:
        """Account for the time since the last number was sent; return the way it made [rad]."""
        self._missing += (self._wanted - self._sent) * dt
        self._missing = min(max(self._missing, -self._period), self._period)
        return self._sent * self._unit * dt

    def next(self, velocity: float) -> int:
        """Return the signed number of units to send for a velocity [rad/s] from now on."""
        if velocity == 0.0:
            self.reset()
            return 0
        self._wanted = velocity / self._unit
        number = round(self._wanted + self._missing / self._period)
        # Never against the wanted direction, whatever was missing before.
        number = max(number, 0) if velocity > 0 else min(number, 0)
        self._sent = min(max(number, -MAX_RAW), MAX_RAW)
        return self._sent


class Ramp:
    """Limits speed, and the change of speed if configured.

    Attributes:
        velocity: what was commanded last [rad/s].
    """

    def __init__(self, limits: VelocityLimits) -> None:
        self._limits = limits
        self.velocity = 0.0

    def step(self, velocity: float, dt: float) -> float:
        """Return what may be commanded of a wanted velocity [rad/s], ``dt`` after the last one."""
        speed, acceleration = self._limits.speed, self._limits.acceleration
        velocity = min(max(velocity, -speed), speed)
        if acceleration > 0.0:
            change = acceleration * dt
            velocity = min(max(velocity, self.velocity - change), self.velocity + change)
        self.velocity = velocity
        return velocity
