"""What the nodes take of the processor over a run, so that one sees what a computer has left."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

_PERIOD_S = 1.0
_USER, _SYSTEM = 11, 12
"""Fields of /proc/PID/stat behind the name (proc(5): utime, stime, from 0 at the state)."""


class ProcessorWatch:
    """Reads the processor time of processes, from the end of a warm-up on.

    Imports and the search for each other take more than what follows.
    """

    def __init__(
        self, warm_up_s: float = 5.0, read: Callable[[int], float | None] | None = None
    ) -> None:
        """Start empty.

        Args:
            warm_up_s: what is taken in the first seconds does not count.
            read: processor time of a process [s] by its id, ``None`` if it has ended; by default
                from /proc.
        """
        self._warm_up_s = warm_up_s
        self._read = read or processor_s
        self._next_at: float | None = None
        self._pids: dict[str, int] = {}
        self._first: dict[str, tuple[float, float]] = {}
        self._last: dict[str, tuple[float, float]] = {}

    def look(self, now: float, pids: Mapping[str, int]) -> None:
        """Note once a second what each process has taken so far.

        Args:
            now: monotonic time [s].
            pids: process ids by name.
        """
        if self._next_at is None:
            self._next_at = now + self._warm_up_s
        if now < self._next_at:
            return
        self._next_at = now + _PERIOD_S
        for name, pid in pids.items():
            taken = self._read(pid)
            if taken is None:
                continue
            if self._pids.get(name) != pid:
                # Another process of that name has taken nothing of the one before.
                self._pids[name], self._first[name] = pid, (now, taken)
            self._last[name] = now, taken

    def shares(self) -> dict[str, float] | None:
        """Return by name what each took, 1 being all of one core.

        ``None`` after a run too short to tell.
        """
        found = {}
        for name, (since, before) in self._first.items():
            until, after = self._last[name]
            if until > since:
                found[name] = (after - before) / (until - since)
        return found or None


def processor_s(pid: int) -> float | None:
    """Return the processor time of a process, system calls included [s]; ``None`` if it ended."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return None
    # The name, in parentheses, may contain anything.
    fields = stat.rpartition(")")[2].split()
    return (int(fields[_USER]) + int(fields[_SYSTEM])) / os.sysconf("SC_CLK_TCK")
