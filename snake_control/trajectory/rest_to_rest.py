"""A length from rest to rest: speeds up, keeps a speed, slows down."""

from __future__ import annotations

import math
from typing import NamedTuple


class Progress(NamedTuple):
    """How far a motion is, in its own unit of length.

    Attributes:
        s: length that is done.
        rate, acceleration: its first and second derivative by time.
    """

    s: float
    rate: float
    acceleration: float


class RestToRest:
    """Speeds up evenly, keeps a speed, slows down evenly.

    The acceleration itself grows and shrinks as sin^2, so the motion is smooth up to it and the
    jerk has a bound.

    Attributes:
        length: of the motion.
        speed: largest speed that is reached.
        duration: of the motion [s].
        ramp: how long speeding up takes, and slowing down [s].
    """

    def __init__(self, length: float, speed: float, acceleration: float) -> None:
        """Define the motion.

        Args:
            length: > 0.
            speed: > 0; not reached on a length that is too short.
            acceleration: largest acceleration, > 0.
        """
        self.length = length
        # A ramp of the form sin^2 takes twice as long as one of constant acceleration.
        self.ramp = 2.0 * speed / acceleration
        if speed * self.ramp > length:
            self.ramp = math.sqrt(2.0 * length / acceleration)
            speed = length / self.ramp
        self.speed = speed
        self.duration = length / speed + self.ramp

    def at(self, t: float) -> Progress:
        """Return the progress after ``t`` [s]; at rest before the start and after the end."""
        if t >= self.duration:
            return Progress(self.length, 0.0, 0.0)
        if t > self.duration - self.ramp:
            s, rate, acceleration = self._ramped(self.duration - t)
            return Progress(self.length - s, rate, -acceleration)
        return self._ramped(max(t, 0.0))

    def _ramped(self, t: float) -> Progress:
        """Return length, speed and acceleration from rest, after ``t`` [s]."""
        ramp, speed = self.ramp, self.speed
        if t >= ramp:
            return Progress(speed * (t - 0.5 * ramp), speed, 0.0)
        k = math.tau / ramp
        # The integrals of (2 speed / ramp) sin^2(k t / 2).
        return Progress(
            speed / ramp * (0.5 * t * t - (1.0 - math.cos(k * t)) / k**2),
            speed / ramp * (t - math.sin(k * t) / k),
            speed / ramp * (1.0 - math.cos(k * t)),
        )
