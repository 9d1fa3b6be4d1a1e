"""Scenario files: faults with the times at which they begin, as YAML.

    faults:
      - {at: 2.0, fault: no_reply, ids: [3], duration: 0.5}
      - {at: 5.0, fault: unplug, duration: 1.0}

Times count from the start of the servos [s]. Missing fields have the defaults of ``Fault``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from snake_control.errors import SnakeError
from snake_control.mock.faults import Fault, FaultError

_FIELDS = ("at", "fault", "ids", "duration", "value", "probability")


class ScenarioError(SnakeError, ValueError):
    """A scenario file that cannot be used.

    Attributes:
        path: the file.
    """

    def __init__(self, path: str | Path, reason: str) -> None:
        self.path = str(path)
        super().__init__(f"{path}: {reason}")


def load_scenario(path: str | Path) -> list[tuple[float, Fault]]:
    """Read a scenario file; return times [s] and faults in the order of the file.

    Raises:
        ScenarioError: unreadable, not of this form, or a fault that there is not; names the entry.
    """
    try:
        content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise ScenarioError(path, error.strerror or str(error)) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ScenarioError(path, f"no YAML: {error}") from error
    if not isinstance(content, Mapping) or set(content) != {"faults"}:
        raise ScenarioError(path, "give one key, faults, with a list")
    entries = content["faults"]
    if not isinstance(entries, list):
        raise ScenarioError(path, f"faults = {entries!r}: give a list")
    return [_entry(path, i, entry) for i, entry in enumerate(entries)]


def _entry(path: str | Path, index: int, entry: object) -> tuple[float, Fault]:
    where = f"faults[{index}]"
    if not isinstance(entry, Mapping):
        raise ScenarioError(path, f"{where} = {entry!r}: give {', '.join(_FIELDS)}")
    for name in entry:
        if name not in _FIELDS:
            raise ScenarioError(path, f"{where}.{name}: known are {', '.join(_FIELDS)}")
    for name in ("at", "fault"):
        if name not in entry:
            raise ScenarioError(path, f"{where}.{name} is missing")
    try:
        at = _number("at", entry["at"])
        if at < 0:
            raise FaultError("at", at, "give 0 or more")
        value = entry.get("value")
        return at, Fault(
            kind=_text("fault", entry["fault"]),
            ids=_ids(entry.get("ids", [])),
            duration_s=_number("duration", entry.get("duration", 0.0)),
            value=None if value is None else _number("value", value),
            probability=_number("probability", entry.get("probability", 1.0)),
        )
    except FaultError as error:
        raise ScenarioError(path, f"{where}.{error}") from error


def _number(field: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise FaultError(field, value, "give a finite number")
    return float(value)


def _text(field: str, value: Any) -> str:
    if not isinstance(value, str):
        raise FaultError(field, value, "give a text")
    return value


def _ids(value: Any) -> tuple[int, ...]:
    good = isinstance(value, list) and all(type(i) is int and 0 <= i <= 253 for i in value)
    if not good:
        raise FaultError("ids", value, "give a list of ids, 0 to 253")
    return tuple(value)
