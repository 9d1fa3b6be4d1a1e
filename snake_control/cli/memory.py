"""How much memory the nodes take over a run, so that a leak shows before it matters."""

from __future__ import annotations

import statistics
from collections import defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path

_KB = 1024
_PERIOD_S = 1.0
_SAMPLES = 10


class MemoryWatch:
    """Samples the memory that processes have for themselves (RssAnon of proc(5)).

    Imports, message types and buffers fill up in the first seconds; growth counts from then on.
    """

    def __init__(
        self, warm_up_s: float = 20.0, read: Callable[[int], int | None] | None = None
    ) -> None:
        """Start empty.

        Args:
            warm_up_s: samples of the first seconds are not kept.
            read: bytes of a process by its id, ``None`` if it has ended; by default from /proc.
        """
        self._warm_up_s = warm_up_s
        self._read = read or anonymous_bytes
        self._started_at: float | None = None
        self._next_at = 0.0
        self._bytes: dict[str, list[int]] = defaultdict(list)

    def look(self, now: float, pids: Mapping[str, int]) -> None:
        """Take a sample of each process once a second.

        Args:
            now: monotonic time [s].
            pids: process ids by name.
        """
        if self._started_at is None:
            self._started_at = now
            self._next_at = now + self._warm_up_s
        if now < self._next_at:
            return
        self._next_at = now + _PERIOD_S
        for name, pid in pids.items():
            size = self._read(pid)
            if size is not None:
                self._bytes[name].append(size)

    def growth(self) -> dict[str, dict[str, float]] | None:
        """Return memory after the warm-up and growth since, in bytes, by name.

        Both ends are medians over ten samples; ``None`` while there are not two such ends.
        """
        found = {}
        for name, sizes in self._bytes.items():
            if len(sizes) < 2 * _SAMPLES:
                continue
            first = statistics.median(sizes[:_SAMPLES])
            last = statistics.median(sizes[-_SAMPLES:])
            found[name] = {"after_warm_up_bytes": first, "growth_bytes": last - first}
        return found or None


def anonymous_bytes(pid: int) -> int | None:
    """Return the anonymous resident memory of a process, ``None`` if it has ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return None
    for line in lines:
        if line.startswith("RssAnon:"):
            return int(line.split()[1]) * _KB
    return None
