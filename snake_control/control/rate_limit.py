"""Lets through what comes as often as allowed, on average."""

from __future__ import annotations

_AT_ONCE = 2.0
_S_PER_NS = 1e-9


class RateLimit:
    """A token bucket of two: what comes at about the rate loses nothing by uneven intervals."""

    def __init__(self, rate_hz: float) -> None:
        """Start full.

        Args:
            rate_hz: how many get through in a second, in the long run.
        """
        self._rate_hz = rate_hz
        self.reset()

    def reset(self) -> None:
        """Forget the time: the clock was set."""
        self._left = _AT_ONCE
        self._time_ns: int | None = None

    def allows(self, time_ns: int) -> bool:
        """Return whether what comes at this time [ns] gets through, and count it if so.

        What is older than what came before is allowed no more for it.
        """
        if self._time_ns is not None and time_ns > self._time_ns:
            more = (time_ns - self._time_ns) * _S_PER_NS * self._rate_hz
            self._left = min(_AT_ONCE, self._left + more)
        self._time_ns = time_ns if self._time_ns is None else max(time_ns, self._time_ns)
        # A rounding error must not cost an event.
        if self._left < 1.0 - 1e-6:
            return False
        self._left -= 1.0
        return True
