"""The kinds of faults that the mock can be told to have, as data; docs/faults.md is this table."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Mapping


class Concerns(enum.Enum):
    """What a fault is about."""

    REPLIES = "replies"
    """Single replies of servos: it takes ids and a probability."""
    SERVOS = "servos"
    """Servos: it takes ids."""
    LINE = "line"
    """The whole line: it takes no ids."""
    POSES = "poses"
    """Poses of the motion capture (``pose_faults``): it takes a probability."""


@dataclasses.dataclass(frozen=True)
class Kind:
    """One kind of fault.

    Attributes:
        name: as in services and scenario files.
        concerns: what it takes beside its duration.
        does: what happens, one sentence.
        value: meaning and unit of its strength; empty if it has none.
        default: strength if none is given.
        low, high: allowed strengths.
    """

    name: str
    concerns: Concerns
    does: str
    value: str = ""
    default: float = 0.0
    low: float = 0.0
    high: float = 0.0


_KINDS = (
    Kind(
        "no_reply",
        Concerns.REPLIES,
        "neither hears instructions nor answers: a loose signal wire; it keeps its power and goes "
        "on with what it does",
    ),
    Kind("late_reply", Concerns.REPLIES, "answers late", "delay [s]", 0.03, 1e-4, 10.0),
    Kind("corrupt_checksum", Concerns.REPLIES, "one bit of the reply is wrong"),
    Kind(
        "truncated_reply",
        Concerns.REPLIES,
        "the end of the reply is missing",
        "missing bytes",
        3.0,
        1.0,
        250.0,
    ),
    Kind(
        "extra_bytes",
        Concerns.REPLIES,
        "noise before and behind the reply",
        "bytes on each side",
        4.0,
        1.0,
        250.0,
    ),
    Kind(
        "wrong_model", Concerns.SERVOS, "says to be another model", "model number", 300.0, 0, 65535
    ),
    Kind(
        "stuck_position",
        Concerns.SERVOS,
        "its readings of position and speed stay as they are; the shaft does not",
    ),
    Kind("blocked_shaft", Concerns.SERVOS, "something holds the shaft: it does not turn"),
    Kind(
        "overload",
        Concerns.SERVOS,
        "something holds the shaft and pulls at it, harder than the servo: after two seconds it "
        "shuts down",
        "torque [N m]",
        3.0,
        0.01,
        100.0,
    ),
    Kind("overheat", Concerns.SERVOS, "has this temperature inside", "[degC]", 85.0, 26.0, 150.0),
    Kind("under_voltage", Concerns.SERVOS, "gets this voltage", "[V]", 5.5, 0.1, 25.5),
    Kind(
        "power_cycle",
        Concerns.SERVOS,
        "has no power for the duration (0: until cleared): shaft free, RAM lost",
    ),
    Kind(
        "baud_change",
        Concerns.SERVOS,
        "listens at another rate",
        "[bit/s]",
        57600.0,
        7844.0,
        1_000_000.0,
    ),
    Kind("duplicate_id", Concerns.SERVOS, "a second servo with the same id is on the line"),
    Kind("echo", Concerns.LINE, "the adapter returns what it sends"),
    Kind("unplug", Concerns.LINE, "the adapter is pulled out; at the end it is plugged in again"),
    Kind(
        "frozen_bus",
        Concerns.LINE,
        "nothing passes the line, in either direction; servos go on with what they do",
    ),
)

KINDS: Mapping[str, Kind] = {kind.name: kind for kind in _KINDS}
