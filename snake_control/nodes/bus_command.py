"""The newest velocity command, and whether it may be executed."""

from __future__ import annotations

import dataclasses
import math
import threading
from collections.abc import Sequence

_ZERO_RAD_S = 1e-6

_PAUSE_S = 0.5
"""Silence after which a command counts as a new start; a busy host makes shorter ones.

For as long after a stop zero commands do not count: while servos are armed nobody reads them, and
a controller without joint states commands zero.
"""

_REFUSAL_SHOWN_S = 1.0

_SIGN_OF_LIFE_S = 0.5
"""Without one for so long whoever takes commands did not run, and silence means nothing."""


@dataclasses.dataclass(frozen=True)
class _Command:
    velocities: tuple[float, ...]
    computed_at: float
    stamp_ns: int
    taken_at: float


@dataclasses.dataclass(frozen=True)
class Followed:
    """The command that a cycle follows.

    Attributes:
        stamp_ns: of its message [ns].
        waited: time from its arrival to the cycle's begin [s].
    """

    stamp_ns: int
    waited: float


class CommandBuffer:
    """Buffer of one command; any thread may write or read. Times are monotonic [s].

    Attributes:
        followed: what ``newest`` gave last; ``None`` if that was to hold.
    """

    def __init__(self, timeout: float) -> None:
        """Start empty; a command is executed until ``timeout`` seconds after it was computed."""
        self._timeout = timeout
        self._command: _Command | None = None
        self.followed: Followed | None = None
        self._waiting_since: float | None = None
        self._heard_at = -math.inf
        self._refused: tuple[float, str] = (-math.inf, "")
        self._alive_at = -math.inf
        self._lock = threading.Lock()

    def alive(self, now: float) -> None:
        """Note that commands are being taken; to be called several times a second.

        Silence while nobody listened is no pause of the one who commands.
        """
        with self._lock:
            if not self._listening(now):
                self._heard_at = now
            self._alive_at = now

    def _listening(self, now: float) -> bool:
        return self._alive_at == -math.inf or now - self._alive_at <= _SIGN_OF_LIFE_S

    def take(self, velocities: Sequence[float], age: float, now: float, stamp_ns: int = 0) -> None:
        """Take joint velocities [rad/s] that were computed ``age`` seconds ago."""
        with self._lock:
            silent = now - self._heard_at > max(_PAUSE_S, self._timeout)
            paused = silent and self._listening(now)
            self._heard_at = now
            since = self._waiting_since
            if since is not None and not paused:
                zero = all(abs(v) <= _ZERO_RAD_S for v in velocities)
                if not zero or now - since <= _PAUSE_S:
                    return
            self._waiting_since = None
            self._command = _Command(tuple(velocities), now - age, stamp_ns, now)

    def refuse(self, why: str, now: float) -> None:
        """Say in the coming texts that a command was not taken."""
        self._refused = (now, why)

    def clear(self) -> None:
        """Forget the command."""
        with self._lock:
            self._command = None

    def wait_for_zero(self, asked_at: float, now: float) -> None:
        """Take no command before one that is zero, or before a pause from now on.

        For the end of a stop: whoever went on asking for motion all the time must not get it all
        at once. If nobody was asking when the end of the stop was, the next command is a new start.

        Args:
            asked_at: when the end of the stop was asked for; commands may not be read since.
            now: when it was carried out.
        """
        with self._lock:
            self._command = None
            if asked_at - self._heard_at <= _PAUSE_S:
                self._waiting_since = self._heard_at = now

    def wait_for_start(self, now: float) -> None:
        """Take no command that somebody was sending already when the driver started.

        He may have asked for it all the time, of a driver that ran before; a pause or a zero shows
        that he means it.
        """
        with self._lock:
            self._command = None
            self._waiting_since = self._heard_at = now

    def newest(self, now: float) -> tuple[tuple[float, ...] | None, str]:
        """Return the velocities to execute, ``None`` to hold, and why."""
        with self._lock:
            command, waiting = self._command, self._waiting_since is not None
            heard_at = self._heard_at
        self.followed = None
        if waiting and now - heard_at <= self._timeout:
            return None, "holding: waiting for a zero command"
        if command is None:
            return None, "holding: no command yet"
        if now - command.computed_at > self._timeout:
            return None, f"holding: no command for {self._timeout:.2f} s"
        self.followed = Followed(command.stamp_ns, now - command.taken_at)
        return command.velocities, "moving"

    def refusal(self, now: float) -> str:
        """Return why a command was not taken a moment ago, empty if none was refused."""
        refused_at, why = self._refused
        return f"; command ignored: {why}" if now - refused_at < _REFUSAL_SHOWN_S else ""

    def age(self, now: float) -> float:
        """Return the command's age [s], infinite without one."""
        command = self._command
        return math.inf if command is None else max(0.0, now - command.computed_at)
