"""Whether a position can be true, by what was read before and how fast a servo can turn."""

from __future__ import annotations

import math

from snake_control.ax12.units import RAD_PER_TICK

CONVINCING_S = 1.0
"""Readings that contradict the earlier ones, but agree among each other for so long, are taken."""

_TRUSTED_S, _TRUSTED_PERIODS = 0.1, 2.5
_SLACK_RAD = 4 * RAD_PER_TICK


class PositionGate:
    """Refuses positions that the servo cannot have reached since the last one that was taken.

    What it can have made grows with the time since then, but not beyond a tenth of a second: else
    nonsense would become believable by being repeated. From then on only ``CONVINCING_S`` of
    readings that agree among each other count; after a silence, in which the joint can have gone
    anywhere, a second reading that agrees.

    A servo in wheel mode passes the gap of its sensor, unread in effect, again and again: there
    the time counts in full, and angles are those of a circle.
    """

    def __init__(self, max_rate: float, wheel: bool, period: float = 0.02) -> None:
        """Take whatever comes first.

        Args:
            max_rate: of the servo [rad/s].
            wheel: whether it turns without end.
            period: nominal time between two readings [s].
        """
        self._max_rate = max_rate
        self._wheel = wheel
        self._trusted_s = max(_TRUSTED_S, _TRUSTED_PERIODS * period)
        self.open()

    def open(self) -> None:
        """Take whatever comes next."""
        self._taken = self._last = math.nan
        self._taken_at = self._last_at = self._doubted_since = -math.inf
        self._silent = False

    def start(self, angle: float, now: float) -> None:
        """Begin with an angle [rad] that is known otherwise."""
        self._taken = self._last = angle
        self._taken_at = self._last_at = now

    def takes(self, angle: float, now: float) -> bool:
        """Whether an angle read at ``now`` can be true; the next ones are judged by it.

        Args:
            angle: [rad].
            now: time of the reading [s].
        """
        since_last = now - self._last_at
        agrees = self._apart(angle, self._last) <= self._reach(since_last)
        doubted = self._last_at > self._taken_at
        allowed = now - self._taken_at
        if not self._wheel:
            allowed = min(allowed, self._trusted_s)
        taken = math.isnan(self._taken) or self._apart(angle, self._taken) <= self._reach(allowed)
        if not taken:
            silent = since_last > self._trusted_s
            if silent or not (doubted and agrees):
                self._doubted_since = now
                self._silent = silent
            else:
                taken = self._silent or now - self._doubted_since >= CONVINCING_S
        self._last, self._last_at = angle, now
        if taken:
            self._taken, self._taken_at = angle, now
        return taken

    def _reach(self, time: float) -> float:
        return self._max_rate * time + _SLACK_RAD

    def _apart(self, a: float, b: float) -> float:
        return abs(math.remainder(a - b, math.tau) if self._wheel else a - b)
