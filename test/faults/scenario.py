"""The scenarios of the fault campaign: what is done to the robot, and what must become of it."""

from __future__ import annotations

import dataclasses
import enum
from pathlib import Path
from typing import Any

import yaml

FILE = Path(__file__).parent / "scenarios.yaml"


class Expect(enum.Enum):
    """What the robot must do."""

    GOES_ON = "goes_on"
    """Nothing but a report: too little happened to stop a robot."""
    RESTS = "rests"
    """Nobody commands it any more: it comes to rest within its time, says why, and moves again when
    it is commanded again."""
    STOPS = "stops"
    """Comes to rest within its time, says why, and moves again only after what `after` says."""
    SAFE = "safe"
    """May go on or stop; in both cases within bounds and with a report."""
    REFUSES = "refuses"
    """The driver does not start: one message, exit code 1, nothing moves."""
    ENDS = "ends"
    """A process is gone; joints come to rest within the look-ahead bound."""


class After(enum.Enum):
    """What brings the motion back."""

    ITSELF = "itself"
    RECOVER = "recover"
    RESTART = "restart"


@dataclasses.dataclass(frozen=True)
class Injection:
    """One fault, as the mock's service takes it."""

    fault: str
    ids: tuple[int, ...] = ()
    duration: float = 0.0
    value: float = 0.0
    probability: float = 1.0

    def __str__(self) -> str:
        whom = f" {','.join(map(str, self.ids))}" if self.ids else ""
        time = f" for {self.duration:g} s" if self.duration else ""
        strength = f" {self.value:g}" if self.value else ""
        share = f" {100 * self.probability:g} %" if self.probability < 1 else ""
        return f"{self.fault}{strength}{whom}{share}{time}"


@dataclasses.dataclass(frozen=True)
class Scenario:
    """One named scenario.

    Attributes:
        name: unique.
        situation: ``standstill``, ``motion`` (joints commanded to and fro), ``case_3`` (the whole
            graph follows Case 3), ``start`` (no driver yet).
        inject: faults that begin together.
        process, signal: what is done to which process instead: ``KILL``, ``STOP``, ``TERM``,
            ``SILENCE`` or ``NAN`` (of the commander); a ``STOP`` is undone after ``duration``.
        duration: of a ``STOP`` or of the commander's lapse [s].
        expect: what must happen.
        timeout: whose time-out the stop has (``check.timeouts``).
        reported: regular expression that a text of the driver's state must match.
        after: what brings motion back.
        faulty: ids of servos that no command reaches: the look-ahead bound holds for them.
        limp: ids of servos without torque: gravity moves them, only their range counts.
        line_dead: no command reaches any servo.
        watch: how long to look [s].
        short: whether it belongs to the shortened campaign.
        emergency: an emergency stop is latched before.
        recover_refused: ``~/recover`` must be refused while the fault lasts.
    """

    name: str
    situation: str
    expect: Expect
    inject: tuple[Injection, ...] = ()
    process: str = ""
    signal: str = ""
    duration: float = 0.0
    timeout: str = ""
    reported: str = ""
    after: After = After.ITSELF
    faulty: tuple[int, ...] = ()
    limp: tuple[int, ...] = ()
    line_dead: bool = False
    watch: float = 1.5
    short: bool = False
    emergency: bool = False
    recover_refused: bool = False

    @property
    def what(self) -> str:
        """What is done, in words."""
        if self.inject:
            return " and ".join(map(str, self.inject))
        time = f" for {self.duration:g} s" if self.duration else ""
        return f"{self.signal} {self.process}{time}"


def load(path: Path = FILE) -> list[Scenario]:
    """Read scenarios.

    Raises:
        ValueError: a field that there is not, a value that is not allowed, or a name used twice.
    """
    scenarios = [_scenario(entry) for entry in yaml.safe_load(path.read_text())["scenarios"]]
    names = [scenario.name for scenario in scenarios]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise ValueError(f"names used twice: {sorted(twice)}")
    return scenarios


def _scenario(entry: dict[str, Any]) -> Scenario:
    known = {field.name for field in dataclasses.fields(Scenario)}
    unknown = set(entry) - known
    if unknown:
        raise ValueError(f"{entry.get('name')}: unknown fields {sorted(unknown)}")
    values = dict(entry)
    values["expect"] = Expect(entry["expect"])
    values["after"] = After(entry.get("after", "itself"))
    values["inject"] = tuple(
        Injection(**{k: tuple(v) if k == "ids" else v for k, v in fault.items()})
        for fault in entry.get("inject", [])
    )
    for name in ("faulty", "limp"):
        values[name] = tuple(entry.get(name, ()))
    if entry["situation"] not in ("standstill", "motion", "case_3", "start"):
        raise ValueError(f"{entry['name']}: situation = {entry['situation']!r}")
    return Scenario(**values)
