"""Absolute deadlines of a periodic loop, so that it neither drifts nor catches up in bursts."""

from __future__ import annotations

_RATE_SMOOTHING = 0.05


class Schedule:
    """When the next cycle is due, and how many came late.

    Attributes:
        cycles, late_cycles: since ``reset_counts``; late is more than half a period.
        rate: cycles per second, low-pass filtered; 0 before the second cycle.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._due = 0.0
        self._begun: float | None = None
        self.cycles = 0
        self.late_cycles = 0
        self.rate = 0.0

    def start(self, now: float) -> None:
        """Let a cycle be due now."""
        self._due = now
        self._begun = None

    def reset_counts(self) -> None:
        """Count from 0."""
        self.cycles = self.late_cycles = 0

    def begin(self, now: float) -> None:
        """Note the start of a cycle."""
        self.cycles += 1
        if now - self._due > 0.5 * self._period:
            self.late_cycles += 1
        if self._begun is not None and now > self._begun:
            rate = 1.0 / (now - self._begun)
            self.rate += (rate - self.rate) * (_RATE_SMOOTHING if self.rate else 1.0)
        self._begun = now

    def end(self, now: float) -> float:
        """Return how long to sleep until the next cycle [s]; periods missed are left out."""
        self._due += self._period
        if now >= self._due + self._period:
            self._due += self._period * ((now - self._due) // self._period)
        return max(0.0, self._due - now)
