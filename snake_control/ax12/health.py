"""Judges readings: warnings by threshold, and what changed since the last look."""

from __future__ import annotations

import dataclasses
import enum
import math
from collections.abc import Sequence

from snake_control.ax12.driven_joint import JointReading
from snake_control.ax12.units import error_names


class Level(enum.IntEnum):
    """Severity, with the numbers that ROS diagnostics use."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclasses.dataclass(frozen=True)
class Thresholds:
    """From where on a value is worth a warning.

    Attributes:
        temperature_c, voltage_low_v, voltage_high_v: [degC], [V].
        age_s: of the reading [s].
        communication_error_rate: share of requests without a good first reply.
        load: fraction of the maximum output.
        torque_n_m: what a servo should carry for long [N m].
    """

    temperature_c: float
    voltage_low_v: float
    voltage_high_v: float
    age_s: float
    communication_error_rate: float = 0.05
    load: float = 0.9
    torque_n_m: float = 0.3


@dataclasses.dataclass(frozen=True)
class Verdict:
    """Severity and its reasons in words."""

    level: Level
    text: str


def judge(
    reading: JointReading, thresholds: Thresholds, expected_torque: float = math.nan
) -> Verdict:
    """Return the worst of everything that is unusual about one servo.

    Args:
        reading: the servo as last seen.
        thresholds: what is usual.
        expected_torque: what gravity asks of the joint by the model [N m]; NaN if unknown.
    """
    if not reading.online:
        return Verdict(Level.ERROR, "lost: it does not answer any more")
    if math.isinf(reading.age):
        return Verdict(Level.STALE, "no reading yet")
    reasons = []
    level = Level.OK
    if reading.error_bits:
        level = Level.ERROR
        reasons.append("reports " + ", ".join(error_names(reading.error_bits)))
    if reading.shut_down:
        level = Level.ERROR
        reasons.append("shut down: its torque limit is 0 after an alarm")
    warnings = []
    if reading.age > thresholds.age_s:
        warnings.append("its reading is old")
    if reading.temperature >= thresholds.temperature_c:
        warnings.append(f"{reading.temperature:.0f} degC")
    # NaN is no voltage to warn of.
    if reading.voltage < thresholds.voltage_low_v or reading.voltage > thresholds.voltage_high_v:
        warnings.append(f"{reading.voltage:.1f} V")
    if abs(reading.load) >= thresholds.load:
        warnings.append(f"load {100 * abs(reading.load):.0f} %")
    if reading.doubt:
        warnings.append(f"does not follow: {reading.doubt}")
    if reading.error_rate >= thresholds.communication_error_rate:
        warnings.append(f"{100 * reading.error_rate:.0f} % of its replies fail at the first try")
    if abs(expected_torque) > thresholds.torque_n_m:
        warnings.append(
            f"carries {abs(expected_torque):.2f} N m, should carry {thresholds.torque_n_m:g} N m "
            "for long"
        )
    if warnings:
        level = max(level, Level.WARN)
    return Verdict(level, "; ".join(reasons + warnings) or "OK")


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
