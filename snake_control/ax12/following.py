"""Whether a joint goes where it is told; a blocked shaft and a stuck sensor look alike here."""

from __future__ import annotations

from snake_control.ax12.units import RAD_PER_TICK

_SHARE = 0.1
_LEAST_RAD = 8 * RAD_PER_TICK


class FollowWatch:
    """Compares the way that a joint was told to make with the one that it made.

    Way is judged over windows of ``time`` seconds; a reversal or a rest begins a new one. Too
    little way to be told from the steps of the sensor (8 positions) says nothing.
    """

    def __init__(self, time: float) -> None:
        """Start at rest; ``time`` is the length of a window [s]."""
        self._time = time
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._direction = 0
        self._begun_at: float | None = None
        self._elapsed = self._wanted = 0.0
        self.failed = False

    def step(self, velocity: float, dt: float, angle: float) -> None:
        """Account for a cycle.

        Args:
            velocity: what the joint was told until now [rad/s].
            dt: for how long [s].
            angle: where it was last seen [rad].
        """
        direction = (velocity > 0.0) - (velocity < 0.0)
        if direction != self._direction or self._begun_at is None:
            self.reset()
            self._direction = direction
            self._begun_at = angle
            return
        if direction == 0:
            return
        self._elapsed += dt
        self._wanted += abs(velocity) * dt
        if self._elapsed < self._time:
            return
        made = direction * (angle - self._begun_at)
        if self._wanted >= _LEAST_RAD:
            self.failed = not made >= _SHARE * self._wanted
            self._elapsed = self._wanted = 0.0
            self._begun_at = angle
