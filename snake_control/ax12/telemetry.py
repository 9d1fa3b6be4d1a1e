"""Which servo is read next, and how much of it: what must be fresh first, the rest in turn.

Position, speed and load of every servo are wanted each cycle (6 bytes). Voltage and temperature
change slowly: a few servos a cycle are read 2 bytes further, the one whose values are oldest first,
so that each has its turn within ``slow_period``. Where a cycle's time does not suffice for all
servos, the one that was asked longest ago is next; one that does not answer, and takes the time of
several, so costs the others a turn and never two in a row.

A servo that counts as lost is asked once in ``lost_period``, only to see whether it is back.

Settings in RAM are looked at in turn, one servo in ``check_period``: in time that the reads leave
over, but when they leave none for ``_CHECK_LATE`` periods, before them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from snake_control.ax12 import control_table as ct

SHORT_LENGTH = ct.PRESENT_VOLTAGE.address - ct.PRESENT_POSITION.address
FULL_LENGTH = ct.FEEDBACK_BLOCK[1]


_CHECK_LATE = 2.5


class Request(NamedTuple):
    """What to read from Present Position on: of which servo (its index), how many bytes."""

    servo: int
    length: int


class TelemetrySchedule:
    """The order of reads. Times are monotonic [s]."""

    def __init__(
        self,
        count: int,
        period: float,
        slow_period: float = 0.5,
        lost_period: float = 0.5,
        check_period: float = 0.1,
    ) -> None:
        """Begin with nobody asked.

        Args:
            count: servos.
            period: nominal time between two cycles [s].
            slow_period: within which each servo's voltage and temperature are read [s].
            lost_period: between two questions to a lost servo [s].
            check_period: between two looks at the settings of servos [s].
        """
        self._full_per_cycle = min(count, math.ceil(count * period / slow_period))
        self._lost_period = lost_period
        self._asked_at = [-math.inf] * count
        self._slow_at = [-math.inf] * count
        self._check_period = check_period
        self._checked = 0
        self._checked_at: float | None = None

    def cycle(self, lost: frozenset[int], now: float) -> list[Request]:
        """Return what to read in the cycle that begins now, most urgent first.

        Args:
            lost: indices of servos that count as lost.
            now: the time.
        """
        chosen = [
            i
            for i, asked_at in enumerate(self._asked_at)
            if i not in lost or now - asked_at >= self._lost_period
        ]
        slowest = sorted(chosen, key=self._slow_at.__getitem__)
        full = set(slowest[: self._full_per_cycle])
        full |= {i for i in chosen if self._slow_at[i] == -math.inf}
        # Sorted is stable: servos that were asked in one cycle keep the order of the joints.
        chosen.sort(key=self._asked_at.__getitem__)
        return [Request(i, FULL_LENGTH if i in full else SHORT_LENGTH) for i in chosen]

    def asked(self, request: Request, now: float, answered: bool) -> None:
        """Take note that a servo was asked in the cycle that began at ``now``."""
        self._asked_at[request.servo] = now
        if answered and request.length == FULL_LENGTH:
            self._slow_at[request.servo] = now

    def check(self, lost: frozenset[int], now: float, spare: bool) -> int | None:
        """Return whose settings to look at now, each in turn; ``None`` if nobody's.

        Args:
            lost: indices of servos that count as lost.
            now: the time.
            spare: whether the cycle's reads are done; before them only what is late is returned.
        """
        if self._checked_at is None:
            self._checked_at = now
        due = self._check_period if spare else _CHECK_LATE * self._check_period
        if now - self._checked_at < due:
            return None
        self._checked_at = now
        count = len(self._asked_at)
        for step in range(1, count + 1):
            index = (self._checked + step) % count
            if index not in lost:
                self._checked = index
                return index
        return None
