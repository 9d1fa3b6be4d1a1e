"""Judges readings: warnings by threshold, and what changed since the last look."""

from __future__ import annotations

import dataclasses
import enum
import math
from collections.abc import Sequence

from snake_control.ax12.chain import JointReading
from snake_control.ax12.units import error_names


class Level(enum.IntEnum):
    """Severity, with the numbers that ROS diagnostics use."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclasses.dataclass(frozen=True)
class Thresholds:
    """From where on a value is worth a warning."""

    temperature_c: float
    voltage_low_v: float
    voltage_high_v: float
    age_s: float


@dataclasses.dataclass(frozen=True)
class Verdict:
    """Severity and its reasons in words."""

    level: Level
    text: str


def judge(reading: JointReading, thresholds: Thresholds) -> Verdict:
    """Return the worst of everything that is unusual about one servo."""
    if not reading.online:
        return Verdict(Level.ERROR, "lost: it does not answer any more")
    if math.isinf(reading.age):
        return Verdict(Level.STALE, "no reading yet")
    reasons = []
    level = Level.OK
    if reading.error_bits:
        level = Level.ERROR
        reasons.append("reports " + ", ".join(error_names(reading.error_bits)))
    if reading.age > thresholds.age_s:
        level = max(level, Level.WARN)
        reasons.append("its reading is old")
    if reading.temperature >= thresholds.temperature_c:
        level = max(level, Level.WARN)
        reasons.append(f"{reading.temperature:.0f} degC")
    if not thresholds.voltage_low_v <= reading.voltage <= thresholds.voltage_high_v:
        level = max(level, Level.WARN)
        reasons.append(f"{reading.voltage:.1f} V")
    return Verdict(level, "; ".join(reasons) or "OK")


class HealthLog:
    """Turns verdicts into log lines: one when something changes, none while it stays.

    Values near a threshold would change at every look, so numbers do not count as a change.
    """

    def __init__(self) -> None:
        self._levels: dict[str, tuple[Level, int]] = {}

    def changes(
        self, readings: Sequence[JointReading], verdicts: Sequence[Verdict]
    ) -> list[tuple[Level, str]]:
        """Return level and text of everything new since the last call."""
        lines = []
        for reading, verdict in zip(readings, verdicts, strict=True):
            state = (verdict.level, reading.error_bits)
            before = self._levels.get(reading.joint.name, (Level.OK, 0))
            self._levels[reading.joint.name] = state
            if state != before:
                lines.append((verdict.level, f"{reading.joint}: {verdict.text}"))
        return lines
