"""Trajectories as people write them: YAML (segments) and CSV (poses)."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from snake_control.config.loader import refuse_unknown
from snake_control.config.parameter import parameters
from snake_control.config.yaml_file import parse_yaml, read_text
from snake_control.control.head_filter import QUATERNION_TOLERANCE
from snake_control.errors import ConfigError, ConfigFileError
from snake_control.model.rotation import rpy_from_quaternion
from snake_control.trajectory.plan import Course, timed_course
from snake_control.trajectory.segments import SEGMENTS, Line, Poses, Segment, Settings

MOST_POSES = 20000
"""More than an hour at five poses a second."""

_POSITION = ("x", "y", "z")
_RPY = ("roll", "pitch", "yaw")
_QUATERNION = ("qx", "qy", "qz", "qw")
_COLUMNS = "give x,y,z and roll,pitch,yaw or qx,qy,qz,qw, and t if there are times"


def read_course(path: str | Path) -> Course:
    """Return the trajectory of a file: CSV if its name ends so, YAML otherwise.

    Raises:
        ConfigFileError: names the file, and the segment or line that is wrong.
    """
    return parse_course(read_text(path), str(path), Path(path).suffix.lower() == ".csv")


def parse_course(text: str, name: str, is_csv: bool | None = None, frame: str = "world") -> Course:
    """Return the trajectory that a text describes.

    Args:
        text: CSV or YAML.
        name: where it is from, for errors.
        is_csv: which of both; ``None`` to tell it by its first line.
        frame: what poses of a CSV are relative to (``Settings.frame``).

    Raises:
        ConfigFileError: names the segment or line that is wrong.
    """
    if is_csv is None:
        lines = [line for line in text.splitlines() if line.strip() and line.strip()[0] != "#"]
        is_csv = bool(lines) and set(_POSITION) <= {c.strip() for c in lines[0].split(",")}
    try:
        return _table(text, frame) if is_csv else _segments(parse_yaml(text, name))
    except ConfigError as error:
        raise ConfigFileError(name, str(error)) from error


def _segments(tree: Any) -> Course:
    if isinstance(tree, list):
        tree = {"segments": tree}
    if not isinstance(tree, Mapping) or not isinstance(tree.get("segments"), list):
        raise ConfigError("segments", None, "give a list of segments, such as - line: {by: ...}")
    if not tree["segments"]:
        raise ConfigError("segments", [], "give one or more")
    said = {key: value for key, value in tree.items() if key != "segments"}
    settings = Settings(**_values(said, Settings, ("segments",)))
    parts = []
    for i, entry in enumerate(tree["segments"], start=1):
        if isinstance(entry, str):
            entry = {entry: None}
        if not isinstance(entry, Mapping) or len(entry) != 1:
            raise ConfigError(
                f"segment {i}", entry, f"give one of {', '.join(SEGMENTS)}, with its fields"
            )
        [(kind, fields)] = entry.items()
        where = f"segment {i} ({kind})"
        if kind not in SEGMENTS:
            raise ConfigError(f"segment {i}", kind, f"allowed: {', '.join(SEGMENTS)}")
        try:
            parts.append((where, _segment(SEGMENTS[kind], {} if fields is None else fields)))
        except ConfigError as error:
            raise ConfigError(f"{where}: {error.field}", error.value, error.allowed) from error
    return Course(tuple(part for _, part in parts), settings, tuple(name for name, _ in parts))


def _segment(cls: type[Segment], fields: Any) -> Segment:
    own = tuple(parameters(cls))
    if not isinstance(fields, Mapping):
        raise ConfigError("fields", fields, f"give a map of {', '.join(own) or 'no fields'}")
    more: dict[str, Any] = {}
    said = dict(fields)
    if cls is Poses:
        more["poses"] = _rows(said.pop("poses", None))
    settings_of = {key: said.pop(key) for key in tuple(said) if key in parameters(Settings)}
    values = _values(said, cls, (*parameters(Settings), *(["poses"] if cls is Poses else [])))
    for name in own:
        is_needed = parameters(cls)[name].default is None and not _may_be_none(cls, name)
        if is_needed and name not in values:
            raise ConfigError(name, None, f"give it: {parameters(cls)[name].doc}")
    return cls(settings=Settings(**_values(settings_of, Settings, own)), **values, **more)


def _may_be_none(cls: type[Segment], name: str) -> bool:
    return "None" in str(cls.__annotations__[name])


def _values(said: Mapping[Any, Any], group: type, others: tuple[str, ...]) -> dict[str, Any]:
    known = parameters(group)
    for key, value in said.items():
        refuse_unknown(str(key), value, (*known, *others))
    return {key: known[key].parse(key, value) for key, value in said.items()}


def _rows(poses: Any) -> tuple[tuple[float, ...], ...]:
    if not isinstance(poses, list) or not poses:
        raise ConfigError("poses", poses, "give a list of poses, 3 or 6 numbers each")
    if len(poses) > MOST_POSES:
        raise ConfigError("poses", f"{len(poses)} poses", f"at most {MOST_POSES}")
    number = parameters(Line)["by"]
    return tuple(number.parse(f"poses[{i}]", pose) for i, pose in enumerate(poses))


def _table(text: str, frame: str) -> Course:
    rows = [
        (number, [cell.strip() for cell in row])
        for number, row in _numbered(text)
        if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#")
    ]
    if not rows:
        raise ConfigError("line 1", None, f"it has no header; {_COLUMNS}")
    (line, header), rows = rows[0], rows[1:]
    rotation = _QUATERNION if "qw" in header else _RPY
    wanted = {*_POSITION, *rotation}
    if set(header) - {"t"} != wanted or len(set(header)) != len(header):
        raise ConfigError(f"line {line}", ",".join(header), _COLUMNS)
    if not rows:
        raise ConfigError(f"line {line}", ",".join(header), "no poses follow; give one or more")
    if len(rows) > MOST_POSES:
        raise ConfigError("lines", len(rows), f"at most {MOST_POSES} poses")
    times: list[float] = []
    poses: list[tuple[float, ...]] = []
    names: list[str] = []
    for line, row in rows:
        values = _numbers(line, header, row)
        position = [values[c] for c in _POSITION]
        poses.append((*position, *_attitude(line, [values[c] for c in rotation])))
        names.append(f"line {line}")
        if "t" in values:
            if times and values["t"] <= times[-1]:
                raise ConfigError(f"line {line}: t", values["t"], f"more than {times[-1]:g} before")
            times.append(values["t"])
    return timed_course(poses, times, names, frame)


def _numbered(text: str) -> list[tuple[int, list[str]]]:
    reader = csv.reader(io.StringIO(text))
    found = []
    try:
        for row in reader:
            found.append((reader.line_num, row))
    except csv.Error as error:
        raise ConfigError(f"line {reader.line_num}", None, f"no CSV: {error}") from error
    return found


def _numbers(line: int, header: list[str], row: list[str]) -> dict[str, float]:
    if len(row) != len(header):
        raise ConfigError(
            f"line {line}", ",".join(row), f"give {len(header)} values: {','.join(header)}"
        )
    values = {}
    for column, cell in zip(header, row, strict=True):
        try:
            values[column] = float(cell)
        except ValueError:
            raise ConfigError(f"line {line}: {column}", cell, "give a number") from None
        if not math.isfinite(values[column]):
            raise ConfigError(f"line {line}: {column}", cell, "give a finite number")
    return values


def _attitude(line: int, values: list[float]) -> list[float]:
    if len(values) == 3:
        return values
    length = float(np.linalg.norm(values))
    if abs(length - 1.0) > QUATERNION_TOLERANCE:
        raise ConfigError(
            f"line {line}: qx,qy,qz,qw",
            values,
            f"a quaternion of length 1; this one has {length:.3g}",
        )
    return [float(angle) for angle in rpy_from_quaternion(values)]
