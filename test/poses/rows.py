"""What is done to the motion capture, and what must become of the robot."""

from __future__ import annotations

import dataclasses

from snake_control.mock.pose_faults import PoseFault


@dataclasses.dataclass(frozen=True)
class Row:
    """One fault, while the head follows its line.

    Attributes:
        name: unique.
        fault: as the mock takes it.
        stops: whether the robot must come to rest within its time (``False``: it must not stop;
            ``None``: it may).
        rests: whether it must stay at rest until the fault is over.
        says: part of a text of ``head/status`` that must be heard; empty for none.
        back_within_s: how long after the fault the reference must be followed again.
        short: whether it belongs to the shortened campaign.
    """

    name: str
    fault: PoseFault
    stops: bool | None
    rests: bool = False
    says: str = ""
    back_within_s: float = 0.5
    short: bool = False


ROWS = (
    Row(
        "dropout 0.1 s",
        PoseFault("pose_dropout", 0.1),
        False,
        says="the joints say where the head is",
    ),
    Row(
        "dropout 0.2 s",
        PoseFault("pose_dropout", 0.2),
        False,
        says="the joints say where the head is",
        short=True,
    ),
    Row("dropout 0.5 s", PoseFault("pose_dropout", 0.5), True, True, "s old", short=True),
    Row("dropout 2 s", PoseFault("pose_dropout", 2.0), True, True, "s old"),
    Row("one outlier of 0.2 m", PoseFault("pose_jump", 0.01, 0.2), False),
    Row(
        "every tenth pose 0.2 m off",
        PoseFault("pose_jump", 2.0, 0.2, 0.1),
        False,
        says="further than the head can have moved",
        short=True,
    ),
    Row(
        "step of 0.1 m for 2 s",
        PoseFault("pose_jump", 2.0, 0.1),
        True,
        says="at another place",
        back_within_s=1.0,
    ),
    Row(
        "step of 0.5 m for 2 s",
        PoseFault("pose_jump", 2.0, 0.5),
        True,
        True,
        says="at another place",
        back_within_s=1.0,
        short=True,
    ),
    Row(
        "frozen for 1 s",
        PoseFault("pose_freeze", 1.0),
        True,
        True,
        says="the same to the last bit",
        short=True,
    ),
    Row("noise of 5 mm for 2 s", PoseFault("pose_noise", 2.0, 0.005), None),
    Row("50 ms later for 2 s", PoseFault("pose_delay", 2.0, 0.05), None, back_within_s=1.0),
    Row("wrong frame for 1 s", PoseFault("pose_frame", 1.0), True, True, "frame 'elsewhere'"),
    Row(
        "quaternion of length 0.5 for 1 s",
        PoseFault("pose_quaternion", 1.0, 0.5),
        True,
        True,
        "quaternion has length 0.5",
    ),
    Row("not a number for 1 s", PoseFault("pose_nan", 1.0), True, True, "not finite"),
)
