"""A joint way that is followed: feed-forward, feedback, and a pace that waits for what lags."""

from __future__ import annotations

import dataclasses
import enum
import math

import numpy as np
from numpy.typing import NDArray

from snake_control.control.joint_way import JointWay

Array = NDArray[np.float64]

_LAG_S = 0.1
"""What measuring and servos take: at a speed v a joint may be v times this behind."""
_SLOWED_FROM_RAD = 0.1
_STOPPED_FROM_RAD = 0.25
"""How far a joint may lag beyond that before the others wait for it, and until they stand."""
_LONGEST_STEP_S = 0.1
_LEAST_SPEED = 1e-3
_HARDLY = 0.1


class Phase(enum.Enum):
    """How far a motion is."""

    MOVING = "moving"
    ARRIVING = "arriving"
    STOPPING = "stopping"
    ARRIVED = "arrived"
    STOPPED = "stopped"
    GIVEN_UP = "given up"

    @property
    def over(self) -> bool:
        """Whether the joints are to rest from now on."""
        return self in (Phase.ARRIVED, Phase.STOPPED, Phase.GIVEN_UP)


@dataclasses.dataclass(frozen=True, eq=False)
class MotionStep:
    """One moment of a motion.

    Attributes:
        phase: how far it is.
        velocities: what the joints should do, before limits; 0 if it is over, (k,) [rad/s].
        pace: how much slower than planned it goes, 0..1.
        progress: share of the planned time that is done, 0..1.
        time_left: at full pace [s].
        error: how far the worst joint is from where it should be by now [rad].
        worst: index of that joint.
    """

    phase: Phase
    velocities: Array
    pace: float
    progress: float
    time_left: float
    error: float
    worst: int


class JointMotion:
    """Follows a way from now on."""

    def __init__(
        self,
        way: JointWay,
        *,
        gain: float,
        acceleration: float,
        tolerance: float,
        patience: float,
        t: float,
    ) -> None:
        """Begin.

        Args:
            way: where to go.
            gain: velocity for each radian off the way [1/s].
            acceleration: with which it slows down for others and at a stop [rad/s^2].
            tolerance: every joint within this has arrived [rad].
            patience: it is given up after so long without getting nearer [s].
            t: time [s].
        """
        self._way = way
        self._gain = gain
        self._tolerance = tolerance
        self._patience = patience
        self._own = 0.0
        self._pace = 1.0
        self._pace_rate = acceleration / max(way.top_speed, _LEAST_SPEED)
        lag = _LAG_S * way.top_speed
        self._slowed_from = _SLOWED_FROM_RAD + lag
        self._stopped_from = _STOPPED_FROM_RAD + lag
        self._stopping = False
        self._t = t
        # The last time it came nearer: own time on the way, then the error at its end.
        self._nearer_t, self._nearer_own, self._nearer_error = t, 0.0, math.inf

    def stop(self) -> None:
        """Slow down to rest."""
        self._stopping = True

    def pause(self) -> None:
        """Note that the joints rest for a moment: what comes next begins at rest."""
        self._pace = 0.0

    def step(self, phi: Array, t: float, allowed: float = 1.0) -> MotionStep:
        """Return what to do now.

        Args:
            phi: measured angles, (k,) [rad].
            t: time [s].
            allowed: how fast others let it go on, 0..1.
        """
        dt = min(max(t - self._t, 0.0), _LONGEST_STEP_S)
        self._t = t
        lag = float(np.abs(self._way.at(self._own).phi - phi).max(initial=0.0))
        room = self._stopped_from - self._slowed_from
        wanted = max(0.0, min(1.0, (self._stopped_from - lag) / room))
        if self._stopping:
            wanted = 0.0
        change = self._pace_rate * dt
        self._pace = min(max(wanted, self._pace - change), self._pace + change, allowed)
        self._own = min(self._own + self._pace * dt, self._way.duration)

        now = self._way.at(self._own)
        off = now.phi - phi
        worst = int(np.abs(off).argmax()) if off.size else 0
        error = float(abs(off[worst])) if off.size else 0.0
        phase = self._phase(error, t)
        rest = np.zeros_like(off)
        return MotionStep(
            phase=phase,
            velocities=rest if phase.over else self._pace * now.rate + self._gain * off,
            pace=self._pace,
            progress=self._own / self._way.duration if self._way.duration > 0.0 else 1.0,
            time_left=self._way.duration - self._own,
            error=error,
            worst=worst,
        )

    def _phase(self, error: float, t: float) -> Phase:
        if self._stopping:
            return Phase.STOPPED if self._pace == 0.0 else Phase.STOPPING
        at_end = self._own >= self._way.duration
        if at_end and error <= self._tolerance:
            return Phase.ARRIVED
        if at_end:
            nearer = error < self._nearer_error - _HARDLY * self._tolerance
        else:
            nearer = self._own > self._nearer_own + _HARDLY * self._patience
        if nearer:
            self._nearer_t, self._nearer_own = t, self._own
            self._nearer_error = error if at_end else math.inf
        elif t - self._nearer_t > self._patience:
            return Phase.GIVEN_UP
        return Phase.ARRIVING if at_end else Phase.MOVING
