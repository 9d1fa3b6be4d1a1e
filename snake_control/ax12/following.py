"""Whether a joint goes where it is told; a blocked shaft and a stuck sensor look alike here."""

from __future__ import annotations

import math

from snake_control.ax12.units import RAD_PER_TICK, RAD_S_PER_SPEED_UNIT

_SHARE = 0.1
_LEAST_RAD = 8 * RAD_PER_TICK
_LEAST_CREEPING_RAD = 40 * RAD_PER_TICK
_CREEPING = 5 * RAD_S_PER_SPEED_UNIT
_HIGH_LOAD = 0.5
_RUN_IN_S = 0.1


class FollowWatch:
    """Compares the way that a joint was told to make with the one that it made.

    Way is judged over windows of half the time, in which a tenth of a second after each start is
    left out: a joint and its readings lag. A reversal begins anew, and so does a rest as long as
    the time; a shorter one, as of commands that arrive late, does not. A window with less than a
    tenth of the way is a doubt, a second one in a row a failure. Too little way to be told from the
    steps of the sensor (8 positions) says nothing. Below 5 units of Moving Speed a servo may
    hesitate: there 40 positions are waited for, unless it pushes.

    Attributes:
        doubt: what seems to be wrong, empty if nothing.
        failed: whether the robot must stop for it.
    """

    def __init__(self, time: float) -> None:
        """Start at rest.

        Args:
            time: how long a joint may stay behind [s].
        """
        self._window = 0.5 * time
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._direction = 0
        self._rested = self._led = 0.0
        self._seen = math.nan
        self.doubt = ""
        self.failed = False
        self._begin()

    def _begin(self) -> None:
        self._elapsed = self._wanted = self._made = 0.0
        self._pushes = self._frozen = True

    def step(self, velocity: float, dt: float, angle: float, load: float) -> None:
        """Account for a cycle.

        Args:
            velocity: what the joint was told until now [rad/s].
            dt: for how long [s].
            angle: where it was last seen [rad].
            load: its load as fraction of the maximum output.
        """
        direction = (velocity > 0.0) - (velocity < 0.0)
        way, self._seen = angle - self._seen, angle
        if direction == 0:
            self._rested += dt
            if self._rested >= 2.0 * self._window:
                self.reset()
            return
        if direction != self._direction:
            self.reset()
            self._direction, self._seen = direction, angle
        elif self._rested:
            self._led = 0.0
        self._rested = 0.0
        self._led += dt
        if self._led <= _RUN_IN_S:
            return
        self._elapsed += dt
        self._wanted += abs(velocity) * dt
        self._made += direction * way
        self._pushes = self._pushes and abs(load) >= _HIGH_LOAD
        self._frozen = self._frozen and way == 0.0
        fast = self._wanted >= _CREEPING * self._elapsed
        least = _LEAST_RAD if fast or self._pushes else _LEAST_CREEPING_RAD
        if self._elapsed < self._window or self._wanted < least:
            return
        follows = self._made >= _SHARE * self._wanted
        self.failed = not follows and self.doubt != ""
        self.doubt = "" if follows else self._why(load)
        self._begin()

    def _why(self, load: float) -> str:
        if self._pushes:
            return f"blocked? load {100 * abs(load):.0f} %"
        if self._frozen:
            return "its position does not change: blocked, no drive, or its sensor is stuck?"
        return "it moves otherwise than told"
