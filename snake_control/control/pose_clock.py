"""How the clock that stamps poses stands against this computer's.

A pose arrives ``clock offset + transport`` after its stamp, by this computer's clock. Transport is
never negative and is short now and then, so the least of these ages within a window is the offset
plus the shortest transport (the clock filter of NTP takes its sample of least delay for the same
reason). That least age cannot be below 0 by clocks in step, hardly exceeds the system's latency,
and does not wander.
"""

from __future__ import annotations

import collections
import math

_MIN_SAMPLES = 20
_WINDOWS_KEPT = 7


class ClockWatch:
    """Watches the least age on arrival; times in nanoseconds of this computer's clock."""

    def __init__(
        self, window_s: float, tolerance_s: float, max_delay_s: float, max_drift_s: float
    ) -> None:
        """Start without a sample.

        Args:
            window_s: length of the window.
            tolerance_s: how far ahead stamps may be.
            max_delay_s: how old the youngest pose of a window may be.
            max_drift_s: how far the offset may wander in six windows.
        """
        self._window_ns = round(window_s * 1e9)
        self._tolerance_s = tolerance_s
        self._max_delay_s = max_delay_s
        self._max_drift_s = max_drift_s
        self.reset()

    def reset(self) -> None:
        """Forget everything, for a clock that was set."""
        # Ages that may yet become the least one: each greater than those before it.
        self._ages: collections.deque[tuple[int, int]] = collections.deque()
        self._minima: collections.deque[tuple[int, int]] = collections.deque(maxlen=_WINDOWS_KEPT)
        self._samples = 0
        self._window_ends = 0

    def observe(self, arrival_ns: int, stamp_ns: int) -> None:
        """Take the arrival of one pose and its stamp."""
        age = arrival_ns - stamp_ns
        if self._samples == 0:
            self._window_ends = arrival_ns + self._window_ns
        self._samples += 1
        while self._ages and self._ages[-1][1] >= age:
            self._ages.pop()
        self._ages.append((arrival_ns, age))
        while self._ages[0][0] < arrival_ns - self._window_ns:
            self._ages.popleft()
        if arrival_ns >= self._window_ends:
            self._minima.append((arrival_ns, self._ages[0][1]))
            self._window_ends = arrival_ns + self._window_ns

    @property
    def offset_s(self) -> float:
        """Least age on arrival within the window [s]; NaN before there are enough poses."""
        return self._ages[0][1] * 1e-9 if self._samples >= _MIN_SAMPLES else math.nan

    @property
    def drift_s(self) -> float:
        """Change of the offset over up to six windows [s]; NaN before two windows are full."""
        if len(self._minima) < 2:
            return math.nan
        return (self._minima[-1][1] - self._minima[0][1]) * 1e-9

    @property
    def problem(self) -> str:
        """What is wrong with the clocks, in words; empty if nothing is."""
        offset, drift = self.offset_s, self.drift_s
        if offset < -self._tolerance_s:
            return (
                f"stamps are {-1e3 * offset:.1f} ms ahead of this computer's clock: synchronise "
                "the clocks"
            )
        if offset > self._max_delay_s:
            return (
                f"poses are at least {1e3 * offset:.0f} ms old when they arrive (limit "
                f"{1e3 * self._max_delay_s:g} ms): a slow path, or clocks that are apart"
            )
        if abs(drift) > self._max_drift_s:
            minutes = (self._minima[-1][0] - self._minima[0][0]) / 60e9
            return (
                f"the clocks drift apart by {1e3 * drift / minutes:.1f} ms a minute: synchronise "
                "them"
            )
        return ""
