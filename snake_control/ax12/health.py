"""Judges readings: warnings by threshold, and what changed since the last look."""

from __future__ import annotations

import dataclasses
import enum
import math
from collections.abc import Iterator, Sequence

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
    """Severity and its reasons in words.

    Attributes:
        kinds: the reasons without their numbers.
    """

    level: Level
    text: str
    kinds: frozenset[str] = frozenset()


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
        return Verdict(Level.ERROR, "lost: it does not answer any more", frozenset({"lost"}))
    if math.isinf(reading.age):
        return Verdict(Level.STALE, "no reading yet", frozenset({"no reading"}))
    errors = dict(_errors(reading))
    warnings = dict(_warnings(reading, thresholds, expected_torque))
    level = Level.ERROR if errors else Level.WARN if warnings else Level.OK
    text = "; ".join([*errors.values(), *warnings.values()]) or "OK"
    return Verdict(level, text, frozenset({*errors, *warnings}))


def _errors(reading: JointReading) -> Iterator[tuple[str, str]]:
    """Yield kind and text of each."""
    if reading.error_bits:
        text = "reports " + ", ".join(error_names(reading.error_bits))
        yield text, text
    if reading.shut_down:
        yield "shut down", "shut down: its torque limit is 0 after an alarm"


def _warnings(
    reading: JointReading, thresholds: Thresholds, expected_torque: float
) -> Iterator[tuple[str, str]]:
    """Yield kind and text of each."""
    if reading.age > thresholds.age_s:
        yield "old", "its reading is old"
    if reading.temperature >= thresholds.temperature_c:
        yield "hot", f"{reading.temperature:.0f} degC"
    # NaN is no voltage to warn of.
    if reading.voltage < thresholds.voltage_low_v or reading.voltage > thresholds.voltage_high_v:
        yield "voltage", f"{reading.voltage:.1f} V"
    if abs(reading.load) >= thresholds.load:
        yield "load", f"load {100 * abs(reading.load):.0f} %"
    if reading.doubt:
        yield "does not follow", f"does not follow: {reading.doubt}"
    if reading.error_rate >= thresholds.communication_error_rate:
        share = 100 * reading.error_rate
        yield "replies", f"{share:.0f} % of its replies fail at the first try"
    if abs(expected_torque) > thresholds.torque_n_m:
        yield (
            "torque",
            f"carries {abs(expected_torque):.2f} N m, should carry {thresholds.torque_n_m:g} N m "
            "for long",
        )


class HealthLog:
    """Turns verdicts into log lines: one when something changes, none while it stays.

    Values near a threshold would change at every look, so numbers do not count as a change.
    """

    def __init__(self) -> None:
        self._known: dict[str, tuple[Level, frozenset[str]]] = {}

    def changes(
        self, readings: Sequence[JointReading], verdicts: Sequence[Verdict]
    ) -> list[tuple[Level, str]]:
        """Return level and text of everything new since the last call."""
        lines = []
        for reading, verdict in zip(readings, verdicts, strict=True):
            state = (verdict.level, verdict.kinds)
            before = self._known.get(reading.joint.name, (Level.OK, frozenset()))
            self._known[reading.joint.name] = state
            if state != before:
                lines.append((verdict.level, f"{reading.joint}: {verdict.text}"))
        return lines
